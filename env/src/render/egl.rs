//! An OpenGL context without a window or a display, through EGL.
//!
//! In: nothing. Out: an [`EglContext`], current on the thread that made it, and OpenGL functions by name. EGL is loaded at run time, so a
//! machine without it can do everything but draw. The display is opened once a process: on the device that `MUJOCO_EGL_DEVICE_ID` numbers, as for
//! MuJoCo's own Python package; without it on the first device that opens (a GPU, or Mesa's software device), else on Mesa's surfaceless platform.
//!
//! A context may move to another thread once it is current on none: [`visiting`] runs what draws and leaves the thread as it was.
//!
//! Before EGL is opened, `LP_NUM_THREADS=0` is put into the process's environment unless the user has set it: Mesa's software renderer then
//! rasterises on the thread that draws. With threads of its own, Mesa 22.3 (Debian 12) crashes now and then: before it uploads a texture it
//! looks, without a lock, through scenes that its rasteriser threads are still freeing. The collector's page says what was measured.
#![allow(unsafe_code, reason = "EGL is a C library; every call is checked and its handles never leave this module")]

use std::ffi::c_void;
use std::sync::OnceLock;

use khronos_egl as egl;

use crate::error::{Error, Result};

type Egl = egl::DynamicInstance<egl::EGL1_5>;

/// `EGL_PLATFORM_DEVICE_EXT` of `EGL_EXT_platform_device`.
const PLATFORM_DEVICE: egl::Enum = 0x313F;
/// `EGL_PLATFORM_SURFACELESS_MESA` of `EGL_MESA_platform_surfaceless`.
const PLATFORM_SURFACELESS: egl::Enum = 0x31DD;
const MAX_DEVICES: usize = 16;

const CONFIG: [egl::Int; 17] = [
    egl::RED_SIZE,
    8,
    egl::GREEN_SIZE,
    8,
    egl::BLUE_SIZE,
    8,
    egl::ALPHA_SIZE,
    8,
    egl::DEPTH_SIZE,
    24,
    egl::STENCIL_SIZE,
    8,
    egl::SURFACE_TYPE,
    egl::PBUFFER_BIT,
    egl::RENDERABLE_TYPE,
    egl::OPENGL_BIT,
    egl::NONE,
];

/// The library and the display, shared by all contexts.
struct Shared {
    egl: Egl,
    display: egl::Display,
    config: egl::Config,
}

// SAFETY: EGL calls are thread-safe by specification, and displays and configurations are process-wide handles.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

/// The variable by which Mesa's llvmpipe takes its number of rasteriser threads.
const RASTERISERS: &str = "LP_NUM_THREADS";
/// The variable by which MuJoCo's Python package chooses among several devices.
const DEVICE: &str = "MUJOCO_EGL_DEVICE_ID";

static OPENED: OnceLock<std::result::Result<Shared, String>> = OnceLock::new();

fn shared() -> Result<&'static Shared> {
    let open = || {
        draw_without_rasteriser_threads();
        open("libEGL.so.1")
    };
    OPENED.get_or_init(open).as_ref().map_err(|fact| refused(fact))
}

/// A device that was asked for and cannot draw is the user's to mend; anything else is EGL's.
fn refused(fact: &str) -> Error {
    let fact = fact.to_owned();
    if fact.contains(DEVICE) {
        return Error::Render { fact, expected: "name another device, or none for the first that opens".to_owned() };
    }
    Error::NoEgl { fact }
}

/// See the module.
fn draw_without_rasteriser_threads() {
    if std::env::var_os(RASTERISERS).is_none() {
        // SAFETY: Rust's own readers of the environment share a lock with this call. A C library that reads it at this very moment on another
        // thread would race; nothing here does before EGL, which is not loaded yet.
        unsafe { std::env::set_var(RASTERISERS, "0") };
    }
}

