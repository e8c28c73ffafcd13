//! An OpenGL context without a window or a display, through EGL.
//!
//! In: nothing. Out: an [`EglContext`], current on the thread that made it, and OpenGL functions by name. EGL is loaded at run time, so a
//! machine without it can do everything but draw. What is drawn on is opened once a process ([`displays`]); a new context goes to the display that
//! has the fewest, or with others to one ([`on_one_display`]).
//!
//! A context may move to another thread once it is current on none: [`visiting`] runs what draws and leaves the thread as it was.
//!
//! A process that was forked from one that has opened EGL cannot draw: the threads of Mesa exist in the parent alone, and their answers would be waited for
//! for ever. It is told so, and how such processes are started instead.
//!
//! Before EGL is opened, `LP_NUM_THREADS=0` is put into the process's environment unless the user has set it: Mesa's software renderer then
//! rasterises on the thread that draws. With threads of its own, Mesa 22.3 (Debian 12) crashes now and then: before it uploads a texture it
//! looks, without a lock, through scenes that its rasteriser threads are still freeing. The collector's page says what was measured.
#![allow(unsafe_code, reason = "EGL is a C library; every call is checked and its handles never leave this module")]

use std::ffi::c_void;
use std::sync::OnceLock;

use khronos_egl as egl;

use crate::error::{Error, Result};

mod displays;

pub use displays::on_one_display;
use displays::{DEVICE, Display};

type Egl = egl::DynamicInstance<egl::EGL1_5>;

/// The library and the displays, at least one, shared by all contexts.
struct Shared {
    egl: Egl,
    displays: Vec<Display>,
}

// SAFETY: EGL calls are thread-safe by specification, and displays and configurations are process-wide handles.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

/// The variable by which Mesa's llvmpipe takes its number of rasteriser threads.
const RASTERISERS: &str = "LP_NUM_THREADS";

/// What a process has opened, or why it could not.
struct Opened {
    process: u32,
    shared: std::result::Result<Shared, String>,
}

static OPENED: OnceLock<Opened> = OnceLock::new();

impl Opened {
    /// Opens EGL for this process.
    fn here() -> Self {
        without_rasteriser_threads();
        Self { process: std::process::id(), shared: open("libEGL.so.1") }
    }

    /// What the process with this number has of it.
    fn of(&self, process: u32) -> Result<&Shared> {
        let shared = self.shared.as_ref().map_err(|fact| refused(fact))?;
        if self.process != process {
            return Err(Error::Render {
                fact: "drawing began in the process that this one was forked from, and its threads are not here".to_owned(),
                expected: "start processes that draw with spawn or forkserver (of Gymnasium's make_vec vectorization_mode=\"async\", \
                           vector_kwargs={\"context\": \"spawn\"}), or use vibes.make_vec, which needs none"
                    .to_owned(),
            });
        }
        Ok(shared)
    }
}

fn shared() -> Result<&'static Shared> {
    OPENED.get_or_init(Opened::here).of(std::process::id())
}

/// What this process has opened already.
fn opened() -> Option<&'static Shared> {
    OPENED.get().and_then(|opened| opened.of(std::process::id()).ok())
}

/// A device that was asked for and cannot draw is the user's to mend; anything else is EGL's.
fn refused(fact: &str) -> Error {
    let fact = fact.to_owned();
    if fact.contains(DEVICE) {
        return Error::Render { fact, expected: "name another device, or none for the first that opens".to_owned() };
    }
    Error::NoEgl { fact }
}

