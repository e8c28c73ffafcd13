//! The libFuzzer target of every reader. In: bytes; `VIBES_FUZZ_ONLY` names the reader that is given them, and `VIBES_FUZZ_CORPUS` a folder of corpora, one a
//! reader, into which every reader's valid file is put first.
//!
//! One binary for all, so that a reader that is added to a registry is fuzzed without another file.

#![no_main]

#[path = "../readers/analyze.rs"]
mod analyze;
#[path = "../readers/collect.rs"]
mod collect;
#[path = "../readers.rs"]
mod readers;
#[path = "../readers/train.rs"]
mod train;

use std::path::PathBuf;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use readers::{Part, Reader, Readers};

const PARTS: [Part; 3] = [collect::PART, train::PART, analyze::PART];

/// Every reader.
fn all() -> impl Iterator<Item = &'static Reader> {
    PARTS.iter().flat_map(|part| part.readers)
}

/// The reader that was asked for.
fn chosen() -> &'static Reader {
    static CHOSEN: OnceLock<&Reader> = OnceLock::new();
    CHOSEN.get_or_init(|| {
        let name = std::env::var("VIBES_FUZZ_ONLY").unwrap_or_default();
        let known = all().map(|reader| reader.name).collect::<Vec<_>>().join(", ");
        all()
            .find(|reader| reader.name == name)
            .unwrap_or_else(|| panic!("VIBES_FUZZ_ONLY names no reader; one of {known}"))
    })
}

thread_local!(static READERS_AT_WORK: Readers = Readers::new(&PARTS));

/// The valid files, as the inputs that everything begins with.
fn begin() {
    let Some(folder) = std::env::var_os("VIBES_FUZZ_CORPUS").map(PathBuf::from) else { return };
    for reader in all() {
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
