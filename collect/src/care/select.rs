//! Some of a recording's episodes as a recording of their own. They keep their numbers and their cells, so that their files are linked as they are,
//! rows of a table of latents of the whole have the same keys in its parts, and parts can be joined to the whole again.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::atomic::AtomicBool;

use serde_json::Value;
use vibes_data::{EpisodeEntry, FileTransfer, Manifest, Recording, RecordingWriter};

use super::{NEVER, NewFolder, go_on};
use crate::error::{Error, Result};
use crate::keys::{SUBSET, WHOLE};
use crate::paths::rebase;

/// Which episodes are kept: those that pass every test that is given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filter {
    /// Smallest return.
    pub min_return: Option<f64>,
    /// Largest return.
    pub max_return: Option<f64>,
    /// Policies, any of them, as the manifest names them; all when empty.
    pub policies: Vec<String>,
    /// Rows of the grid.
    pub states: Option<Numbers>,
    /// Columns of the grid.
    pub distractors: Option<Numbers>,
    /// Episode numbers.
    pub episodes: Option<Numbers>,
}

impl Filter {
    /// Whether an episode passes.
    pub fn keeps(&self, entry: &EpisodeEntry) -> bool {
        let holds = |numbers: &Option<Numbers>, number: Option<u32>| match numbers {
            None => true,
            Some(numbers) => number.is_some_and(|number| numbers.contains(number)),
        };
        self.min_return.is_none_or(|least| entry.episode_return >= least)
            && self.max_return.is_none_or(|most| entry.episode_return <= most)
            && (self.policies.is_empty() || self.policies.contains(&entry.policy))
            && holds(&self.states, entry.cell.map(|cell| cell.state))
            && holds(&self.distractors, entry.cell.map(|cell| cell.distractor))
            && holds(&self.episodes, Some(entry.index))
    }

    /// The numbers of the episodes that pass.
    ///
    /// # Errors
    /// [`Error::Selection`] when none does, and says what there is.
    pub fn select(&self, recording: &Recording) -> Result<Vec<u32>> {
        let kept: Vec<u32> = recording.episodes().iter().filter(|entry| self.keeps(entry)).map(|e| e.index).collect();
        if kept.is_empty() {
            return Err(Error::Selection { fact: "no episode passes".into(), expected: holdings(recording) });
        }
        Ok(kept)
    }
}

/// What a recording holds, in one line.
fn holdings(recording: &Recording) -> String {
    let entries = recording.episodes();
    if entries.is_empty() {
        return "the recording has no episodes".into();
    }
    let returns = entries.iter().map(|entry| entry.episode_return);
    let (low, high) = returns.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(r), high.max(r)));
    let policies: std::collections::BTreeSet<&str> = entries.iter().map(|entry| entry.policy.as_str()).collect();
    let policies = policies.into_iter().collect::<Vec<_>>().join(", ");
    let grid = recording.manifest().grid;
    let grid = grid.map_or("no grid".into(), |grid| format!("a grid of {} x {}", grid.states, grid.distractors));
    format!("the recording has {} episodes of returns {low} to {high}, policies {policies}, {grid}", entries.len())
}

/// A part of a recording that is to be written.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The numbers of its episodes, rising.
    pub kept: &'a [u32],
    /// How they were chosen. The manifest's options keep it under `subset`, so that the command that made the whole recording does not take the part for
    /// an unfinished one.
    pub note: &'a Value,
    /// The new recording's folder.
    pub out: &'a Path,
}

/// Writes the episodes of these numbers into a new recording, their files linked or copied as they are; see [`Part`].
///
/// # Errors
/// When the folder is taken, or a file cannot be linked or copied.
pub fn write_subset(
    recording: &Recording,
    kept: &[u32],
    note: &Value,
    out: &Path,
    transfer: FileTransfer,
) -> Result<Recording> {
    write_subsets(recording, &[Part { kept, note, out }], transfer, &NEVER)?;
    Ok(Recording::open(out)?)
}

