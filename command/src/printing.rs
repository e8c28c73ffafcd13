//! A line that cannot be printed, as on a full disk: the standard library panics there, and a program has to end with one line and the exit code of a failure.

use std::any::Any;
use std::io::Write;

use crate::Ending;

/// How the standard library's panic begins where `println!` or `eprintln!` fails; the stream and the system's answer follow.
const FAILED: &str = "failed printing to ";

/// From now on a line that cannot be printed ends the process as a failure; every other panic stays what it is.
pub(crate) fn end_without_output(program: String) {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let Some(fact) = unprinted(panic.payload()) else {
            before(panic);
            return;
        };
        // Where standard error cannot be written either, the exit code has to say it alone.
        let _ = writeln!(std::io::stderr(), "{program}: cannot write to {fact}");
        std::process::exit(i32::from(Ending::Failed.code()));
    }));
}

/// Which stream could not be written, and why, if that is what the panic is about.
fn unprinted(payload: &dyn Any) -> Option<&str> {
    payload.downcast_ref::<String>()?.strip_prefix(FAILED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_about_something_else_is_none_of_ours() {
        let text = |text: &str| text.to_owned();
        assert_eq!(unprinted(&text("failed printing to stdout: no space")), Some("stdout: no space"));
        assert_eq!(unprinted(&text("index out of bounds")), None);
        assert_eq!(unprinted(&"failed printing to stdout"), None, "ours is made while it runs");
        assert_eq!(unprinted(&7), None);
    }
}
