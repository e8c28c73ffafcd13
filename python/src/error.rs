//! Every failure becomes a Python exception: [`Error`] with the message the programs print, never an abort.
//!
//! In: errors of the toolkit's packages, and panics, which would be mistakes of ours. Out: `vibes.Error`. All work is run from here, without the
//! interpreter's lock.

use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

use pyo3::exceptions::PyException;
use pyo3::prelude::*;

use crate::threads::shared_out;

pyo3::create_exception!(
    vibes,
    Error,
    PyException,
    "What went wrong, in the words of the toolkit's programs: the fact, what would be right, the path last."
);

/// An error as the exception.
pub(crate) fn refused(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// Runs `work`, parts of which may go to other threads, without the interpreter's lock; its error or panic becomes the exception.
pub(crate) fn unlocked<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    py.detach(|| on_threads(work)).map_err(Error::new_err)
}

/// As [`unlocked`], with what lies behind a lock. The thread that calls takes it, because a thread that waits for a part of its work takes up other work
/// meanwhile, which would wait there for the lock that itself holds.
pub(crate) fn unlocked_with<G: Send, T: Send, E: Display + Send>(
    py: Python<'_>,
    lock: &Mutex<G>,
    work: impl FnOnce(&mut G) -> Result<T, E> + Send,
) -> PyResult<T> {
    let locked = || {
        let mut guard = lock.lock().unwrap_or_else(PoisonError::into_inner);
        let inside = &mut *guard;
        on_threads(|| work(inside))
    };
    py.detach(locked).map_err(Error::new_err)
}

/// As [`unlocked`], on the thread that calls alone: for work of which no part goes to another thread.
pub(crate) fn unlocked_here<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    py.detach(|| guarded(work)).map_err(Error::new_err)
}

/// Runs `work` where its parts find threads; its error or panic becomes a message.
fn on_threads<T: Send, E: Display + Send>(work: impl FnOnce() -> Result<T, E> + Send) -> Result<T, String> {
    guarded(|| shared_out(work))?.map_err(|error| error.to_string())
}

/// Runs `work`; its error or panic becomes a message.
pub(crate) fn guarded<T, E: Display>(work: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(done) => done.map_err(|error| error.to_string()),
        Err(panic) => {
            let words = panic.downcast_ref::<String>().map(String::as_str);
            let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            Err(format!("a mistake inside vibes ({words}); please report what was called"))
        }
    }
}

/// Whether `bytes` of memory can be had at all: an array too large to allocate would end the process, not raise.
pub(crate) fn affordable(what: &str, sizes: &[usize]) -> PyResult<usize> {
    let bytes = sizes.iter().try_fold(1_usize, |product, &size| product.checked_mul(size));
    let fits = bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    match bytes {
        Some(bytes) if fits => Ok(bytes),
        _ => Err(refused(format!("{what}: {sizes:?} is more than memory holds; ask for less"))),
    }
}
