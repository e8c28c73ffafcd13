//! What every reader of a file that may come from somebody else has in common: bytes in, a verdict out. An error is a verdict; a panic, a hang or a huge allocation
//! is a fault of the reader.
//!
//! The readers themselves stand in `readers/`, one file for the packages of each program. Two use them: `tests/fuzz.rs` of the programs' packages, which run seeded
//! mutations of valid files through them in every test run ([`damage.rs`](damage.rs)), and the libFuzzer target beside this file (`make fuzz`).

use std::fs;
use std::path::{Path, PathBuf};

/// A reader: its name, a valid file, and what reads damaged copies of it. That is given the folder of all valid files and the path of the damaged one.
pub(crate) struct Reader {
    pub(crate) name: &'static str,
    pub(crate) file: &'static str,
    pub(crate) read: fn(&Path, &Path) -> bool,
}

/// The readers of some packages, and what makes their valid files in a folder.
pub(crate) struct Part {
    pub(crate) readers: &'static [Reader],
    pub(crate) make: fn(&Path),
}

/// A folder of valid files, each of which a reader is given damaged copies of.
pub(crate) struct Readers {
    folder: tempfile::TempDir,
}

impl Readers {
    /// Makes the valid files of some parts.
    pub(crate) fn new(parts: &[Part]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for part in parts {
            (part.make)(folder.path());
        }
        Self { folder }
    }

    /// The valid file of a reader.
    pub(crate) fn valid(&self, reader: &Reader) -> Vec<u8> {
        fs::read(self.path(reader)).unwrap()
    }

    /// Gives a reader these bytes; says whether it took them.
    pub(crate) fn run(&self, reader: &Reader, bytes: &[u8]) -> bool {
        let path = self.path(reader);
        // What is mapped keeps its pages: another file takes the name.
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).unwrap();
        (reader.read)(self.folder.path(), &path)
    }

    fn path(&self, reader: &Reader) -> PathBuf {
        self.folder.path().join(reader.file)
    }
}