/// Writes several parts, all of them or none, until `stop` is raised.
///
/// # Errors
/// As [`write_subset`]; [`Error::Stopped`].
pub fn write_subsets(
    recording: &Recording,
    parts: &[Part<'_>],
    transfer: FileTransfer,
    stop: &AtomicBool,
) -> Result<()> {
    // Every place before the first is written: none is left alone because another was taken.
    let begin = |part: &Part<'_>| NewFolder::begin(part.out, [recording.path()]);
    let folders = parts.iter().map(begin).collect::<Result<Vec<_>>>()?;
    for (part, folder) in parts.iter().zip(&folders) {
        fill(recording, part, folder.path(), transfer, stop)?;
    }
    folders.into_iter().try_for_each(NewFolder::finish)
}

/// Writes a part into the folder where it is made.
fn fill(
    recording: &Recording,
    part: &Part<'_>,
    folder: &Path,
    transfer: FileTransfer,
    stop: &AtomicBool,
) -> Result<()> {
    let mut options = with_note(&recording.manifest().options, part.note, recording.episodes().len());
    rebase(&mut options, Some(recording.path()), Some(part.out));
    let header = Manifest { options, episodes: Vec::new(), ..recording.manifest().clone() };
    let writer = RecordingWriter::create_or_resume(folder, header, false)?;
    for entry in recording.episodes().iter().filter(|entry| part.kept.binary_search(&entry.index).is_ok()) {
        go_on(stop)?;
        writer.take(recording, entry, transfer)?;
    }
    writer.finish()?;
    Ok(())
}

/// The options with a note of what was taken of how many `episodes`, and from what part if it was one already: then the whole is that part's. A part is not under
/// the protocol that the whole was recorded under.
fn with_note(options: &Value, note: &Value, episodes: usize) -> Value {
    let mut options = options.as_object().cloned().unwrap_or_default();
    options.remove("protocol");
    let before = options.remove(SUBSET);
    let whole = before.as_ref().map_or(Some(episodes as u64), |before| before.get(WHOLE).and_then(Value::as_u64));
    let mut note = note.clone();
    if let Some(note) = note.as_object_mut() {
        note.extend(whole.map(|whole| (WHOLE.to_owned(), Value::from(whole))));
        note.extend(before.map(|before| ("of".to_owned(), before)));
    }
    options.insert(SUBSET.into(), note);
    Value::Object(options)
}

/// A list of numbers and ranges, both ends included, as in `0-4,7`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbers(Vec<(u32, u32)>);

impl Numbers {
    fn contains(&self, number: u32) -> bool {
        self.0.iter().any(|&(first, last)| (first..=last).contains(&number))
    }
}

impl FromStr for Numbers {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let range = |part: &str| -> Option<(u32, u32)> {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let range = (first.trim().parse().ok()?, last.trim().parse().ok()?);
            (range.0 <= range.1).then_some(range)
        };
        let ranges: Option<Vec<_>> = text.split(',').map(range).collect();
        ranges.map(Self).ok_or_else(|| "a list of numbers and ranges, as in 0-4,7".into())
    }
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part =
            |&(first, last): &(u32, u32)| if first == last { first.to_string() } else { format!("{first}-{last}") };
        f.write_str(&self.0.iter().map(part).collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_under_no_protocol() {
        let whole = serde_json::json!({ "task": "reacher-easy", "protocol": "dcs-easy-dynamic-500k" });
        let part = with_note(&whole, &serde_json::json!({ "min_return": 800 }), 7);
        let said = serde_json::json!({ "min_return": 800, "whole": 7 });
        assert_eq!(part, serde_json::json!({ "task": "reacher-easy", (SUBSET): said }));
        let less = with_note(&part, &serde_json::json!({ "states": "0" }), 4);
        assert_eq!(less[SUBSET], serde_json::json!({ "states": "0", "whole": 7, "of": said }), "the whole is the same");
    }

    #[test]
    fn lists_of_numbers_are_read_and_written() {
        let numbers: Numbers = "0-4,7".parse().unwrap();
        assert_eq!(numbers.to_string(), "0-4,7");
        assert_eq!((0..9).filter(|&n| numbers.contains(n)).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 7]);
        for text in ["", "4-1", "a", "-3", "1,,2", "99999999999"] {
            assert!(text.parse::<Numbers>().is_err(), "{text}");
        }
    }
}
