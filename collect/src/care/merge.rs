//! Joining recordings of one spec.
//!
//! Parts of one recording (of a split, of a filter, of two machines that ran the same command) are put together again: numbers, cells and files stay
//! as they are, and the whole is what it was before it was divided. Recordings of different commands become plain episodes, numbered
//! anew in the order given; they lose their cells, since row 3 of one grid is not row 3 of another. Files that hold another number, cell or video
//! afterwards are written again, the others linked. An episode that is in several of the recordings is there once.

mod kinship;
mod repeats;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use vibes_data::{FileTransfer, Grid, MOST_EPISODES, Manifest, Recording, RecordingWriter, Video, episode_schema};

use self::kinship::{check_specs, same_recording, whole_of};
use self::repeats::{moved, repeats};
use super::{NEVER, NewFolder, go_on};
use crate::error::{Error, Result};
use crate::keys::{MERGED, SUBSET, WHOLE};
use crate::paths::rebase;

/// One of the recordings that a merged one was made of: what it takes to simulate and draw its episodes again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MergedPart {
    /// Its folder's name.
    pub name: String,
    /// Its options.
    pub options: Value,
    /// Its seed.
    pub seed: u64,
    /// Versions of what made it.
    pub versions: BTreeMap<String, String>,
    /// Its grid, if it was one.
    pub grid: Option<Grid>,
    /// For each of its videos, the index in the merged recording's list.
    pub videos: Vec<u32>,
    /// The number of its first episode in the merged recording.
    pub first: u32,
    /// How many episodes it has.
    pub episodes: u32,
}

/// What a merge did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MergeReport {
    /// Whether the parts were of one recording and kept their numbers.
    pub kept_numbers: bool,
    /// Episodes whose files are linked or copied.
    pub taken: usize,
    /// Episodes whose files were written again.
    pub rewritten: usize,
    /// Episodes that an earlier part had too and that are there once.
    pub repeated: usize,
}

/// The parts of a merged recording; none for one that was recorded.
pub fn merged_parts(manifest: &Manifest) -> Option<Vec<MergedPart>> {
    serde_json::from_value(manifest.options.get(MERGED)?.clone()).ok()
}

/// Joins recordings into a new one.
///
/// # Errors
/// [`Error::Selection`] for fewer than two or for different specs; damage in a file that has to be read; a folder that is taken.
pub fn merge(parts: &[Recording], out: &Path, transfer: FileTransfer) -> Result<(Recording, MergeReport)> {
    merge_until(parts, out, transfer, &NEVER)
}

/// The same, until `stop` is raised.
///
/// # Errors
/// As [`merge`]; [`Error::Stopped`].
pub fn merge_until(
    parts: &[Recording],
    out: &Path,
    transfer: FileTransfer,
    stop: &AtomicBool,
) -> Result<(Recording, MergeReport)> {
    check_specs(parts)?;
    let folder = NewFolder::begin(out, parts.iter().map(Recording::path))?;
    let report = match same_recording(parts, out) {
        Some(header) => join(parts, header, folder.path(), transfer, stop)?,
        None => renumber(parts, (out, folder.path()), transfer, stop)?,
    };
    folder.finish()?;
    Ok((Recording::open(out)?, report))
}

fn join(
    parts: &[Recording],
    mut header: Manifest,
    out: &Path,
    transfer: FileTransfer,
    stop: &AtomicBool,
) -> Result<MergeReport> {
    let numbers: BTreeSet<u32> =
        parts.iter().flat_map(|part| part.episodes().iter().map(|entry| entry.index)).collect();
    let whole = parts.iter().filter_map(whole_of).max();
    if let (false, Some(options)) = (whole == Some(numbers.len() as u64), header.options.as_object_mut()) {
        let names: Vec<String> = parts.iter().map(name_of).collect();
        options.insert(SUBSET.into(), serde_json::json!({ "verb": "merge", "of": names, (WHOLE): whole }));
    }
    let writer = RecordingWriter::create_or_resume(out, header, false)?;
    let mut report = MergeReport { kept_numbers: true, ..MergeReport::default() };
    for part in parts {
        for entry in part.episodes() {
            go_on(stop)?;
            if writer.has(entry.index) {
                report.repeated += 1;
            } else {
                writer.take(part, entry, transfer)?;
                report.taken += 1;
            }
        }
    }
    writer.finish()?;
    Ok(report)
}

