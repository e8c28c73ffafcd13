//! A clean stop: the first signal lets the work at hand finish and be saved, the second ends the process at once. A signal that whoever started the process had it
//! ignore, as `nohup` does with the hang-up of a terminal, stays ignored.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGHUP, SIGINT, SIGPIPE, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::flag;

/// Ctrl-C, `kill`, a closed terminal, and what schedulers send before their time limit.
const SIGNALS: [i32; 5] = [SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2];

/// The exit code after a second signal, as shells give it for Ctrl-C.
const KILLED: i32 = 130;

/// Where the system says which signals this process ignores.
const STATUS: &str = "/proc/self/status";

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
    // Where nothing is said of it, none is ignored.
    let ignored = std::fs::read_to_string(STATUS).map_or(0, |status| ignored(&status));
    for signal in SIGNALS.into_iter().filter(|signal| ignored & bit(*signal) == 0) {
        // In this order: the shutdown looks at the flag before the first signal raises it.
        flag::register_conditional_shutdown(signal, KILLED, Arc::clone(stop))?;
        flag::register(signal, Arc::clone(stop))?;
    }
    Ok(stop)
}

/// The ignored signals of a process, a bit each, from what the system says of it.
fn ignored(status: &str) -> u64 {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// A signal's bit: the first signal is 1 and has the lowest.
fn bit(signal: i32) -> u64 {
    1 << (signal - 1)
}

/// From now on whoever reads what is printed may stop reading: the process then ends as other programs do, instead of panicking at the next line.
///
/// # Errors
/// The system refuses a handler.
pub(crate) fn end_with_the_reader() -> std::io::Result<()> {
    flag::register_conditional_default(SIGPIPE, Arc::new(AtomicBool::new(true))).map(|_handler| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_from_what_the_system_says() {
        // As of a process under nohup, in the background of a script: hang-up, interrupt and quit.
        let status =
            "Name:\tvibes-train\nSigBlk:\t0000000000000003\nSigIgn:\t0000000000000007\nSigCgt:\t0000000000004000\n";
        let of_each = SIGNALS.map(|signal| ignored(status) & bit(signal) != 0);
        assert_eq!(of_each, [true, false, true, false, false], "SIGINT and SIGHUP alone");
        for status in ["", "SigIgn:", "SigIgn:\tall\n", "SigCgt:\t0000000000000007\n"] {
            assert_eq!(ignored(status), 0, "{status}");
        }
        let own = std::fs::read_to_string(STATUS).unwrap();
        assert!(ignored(&own) & bit(SIGPIPE) != 0, "a program in Rust begins with SIGPIPE ignored: {own}");
    }
}
