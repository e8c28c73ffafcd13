//! The libFuzzer target of every reader. In: bytes; `VIBES_FUZZ_ONLY` names the reader that is given them, and `VIBES_FUZZ_CORPUS` a folder of corpora, one a
//! reader, into which every reader's valid file is put first.
//!
//! One binary for all, so that a reader that is added to the registry is fuzzed without another file.

#![no_main]

#[path = "../readers.rs"]
mod readers;

use std::path::PathBuf;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use readers::{READERS, Reader, Readers};

/// The reader that was asked for.
fn chosen() -> &'static Reader {
    static CHOSEN: OnceLock<&Reader> = OnceLock::new();
    CHOSEN.get_or_init(|| {
        let name = std::env::var("VIBES_FUZZ_ONLY").unwrap_or_default();
        let known = READERS.iter().map(|reader| reader.name).collect::<Vec<_>>().join(", ");
        READERS.iter().find(|reader| reader.name == name).unwrap_or_else(|| panic!("VIBES_FUZZ_ONLY names no reader; one of {known}"))
    })
}

thread_local!(static READERS_AT_WORK: Readers = Readers::new());

/// The valid files, as the inputs that everything begins with.
fn begin() {
    let Some(folder) = std::env::var_os("VIBES_FUZZ_CORPUS").map(PathBuf::from) else { return };
    for reader in &READERS {
        let corpus = folder.join(reader.name);
        std::fs::create_dir_all(&corpus).expect("a folder that can be written");
        let valid = READERS_AT_WORK.with(|readers| readers.valid(reader));
        std::fs::write(corpus.join("valid"), valid).expect("a folder that can be written");
    }
}

fuzz_target!(
    init: begin(),
    |bytes: &[u8]| {
        READERS_AT_WORK.with(|readers| readers.run(chosen(), bytes));
    }
);