/// `place` is where the merged recording will be, `folder` where it is made.
fn renumber(
    parts: &[Recording],
    (place, folder): (&Path, &Path),
    transfer: FileTransfer,
    stop: &AtomicBool,
) -> Result<MergeReport> {
    let (listed, videos) = merged_videos(parts);
    let repeats = repeats(parts, &videos, stop)?;
    let header = merged_header(parts, place, (listed, &videos), &repeats)?;
    let writer = RecordingWriter::create_or_resume(folder, header, false)?;
    let mut report = MergeReport { repeated: repeats.iter().map(BTreeSet::len).sum(), ..MergeReport::default() };
    let mut next = 0;
    for ((part, videos), repeats) in parts.iter().zip(&videos).zip(&repeats) {
        let same_videos = videos.iter().enumerate().all(|(before, &after)| before as u32 == after);
        for entry in part.episodes().iter().filter(|entry| !repeats.contains(&entry.index)) {
            go_on(stop)?;
            if same_videos && entry.cell.is_none() && entry.index == next && has_all_columns(part, next) {
                writer.take(part, entry, transfer)?;
                report.taken += 1;
            } else {
                writer.rewrite(&moved(part, entry, next, videos)?, entry)?;
                report.rewritten += 1;
            }
            next += 1;
        }
    }
    writer.finish()?;
    Ok(report)
}

/// Whether the table of an episode has every column that one has which is written now. Those of older recordings have not, and all tables of one are to have the same.
fn has_all_columns(part: &Recording, index: u32) -> bool {
    let all = episode_schema(&part.manifest().spec).fields().len();
    part.episode(index).is_ok_and(|view| view.table().num_columns() == all)
}

/// The videos of all parts, each once, and for every part where its own are in that list.
fn merged_videos(parts: &[Recording]) -> (Vec<Video>, Vec<Vec<u32>>) {
    let mut videos: Vec<Video> = Vec::new();
    let mut place = |video: &Video| {
        let known = videos.iter().position(|known| known == video);
        known.unwrap_or_else(|| {
            videos.push(video.clone());
            videos.len() - 1
        }) as u32
    };
    let maps = parts.iter().map(|part| part.manifest().videos.iter().map(&mut place).collect()).collect();
    (videos, maps)
}

/// The merged manifest without episodes.
fn merged_header(
    parts: &[Recording],
    out: &Path,
    (videos, maps): (Vec<Video>, &[Vec<u32>]),
    repeats: &[BTreeSet<u32>],
) -> Result<Manifest> {
    let mut notes: Vec<MergedPart> = Vec::new();
    let mut first = 0_u32;
    for ((part, map), repeats) in parts.iter().zip(maps).zip(repeats) {
        let count = u32::try_from(part.episodes().len() - repeats.len()).unwrap_or(u32::MAX);
        notes.extend(notes_of(part, out, map, (first, repeats)));
        first = first.checked_add(count).filter(|&all| all <= MOST_EPISODES).ok_or_else(|| Error::Selection {
            fact: "more than a million episodes".into(),
            expected: "numbers of six digits".into(),
        })?;
    }
    let header = parts[0].manifest();
    let same_versions = parts.iter().all(|part| part.manifest().versions == header.versions);
    let ours = || BTreeMap::from([("vibes".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    Ok(Manifest {
        options: serde_json::json!({ MERGED: notes }),
        versions: if same_versions { header.versions.clone() } else { ours() },
        grid: None,
        videos,
        episodes: Vec::new(),
        ..header.clone()
    })
}

/// A part's own note, or those of its parts if it was merged already; its episodes that are repeats are left out.
fn notes_of(part: &Recording, out: &Path, map: &[u32], (first, repeats): (u32, &BTreeSet<u32>)) -> Vec<MergedPart> {
    let manifest = part.manifest();
    let Manifest { mut options, seed, versions, grid, .. } = manifest.clone();
    rebase(&mut options, Some(part.path()), Some(out));
    let kept = || part.episodes().iter().map(|entry| entry.index).filter(|index| !repeats.contains(index));
    let count = kept().count() as u32;
    let own =
        MergedPart { name: name_of(part), options, seed, versions, grid, videos: map.to_vec(), first, episodes: count };
    let Some(inner) = merged_parts(manifest) else { return vec![own] };
    // A filtered merge has gaps: count the episodes that are still there.
    let mut next = first;
    let mut notes = Vec::new();
    for note in inner {
        let there = kept().filter(|&index| note.holds(index)).count() as u32;
        let videos = note.videos.iter().map(|&video| map.get(video as usize).copied().unwrap_or(u32::MAX)).collect();
        let mut options = note.options;
        rebase(&mut options, Some(part.path()), Some(out));
        notes.push(MergedPart { options, videos, first: next, episodes: there, ..note });
        next += there;
    }
    notes
}

impl MergedPart {
    /// Whether the merged recording's episode of this number is of this part.
    pub fn holds(&self, index: u32) -> bool {
        index.checked_sub(self.first).is_some_and(|place| place < self.episodes)
    }
}

fn name_of(part: &Recording) -> String {
    part.path().file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
