//! What is drawn on: EGL's displays.
//!
//! In: EGL. Out: one [`Display`], or several of the same software renderer. The first is the device that `MUJOCO_EGL_DEVICE_ID` numbers, as for
//! MuJoCo's own Python package; without it the first device that opens (a GPU, or Mesa's software device), else Mesa's surfaceless platform.
//!
//! Why several: all contexts of one display share Mesa's screen, and llvmpipe without rasteriser threads of its own rasterises under a lock of that
//! screen, so that two threads draw little faster than one. A display of its own has a screen of its own. EGL gives the same display for the same
//! platform, device and attributes, but no list of attributes is another one than an empty list, and the surfaceless platform draws on the same
//! software device: up to four displays. A GPU's contexts do not wait for each other so, and get one.

use std::cell::Cell;
use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};

use khronos_egl as egl;

use super::Egl;

/// The variable by which MuJoCo's Python package chooses among several devices.
pub(super) const DEVICE: &str = "MUJOCO_EGL_DEVICE_ID";

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

/// A display that is open, and how many contexts it has.
pub(super) struct Display {
    pub(super) handle: egl::Display,
    pub(super) config: egl::Config,
    contexts: AtomicUsize,
}

/// Which display the next context of a thread gets.
#[derive(Clone, Copy, Debug)]
enum Choice {
    /// The one with the fewest contexts.
    Emptiest,
    /// The same for all until [`on_one_display`] ends; none yet.
    OneForAll(Option<usize>),
}

thread_local! {
    static CHOICE: Cell<Choice> = const { Cell::new(Choice::Emptiest) };
}

/// Runs `work`, whose contexts all go to the display that has the fewest when the first is made. Contexts that are drawn with one after the other,
/// on one thread, are made so: they never wait for each other, and other displays stay free for other threads.
pub fn on_one_display<T>(work: impl FnOnce() -> T) -> T {
    let before = CHOICE.replace(Choice::OneForAll(None));
    let done = work();
    CHOICE.set(before);
    done
}

impl Display {
    /// The display that this thread's next context gets, which has one more now.
    pub(super) fn enter(displays: &[Self]) -> &Self {
        let index = match CHOICE.get() {
            Choice::OneForAll(Some(index)) => index,
            Choice::Emptiest | Choice::OneForAll(None) => emptiest(displays),
        };
        if let Choice::OneForAll(_) = CHOICE.get() {
            CHOICE.set(Choice::OneForAll(Some(index)));
        }
        displays[index].contexts.fetch_add(1, Ordering::Relaxed);
        &displays[index]
    }