fn open(library: &str) -> std::result::Result<Shared, String> {
    // SAFETY: a library of this name is the system's EGL; its initialisation has no preconditions.
    let egl = unsafe { Egl::load_required_from_filename(library) }.map_err(|error| match error {
        egl::LoadError::Library(error) => error.to_string(),
        egl::LoadError::InvalidVersion { provided, required } => {
            format!("{library} is EGL {provided:?}, not {required:?}")
        }
    })?;
    let display = open_display(&egl)?;
    egl.bind_api(egl::OPENGL_API).map_err(|error| format!("no OpenGL: {error}"))?;
    let config = egl.choose_first_config(display, &CONFIG).map_err(|error| error.to_string())?;
    let config = config.ok_or("no frame buffer with 8-bit colour, 24-bit depth and a stencil")?;
    Ok(Shared { egl, display, config })
}

fn open_display(egl: &Egl) -> std::result::Result<egl::Display, String> {
    let (devices, chosen) = (devices(egl), std::env::var_os(DEVICE));
    let candidates: Vec<(egl::Enum, *mut c_void)> = match &chosen {
        Some(number) => vec![(PLATFORM_DEVICE, devices[device_number(&number.to_string_lossy(), devices.len())?])],
        None => {
            let devices = devices.into_iter().map(|device| (PLATFORM_DEVICE, device));
            devices.chain([(PLATFORM_SURFACELESS, std::ptr::null_mut())]).collect()
        }
    };
    let mut refusal = "no device and no surfaceless platform".to_owned();
    for (platform, native) in candidates {
        // SAFETY: the native handle is a device EGL listed, or the null that the surfaceless platform asks for.
        let display = unsafe { egl.get_platform_display(platform, native, &[egl::ATTRIB_NONE]) };
        match display.and_then(|display| egl.initialize(display).map(|_| display)) {
            Ok(display) => return Ok(display),
            Err(error) => refusal = error.to_string(),
        }
    }
    let asked = chosen.map_or_else(String::new, |number| format!(" on {DEVICE}={}", number.to_string_lossy()));
    Err(format!("no display opens{asked}: {refusal}"))
}

/// The device that a number names, of `count`.
fn device_number(text: &str, count: usize) -> std::result::Result<usize, String> {
    let number = text.trim().parse().ok().filter(|&number: &usize| number < count);
    number.ok_or_else(|| match count {
        0 => format!("{DEVICE} is {text:?}, but EGL lists no devices; unset it"),
        _ => format!("{DEVICE} is {text:?}; this machine's devices are 0 to {}", count - 1),
    })
}

fn devices(egl: &Egl) -> Vec<*mut c_void> {
    type QueryDevices = unsafe extern "system" fn(egl::Int, *mut *mut c_void, *mut egl::Int) -> egl::Boolean;
    let Some(function) = egl.get_proc_address("eglQueryDevicesEXT") else { return Vec::new() };
    // SAFETY: this is the signature of eglQueryDevicesEXT in EGL_EXT_device_enumeration.
    let query: QueryDevices = unsafe { std::mem::transmute(function) };
    let mut devices = vec![std::ptr::null_mut(); MAX_DEVICES];
    let mut count = 0;
    // SAFETY: the list has room for MAX_DEVICES handles.
    let answered = unsafe { query(MAX_DEVICES as egl::Int, devices.as_mut_ptr(), &raw mut count) };
    devices.truncate(if answered == egl::TRUE { count.max(0) as usize } else { 0 });
    devices
}

/// A context, without a surface: MuJoCo draws into buffers of its own. It is current on one thread at most, and stays so until another context is or
/// [`visiting`] ends.
pub(super) struct EglContext {
    context: egl::Context,
    shared: &'static Shared,
}

/// Runs `work`, which may draw, and leaves this thread's OpenGL context as it was: the contexts that `work` used can then be used on any other
/// thread, and whoever else draws on this one goes on undisturbed.
pub fn visiting<T>(work: impl FnOnce() -> T) -> T {
    let before = Current::of_thread();
    let done = work();
    before.restore();
    done
}

/// The context that is current on a thread, with its surfaces; none of a process that has not opened EGL.
struct Current {
    display: Option<egl::Display>,
    context: Option<egl::Context>,
    surfaces: [Option<egl::Surface>; 2],
}