/// Lets Mesa's software renderer draw on the thread that asks for it alone, unless the user says otherwise; the module says why.
///
/// Call it first in `main`, while no other thread can read the environment. Opening EGL does the same, for programs that do not.
pub fn without_rasteriser_threads() {
    if std::env::var_os(RASTERISERS).is_none() {
        // SAFETY: Rust's own readers of the environment share a lock with this call. Where it is not the first thing in `main`, a C library that
        // reads the environment at this very moment on another thread would race; nothing here does before EGL, which is not loaded yet.
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
    egl.bind_api(egl::OPENGL_API).map_err(|error| format!("no OpenGL: {error}"))?;
    let displays = displays::open(&egl)?;
    Ok(Shared { egl, displays })
}

/// A context, without a surface: MuJoCo draws into buffers of its own. It is current on one thread at most, and stays so until another context is or
/// [`visiting`] ends.
pub(super) struct EglContext {
    context: egl::Context,
    display: &'static Display,
    egl: &'static Egl,
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
        let opened = opened();
        let context = opened.and_then(|shared| shared.egl.get_current_context());
        let Some((shared, context)) = opened.zip(context) else {
            return Self { display: None, context: None, surfaces: [None; 2] };
        };
        let surfaces = [egl::DRAW, egl::READ].map(|which| shared.egl.get_current_surface(which));
        Self { display: shared.egl.get_current_display(), context: Some(context), surfaces }
    }

    fn restore(self) {
        let Some(Shared { egl, .. }) = opened() else { return };
        // Without a context before, the display to leave is the one that is current now; with neither, there is nothing to leave.
        let display = self.display.or_else(|| egl.get_current_display());
        if let Some(display) = display.filter(|_| egl.get_current_context() != self.context) {
            let [draw, read] = self.surfaces;
            // A context that was destroyed meanwhile leaves the thread without one; there is nobody to tell.
            let _ = egl.make_current(display, draw, read, self.context);
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
        let Shared { egl, displays } = shared()?;
        let refused = |error: egl::Error| Error::NoEgl { fact: error.to_string() };
        // Which API contexts are made for is a property of the thread.
        egl.bind_api(egl::OPENGL_API).map_err(refused)?;
        let display = Display::enter(displays);
        let context = egl.create_context(display.handle, display.config, None, &[egl::NONE]);
        let context = context.inspect_err(|_| display.leave()).map_err(refused)?;
        let context = Self { context, display, egl };
        context.make_current()?;
        Ok(context)
    }

    /// Makes the context current on this thread if another one is.
    pub(super) fn make_current(&self) -> Result<()> {
        if self.egl.get_current_context() == Some(self.context) {
            return Ok(());
        }
        let made = self.egl.make_current(self.display.handle, None, None, Some(self.context));
        made.map_err(|error| Error::NoEgl { fact: error.to_string() })
    }

    /// The address of an OpenGL function.
    pub(super) fn function(&self, name: &str) -> Result<*const c_void> {
        let address = self.egl.get_proc_address(name).map(|function| function as *const c_void);
        address.ok_or_else(|| Error::NoEgl { fact: format!("OpenGL has no {name}") })
    }
}

impl Drop for EglContext {
    fn drop(&mut self) {
        // A refusal leaves the context to the end of the process; there is nobody to tell.
        let _ = self.egl.make_current(self.display.handle, None, None, None);
        let _ = self.egl.destroy_context(self.display.handle, self.context);
        self.display.leave();
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
    fn drawing_opens_no_rasteriser_threads_unless_asked_to() {
        shared().expect("this machine draws");
        assert!(std::env::var_os(RASTERISERS).is_some());
        let named = |name: &str| name.starts_with("llvmpipe");
        let tasks = std::fs::read_dir("/proc/self/task").expect("Linux").filter_map(std::result::Result::ok);
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
        assert_eq!(names.filter(|name| named(name)).count(), 0, "LP_NUM_THREADS was read");
    }

    #[test]
    fn a_process_forked_from_one_that_draws_is_told_how_to_start_instead() {
        shared().expect("this machine draws");
        let opened = OPENED.get().expect("opened just now");
        assert!(opened.of(opened.process).is_ok());
        let message = opened.of(opened.process + 1).err().expect("a child's number").to_string();
        assert!(message.contains("forked from") && message.contains("\"context\": \"spawn\""), "{message}");
    }

    #[test]
    fn a_library_that_is_not_egl_is_refused() {
        assert!(open("libc.so.6").is_err());
    }
}
