//! Joining recordings of one spec.
//!
//! Parts of one recording (of a split, of a filter, of two machines that ran the same command) are put together again: numbers, cells and files stay
//! as they are, and the whole is what it was before it was divided. Recordings of different commands become plain episodes, numbered
//! anew in the order given; they lose their cells, since row 3 of one grid is not row 3 of another. Files that hold another number, cell or video
//! afterwards are written again, the others linked.

mod kinship;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use vibes_data::{
    BackgroundFrame, Cell, EpisodeEntry, Error as DataError, FileTransfer, Grid, MOST_EPISODES, Manifest, Recording,
    RecordingWriter, Video,
};

use self::kinship::{check_specs, same_recording, whole_of};
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
    /// Episodes that were in more than one part and are there once.
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
    let numbers: std::collections::BTreeSet<u32> =
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
    let (header, videos) = merged_header(parts, place)?;
    let writer = RecordingWriter::create_or_resume(folder, header, false)?;
    let mut report = MergeReport::default();
    let mut next = 0;
    for (part, videos) in parts.iter().zip(&videos) {
        let same_videos = videos.iter().enumerate().all(|(before, &after)| before as u32 == after);
        for entry in part.episodes() {
            go_on(stop)?;
            if same_videos && entry.cell.is_none() && entry.index == next {
                writer.take(part, entry, transfer)?;
                report.taken += 1;
            } else {
                rewrite(&writer, part, entry, next, videos)?;
                report.rewritten += 1;
            }
            next += 1;
        }
    }
    writer.finish()?;
    Ok(report)
}

/// Writes an episode again under another number, without its cell, its videos found in the merged list.
fn rewrite(writer: &RecordingWriter, part: &Recording, entry: &EpisodeEntry, index: u32, videos: &[u32]) -> Result<()> {
    let mut episode = part.episode(entry.index)?.to_episode();
    episode.index = index;
    episode.cell = None::<Cell>;
    for shown in episode.backgrounds.iter_mut().flatten() {
        let unknown = || {
            let path = part.path().join(&entry.arrow.path);
            let expected = format!("one of the manifest's {} videos", videos.len());
            DataError::Malformed { fact: format!("video {}", shown.video), expected, path }
        };
        let video = *videos.get(shown.video as usize).ok_or_else(unknown)?;
        *shown = BackgroundFrame { video, ..*shown };
    }
    Ok(writer.rewrite(&episode, entry)?)
}

/// The merged manifest without episodes, and for every part where its videos are in the merged list.
fn merged_header(parts: &[Recording], out: &Path) -> Result<(Manifest, Vec<Vec<u32>>)> {
    let mut videos: Vec<Video> = Vec::new();
    let mut notes: Vec<MergedPart> = Vec::new();
    let mut maps = Vec::new();
    let mut first = 0_u32;
    for part in parts {
        let manifest = part.manifest();
        let map: Vec<u32> = manifest.videos.iter().map(|video| place_of(&mut videos, video)).collect();
        let count = u32::try_from(part.episodes().len()).unwrap_or(u32::MAX);
        notes.extend(notes_of(part, out, &map, first));
        first = first.checked_add(count).filter(|&all| all <= MOST_EPISODES).ok_or_else(|| Error::Selection {
            fact: "more than a million episodes".into(),
            expected: "numbers of six digits".into(),
        })?;
        maps.push(map);
    }
    let header = parts[0].manifest();
    let same_versions = parts.iter().all(|part| part.manifest().versions == header.versions);
    let ours = || BTreeMap::from([("vibes".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    let manifest = Manifest {
        options: serde_json::json!({ MERGED: notes }),
        versions: if same_versions { header.versions.clone() } else { ours() },
        grid: None,
        videos,
        episodes: Vec::new(),
        ..header.clone()
    };
    Ok((manifest, maps))
}

/// A part's own note, or those of its parts if it was merged already.
fn notes_of(part: &Recording, out: &Path, map: &[u32], first: u32) -> Vec<MergedPart> {
    let manifest = part.manifest();
    let Manifest { mut options, seed, versions, grid, .. } = manifest.clone();
    rebase(&mut options, Some(part.path()), Some(out));
    let count = part.episodes().len() as u32;
    let own =
        MergedPart { name: name_of(part), options, seed, versions, grid, videos: map.to_vec(), first, episodes: count };
    let Some(inner) = merged_parts(manifest) else { return vec![own] };
    // A filtered merge has gaps: count the episodes that are still there.
    let mut next = first;
    let mut notes = Vec::new();
    for note in inner {
        let there = part.episodes().iter().filter(|entry| note.holds(entry.index)).count() as u32;
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

fn place_of(videos: &mut Vec<Video>, video: &Video) -> u32 {
    let place = videos.iter().position(|known| known == video).unwrap_or_else(|| {
        videos.push(video.clone());
        videos.len() - 1
    });
    place as u32
}

fn name_of(part: &Recording) -> String {
    part.path().file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
