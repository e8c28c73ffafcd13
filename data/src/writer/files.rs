//! A recording's files while it is written: those of other recordings that come in, and those that a killed or an earlier command left. In: folders and entries. Out: files in
//! their places, whole or not at all.

use std::path::Path;

use super::FileTransfer;
use crate::atomic::PARTIAL;
use crate::map::MappedTable;
use crate::recording::{EPISODES, numbered};
use crate::verify::check_file;
use crate::{EpisodeEntry, Error, FileEntry, Result, arrow_table, write_atomically};

/// Brings a file of the recording in `from` into the one in `to`, under `name`. A link is the file itself, whatever is in it; what is copied is read anyway, and checked.
pub(super) fn transfer(
    (from, to): (&Path, &Path),
    file: &mut FileEntry,
    name: String,
    transfer: FileTransfer,
) -> Result<()> {
    let (source, place) = (from.join(&file.path), to.join(&name));
    let found = std::fs::metadata(&source).map_err(Error::io("read", &source))?;
    if !found.is_file() || found.len() != file.bytes {
        let expected = format!("{} bytes as the manifest says", file.bytes);
        return Err(Error::malformed(source, format!("{} bytes", found.len()), expected));
    }
    if transfer == FileTransfer::Copy || std::fs::hard_link(&source, &place).is_err() {
        check(from, file, "a copy of it would be as damaged; put the file back as it was")?;
        let contents = std::fs::read(&source).map_err(Error::io("copy", &source))?;
        write_atomically(&place, &contents)?;
    }
    file.path = name;
    Ok(())
}

/// That a file is what was written.
pub(super) fn check(folder: &Path, file: &FileEntry, expected: &str) -> Result<()> {
    check_file(folder, file).map_err(|finding| Error::malformed(finding.path, finding.fault, expected))
}

/// That no finished episode lies where a recording is to begin: under its number it would pass for one of the new recording.
pub(super) fn check_empty(path: &Path) -> Result<()> {
    if numbered(&path.join(EPISODES), "arrow")?.is_empty() {
        return Ok(());
    }
    let expected = "put its manifest.json back, or name another folder with -o";
    Err(Error::malformed(path, "episodes of another recording lie here, without its manifest", expected))
}

/// Whether a recording began before there was the column of the distractor that a policy saw, as the first of its episodes tells. All of its tables keep one schema, so that they
/// can be read as one.
pub(super) fn is_older(path: &Path, episodes: &[EpisodeEntry]) -> bool {
    let table = episodes.first().and_then(|entry| MappedTable::open(&path.join(&entry.arrow.path)).ok());
    table.is_some_and(|table| table.schema().column_with_name(arrow_table::ACTING_DISTRACTOR).is_none())
}

/// Removes a file if it is there.
pub(super) fn remove_if_there(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path)(error)),
        _ => Ok(()),
    }
}

/// What a killed process left behind was never part of the recording.
pub(super) fn remove_partial_files(folder: &Path) -> Result<()> {
    for file in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
        let path = file.map_err(Error::io("list", folder))?.path();
        if path.extension().is_some_and(|ending| ending == PARTIAL) {
            std::fs::remove_file(&path).map_err(Error::io("remove", &path))?;
        }
    }
    Ok(())
}
