//! Care of recordings: taking parts of them, joining them, and carrying them to and from the formats of others.
//!
//! In: recordings, or other people's datasets. Out: a new folder, which appears whole or not at all, also where it is stopped half-way. A recording is
//! never changed in place, and a file whose bytes need not change is not written again but linked.

pub mod export;
mod folder;
pub mod import;
pub mod merge;
pub mod select;
pub mod split;

use std::sync::atomic::{AtomicBool, Ordering};

pub(crate) use folder::NewFolder;

use crate::error::{Error, Result};

/// The flag of those who never stop.
static NEVER: AtomicBool = AtomicBool::new(false);

/// That nobody has asked to stop; to be called before every episode.
fn go_on(stop: &AtomicBool) -> Result<()> {
    if stop.load(Ordering::Relaxed) { Err(Error::Stopped) } else { Ok(()) }
}
