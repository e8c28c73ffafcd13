//! Small JSON files of a run. In: a value, or what is wanted of the lines that are there. Out: a file that is there whole or not at all.

use std::path::Path;

use serde::Serialize;
use vibes_data::write_atomically;

use crate::error::{Result, io, malformed};

/// Writes a value in the form that people read, too.
///
/// # Errors
/// The value has no form in JSON, or the file cannot be written.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).map_err(|error| malformed(path, error, "values that JSON can hold"))?;
    Ok(write_atomically(path, (text + "\n").as_bytes())?)
}

/// Whether a counter is left out of a file, which reads a missing one as 0.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
pub(crate) fn is_zero(number: &u64) -> bool {
    *number == 0
}

/// Leaves of a file of JSON lines those that are wanted, as they stand; a line that is no JSON goes too. No file has no lines.
///
/// # Errors
/// The file cannot be read or written.
pub fn keep_lines(path: &Path, is_wanted: impl Fn(&serde_json::Value) -> bool) -> Result<()> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(io("read", path)(error)),
    };
    let is_kept = |line: &&str| serde_json::from_str(line).is_ok_and(|line| is_wanted(&line));
    let kept: String = text.lines().filter(is_kept).flat_map(|line| [line, "\n"]).collect();
    Ok(write_atomically(path, kept.as_bytes())?)
}