    /// One context fewer.
    pub(super) fn leave(&self) {
        self.contexts.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Two threads at once may find the same: they draw slower, and right.
fn emptiest(displays: &[Display]) -> usize {
    let contexts = |index: &usize| displays[*index].contexts.load(Ordering::Relaxed);
    (0..displays.len()).min_by_key(contexts).unwrap_or(0)
}

/// Where a display may be opened.
#[derive(Clone, Copy, Debug)]
struct Place {
    platform: egl::Enum,
    native: *mut c_void,
}

const SURFACELESS: Place = Place { platform: PLATFORM_SURFACELESS, native: std::ptr::null_mut() };

/// Opens the displays of the module's description.
///
/// # Errors
/// That none opens, and EGL's reason of the last.
pub(super) fn open(egl: &Egl) -> Result<Vec<Display>, String> {
    let (devices, chosen) = (devices(egl), std::env::var_os(DEVICE));
    let device = |native| Place { platform: PLATFORM_DEVICE, native };
    let places: Vec<Place> = match &chosen {
        Some(number) => vec![device(devices[device_number(&number.to_string_lossy(), devices.len())?])],
        None => devices.iter().copied().map(device).chain([SURFACELESS]).collect(),
    };
    let mut refusal = "no device and no surfaceless platform".to_owned();
    for place in places {
        match open_at(egl, place, Some(&[egl::ATTRIB_NONE])) {
            Ok(first) => return Ok(with_siblings(egl, place, first, &devices)),
            Err(error) => refusal = error,
        }
    }
    let asked = chosen.map_or_else(String::new, |number| format!(" on {DEVICE}={}", number.to_string_lossy()));
    Err(format!("no display opens{asked}: {refusal}"))
}

/// The first display and, of a software renderer, the others that draw alike.
fn with_siblings(egl: &Egl, place: Place, first: Display, devices: &[*mut c_void]) -> Vec<Display> {
    let is_surfaceless = place.platform == PLATFORM_SURFACELESS;
    // The surfaceless platform takes a GPU if there is one.
    let all_software = devices.iter().all(|&device| is_software(egl, device));
    let mut displays = vec![first];
    if if is_surfaceless { all_software } else { is_software(egl, place.native) } {
        displays.extend(open_at(egl, place, None));
        if all_software && !is_surfaceless {
            displays.extend(open_at(egl, SURFACELESS, Some(&[egl::ATTRIB_NONE])));
            displays.extend(open_at(egl, SURFACELESS, None));
        }
    }
    // An implementation that gives the same display twice has no second one to give.
    let mut handles = Vec::new();
    displays.retain(|display| {
        let is_new = !handles.contains(&display.handle.as_ptr());
        handles.push(display.handle.as_ptr());
        is_new
    });
    displays
}

fn open_at(egl: &Egl, place: Place, attributes: Option<&[egl::Attrib]>) -> Result<Display, String> {
    let handle = platform_display(egl, place, attributes)?;
    egl.initialize(handle).map_err(|error| error.to_string())?;
    let config = egl.choose_first_config(handle, &CONFIG).map_err(|error| error.to_string())?;
    let config = config.ok_or("no frame buffer with 8-bit colour, 24-bit depth and a stencil")?;
    Ok(Display { handle, config, contexts: AtomicUsize::new(0) })
}

/// `eglGetPlatformDisplay`, which khronos-egl offers only with a list of attributes.
fn platform_display(egl: &Egl, place: Place, attributes: Option<&[egl::Attrib]>) -> Result<egl::Display, String> {
    type GetPlatformDisplay = unsafe extern "system" fn(egl::Enum, *mut c_void, *const egl::Attrib) -> *mut c_void;
    let function = egl.get_proc_address("eglGetPlatformDisplay").ok_or("EGL has no eglGetPlatformDisplay")?;
    // SAFETY: this is the signature of eglGetPlatformDisplay in EGL 1.5.
    let get: GetPlatformDisplay = unsafe { std::mem::transmute(function) };
    let list = attributes.map_or(std::ptr::null(), <[egl::Attrib]>::as_ptr);
    // SAFETY: the native handle is a device that EGL listed, or the null that the surfaceless platform asks for; the list, if any, ends with NONE.
    let handle = unsafe { get(place.platform, place.native, list) };
    if handle.is_null() {
        return Err(egl.get_error().map_or_else(|| "no display".to_owned(), |error| error.to_string()));
    }
    // SAFETY: EGL has just given this display.
    Ok(unsafe { egl::Display::from_ptr(handle) })
}

/// Whether a device is Mesa's software renderer: `EGL_MESA_device_software`.
fn is_software(egl: &Egl, device: *mut c_void) -> bool {
    type QueryString = unsafe extern "system" fn(*mut c_void, egl::Int) -> *const c_char;
    let Some(function) = egl.get_proc_address("eglQueryDeviceStringEXT") else { return false };
    // SAFETY: this is the signature of eglQueryDeviceStringEXT in EGL_EXT_device_query.
    let query: QueryString = unsafe { std::mem::transmute(function) };
    // SAFETY: the device is one that EGL listed; the answer is null or a string of EGL's own that lives as long as it.
    let extensions = unsafe {
        let text = query(device, egl::EXTENSIONS);
        if text.is_null() { None } else { CStr::from_ptr(text).to_str().ok() }
    };
    extensions.is_some_and(|text| text.split(' ').any(|name| name == "EGL_MESA_device_software"))
}

/// The device that a number names, of `count`.
fn device_number(text: &str, count: usize) -> Result<usize, String> {
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

#[cfg(test)]
mod tests {
    use super::super::{EglContext, refused, shared};
    use super::*;

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
    fn contexts_spread_over_the_displays_and_leave_them() {
        let shared = shared().expect("this machine draws");
        let software = devices(&shared.egl).iter().all(|&device| is_software(&shared.egl, device));
        assert_eq!(shared.displays.len() > 1, software, "only a software renderer has siblings");
        let displays: Vec<Display> = [0; 3].map(|_| fake(shared)).into();
        let entered = || {
            let entered = Display::enter(&displays);
            displays.iter().position(|display| std::ptr::eq(display, entered))
        };
        assert_eq!([0; 4].map(|_| entered()), [0, 1, 2, 0].map(Some));
        displays[1].leave();
        assert_eq!(on_one_display(|| [0; 3].map(|_| entered())), [Some(1); 3]);
        assert_eq!(entered(), Some(2), "afterwards the emptiest again");
    }

    fn fake(shared: &super::super::Shared) -> Display {
        let Display { handle, config, .. } = shared.displays[0];
        Display { handle, config, contexts: AtomicUsize::new(0) }
    }

    #[test]
    fn a_context_is_current_on_whichever_display_it_has() {
        let contexts: Vec<_> = (0..5).map(|_| EglContext::new().expect("this machine draws")).collect();
        for context in contexts.iter().rev() {
            context.make_current().expect("on its own display");
            assert_eq!(context.egl.get_current_context(), Some(context.context));
            assert_eq!(context.egl.get_current_display(), Some(context.display.handle));
        }
    }
}
