//! Small JSON files of a run. In: a value. Out: a file that is there whole or not at all.

use std::path::Path;

use serde::Serialize;
use vibes_data::write_atomically;

use crate::error::{Result, malformed};

/// Writes a value in the form that people read, too.
///
/// # Errors
/// The value has no form in JSON, or the file cannot be written.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).map_err(|error| malformed(path, error, "values that JSON can hold"))?;
    Ok(write_atomically(path, (text + "\n").as_bytes())?)
}
