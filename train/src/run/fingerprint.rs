//! By what a recording is known again, also when it has grown since. In: a recording. Out: a count of its first episodes and one checksum of theirs, which `run.json` keeps beside
//! everything else that it says.
//!
//! Names and sizes do not tell one recording from another: whoever collects anew under the same name gets as many episodes of as many steps, and the run would go on with them,
//! and forget that it has learned from others.

use std::path::Path;

use serde::{Deserialize, Serialize};
use vibes_data::{EpisodeEntry, Recording, sha256_hex};

use super::RunInfo;
use crate::error::{Result, io, malformed};
use crate::json::write_json;

/// The first episodes of a recording. Those behind a gap, as of a recording that is still being made, are not among them: what fills the gap may come later.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Fingerprint {
    /// How many.
    episodes: usize,
    /// Of the checksums of their tables, in their order.
    sha256: String,
}

impl Fingerprint {
    /// That of a recording as it is now.
    pub(super) fn of(recording: &Recording) -> Self {
        Self::of_first(recording, usize::MAX)
    }

    /// Whether a recording begins with these episodes.
    pub(super) fn is_of(&self, recording: &Recording) -> bool {
        Self::of_first(recording, self.episodes) == *self
    }

    fn of_first(recording: &Recording, most: usize) -> Self {
        let is_in_row = |(place, entry): &(usize, &EpisodeEntry)| entry.index as usize == *place;
        let row = recording.episodes().iter().take(most).enumerate().take_while(is_in_row);
        let sums: Vec<&str> = row.map(|(_, entry)| entry.arrow.sha256.as_str()).collect();
        Self { episodes: sums.len(), sha256: sha256_hex(sums.join("\n").as_bytes()) }
    }
}

/// `run.json` as it is written: what others read of it, and the fingerprints.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    info: &'a RunInfo,
    #[serde(skip_serializing_if = "<[Fingerprint]>::is_empty")]
    fingerprints: &'a [Fingerprint],
}

/// The part of it that only this module reads.
#[derive(Deserialize)]
struct Read {
    #[serde(default)]
    fingerprints: Vec<Fingerprint>,
}

/// Writes `run.json`.
///
/// # Errors
/// It cannot be written.
pub(super) fn write(file: &Path, info: &RunInfo, fingerprints: &[Fingerprint]) -> Result<()> {
    write_json(file, &Written { info, fingerprints })
}

/// The fingerprints in `run.json`; none in one of before they were kept.
///
/// # Errors
/// It cannot be read, or they are damaged.
pub(super) fn read(file: &Path) -> Result<Vec<Fingerprint>> {
    let text = std::fs::read_to_string(file).map_err(io("read", file))?;
    let read: Read =
        serde_json::from_str(&text).map_err(|error| malformed(file, error, "a run.json as vibes-train writes it"))?;
    Ok(read.fingerprints)
}
