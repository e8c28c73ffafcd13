//! A clean stop: the first signal lets the work at hand finish and be saved, the second ends the process at once.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGHUP, SIGINT, SIGPIPE, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::flag;

/// Ctrl-C, `kill`, a closed terminal, and what schedulers send before their time limit.
const SIGNALS: [i32; 5] = [SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2];

/// The exit code after a second signal, as shells give it for Ctrl-C.
const KILLED: i32 = 130;

/// The flag that the first signal raises; it is one and the same for the whole process.
///
/// # Errors
/// The system refuses a handler.
pub fn stop_on_signals() -> std::io::Result<&'static AtomicBool> {
    static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(stop) = STOP.get() {
        return Ok(stop);
    }
    let stop = STOP.get_or_init(Arc::default);
    for signal in SIGNALS {
        // In this order: the shutdown looks at the flag before the first signal raises it.
        flag::register_conditional_shutdown(signal, KILLED, Arc::clone(stop))?;
        flag::register(signal, Arc::clone(stop))?;
    }
    Ok(stop)
}

/// From now on whoever reads what is printed may stop reading: the process then ends as other programs do, instead of panicking at the next line.
///
/// # Errors
/// The system refuses a handler.
pub(crate) fn end_with_the_reader() -> std::io::Result<()> {
    flag::register_conditional_default(SIGPIPE, Arc::new(AtomicBool::new(true))).map(|_handler| ())
}