impl Current {
    fn of_thread() -> Self {
        let opened = OPENED.get().and_then(|opened| opened.as_ref().ok());
        let context = opened.and_then(|shared| shared.egl.get_current_context());
        let Some((shared, context)) = opened.zip(context) else {
            return Self { display: None, context: None, surfaces: [None; 2] };
        };
        let surfaces = [egl::DRAW, egl::READ].map(|which| shared.egl.get_current_surface(which));
        Self { display: shared.egl.get_current_display(), context: Some(context), surfaces }
    }

    fn restore(self) {
        let Some(Ok(Shared { egl, display, .. })) = OPENED.get() else { return };
        if egl.get_current_context() != self.context {
            let [draw, read] = self.surfaces;
            // A context that was destroyed meanwhile leaves the thread without one; there is nobody to tell.
            let _ = egl.make_current(self.display.unwrap_or(*display), draw, read, self.context);
        }
    }
}

impl std::fmt::Debug for EglContext {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EglContext").finish_non_exhaustive()
    }
}

impl EglContext {
    /// Makes a context and makes it current on this thread.
    pub(super) fn new() -> Result<Self> {
        let shared = shared()?;
        let refused = |error: egl::Error| Error::NoEgl { fact: error.to_string() };
        // Which API contexts are made for is a property of the thread.
        shared.egl.bind_api(egl::OPENGL_API).map_err(refused)?;
        let context = shared.egl.create_context(shared.display, shared.config, None, &[egl::NONE]).map_err(refused)?;
        let context = Self { context, shared };
        context.make_current()?;
        Ok(context)
    }

    /// Makes the context current on this thread if another one is.
    pub(super) fn make_current(&self) -> Result<()> {
        let Shared { egl, display, .. } = self.shared;
        if egl.get_current_context() == Some(self.context) {
            return Ok(());
        }
        egl.make_current(*display, None, None, Some(self.context))
            .map_err(|error| Error::NoEgl { fact: error.to_string() })
    }

    /// The address of an OpenGL function.
    pub(super) fn function(&self, name: &str) -> Result<*const c_void> {
        let address = self.shared.egl.get_proc_address(name).map(|function| function as *const c_void);
        address.ok_or_else(|| Error::NoEgl { fact: format!("OpenGL has no {name}") })
    }
}

impl Drop for EglContext {
    fn drop(&mut self) {
        let Shared { egl, display, .. } = self.shared;
        // A refusal leaves the context to the end of the process; there is nobody to tell.
        let _ = egl.make_current(*display, None, None, None);
        let _ = egl.destroy_context(*display, self.context);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_named() {
        let fact = open("libEGL-that-is-not-there.so.1").err().expect("no such library");
        assert!(fact.contains("libEGL-that-is-not-there.so.1"), "{fact}");
        let message = Error::NoEgl { fact }.to_string();
        assert!(message.contains("make setup") && message.contains("apt-get install libegl1"), "{message}");
    }

    #[test]
    fn a_device_is_chosen_by_number_or_the_numbers_are_said() {
        assert_eq!(device_number("1", 2), Ok(1));
        for (text, count, said) in [("2", 2, "0 to 1"), ("-1", 2, "0 to 1"), ("gpu", 1, "0 to 0"), ("0", 0, "unset it")]
        {
            let fact = device_number(text, count).unwrap_err();
            assert!(fact.contains(said) && fact.contains(DEVICE), "{fact}");
            assert!(refused(&fact).to_string().contains("another device"), "no advice to install what is there");
        }
    }

    #[test]
    fn drawing_opens_no_rasteriser_threads_unless_asked_to() {
        shared().expect("this machine draws");
        assert!(std::env::var_os(RASTERISERS).is_some());
        let named = |name: &str| name.starts_with("llvmpipe");
        let tasks = std::fs::read_dir("/proc/self/task").expect("Linux").filter_map(std::result::Result::ok);
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
        assert_eq!(names.filter(|name| named(name)).count(), 0, "LP_NUM_THREADS was read");
    }

    #[test]
    fn a_library_that_is_not_egl_is_refused() {
        assert!(open("libc.so.6").is_err());
    }
}
