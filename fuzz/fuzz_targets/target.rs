//! What every target does: gives one reader the fuzzer's bytes.

#[allow(dead_code, reason = "the seeded test uses the rest")]
#[path = "../readers.rs"]
mod readers;

use readers::{READERS, Readers};

/// Runs the reader of this name.
pub(crate) fn run(name: &str, bytes: &[u8]) {
    thread_local!(static READERS_AT_WORK: Readers = Readers::new());
    if let Some(reader) = READERS.iter().find(|reader| reader.name == name) {
        READERS_AT_WORK.with(|readers| readers.run(reader, bytes));
    }
}
