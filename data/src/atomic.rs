//! Files that appear whole or not at all: written beside their place, flushed, and renamed into it.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// The ending of a file that is still being written; such a file is never read.
pub(crate) const PARTIAL: &str = "partial";

/// Writes `bytes` to `path` so that a reader sees the old file or the new one, never a part.
///
/// # Errors
/// [`Error::Io`] when the disk is full or the folder cannot be written; the partial file is then removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = partial_path(path);
    let result = write_and_flush(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    if result.is_err() {
        // The first error is the one to report; a leftover partial file is ignored by readers anyway.
        let _ = fs::remove_file(&partial);
    }
    result.map_err(Error::io("write", path))
}

/// The SHA-256 of `bytes` in lowercase hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

pub(crate) fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".");
    name.push(PARTIAL);
    path.with_file_name(name)
}

fn write_and_flush(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_data()
}
