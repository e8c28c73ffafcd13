//! Recordings in the formats of others. In: a recording. Out: a folder in one of the [`ExportFormat`]s; what each loses stands in the package's
//! `CARE.md`, in one table.

mod columns;
mod lerobot;
mod minari;
mod mp4;
mod parquet;
mod pictures;
mod statistics;
mod video;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::Serialize;
use vibes_data::{EpisodeEntry, Recording};

use super::{NEVER, NewFolder, go_on};
use crate::error::{Error, Result};

/// A format that others read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ExportFormat {
    /// A Minari 0.5 dataset in its Arrow storage.
    Minari,
    /// A LeRobot v3 dataset: Parquet tables, and pictures as MP4 videos or in the tables.
    Lerobot,
    /// The recording's own columns in Parquet, one file an episode.
    Parquet,
}

/// How pictures are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Pictures {
    /// As they are, three bytes a pixel.
    Raw,
    /// Each as a PNG: nothing lost.
    Png,
    /// As an H.264 video in MP4: colours at half the resolution.
    Video,
}

/// What an export wrote.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ExportReport {
    /// Episodes.
    pub episodes: usize,
    /// Rows of all of them.
    pub rows: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// Episodes of no step, which the format cannot hold.
    pub left_out: usize,
}

impl ExportFormat {
    /// The ways of storing pictures that the format knows, its usual one first.
    pub fn pictures(self) -> &'static [Pictures] {
        match self {
            Self::Minari => &[Pictures::Raw],
            Self::Lerobot => &[Pictures::Video, Pictures::Png],
            Self::Parquet => &[Pictures::Png, Pictures::Raw],
        }
    }
}

/// Writes a recording in another format into a new folder.
///
/// # Errors
/// When the folder is taken, an episode is damaged, the format cannot hold the recording, or the disk is full.
pub fn export(
    recording: &Recording,
    format: ExportFormat,
    pictures: Option<Pictures>,
    out: &Path,
) -> Result<ExportReport> {
    export_until(recording, format, pictures, out, &NEVER)
}

/// The same, until `stop` is raised.
///
/// # Errors
/// As [`export`]; [`Error::Stopped`].
pub fn export_until(
    recording: &Recording,
    format: ExportFormat,
    pictures: Option<Pictures>,
    out: &Path,
    stop: &AtomicBool,
) -> Result<ExportReport> {
    let known = format.pictures();
    let pictures = pictures.unwrap_or(known[0]);
    if !known.contains(&pictures) {
        let fact = format!("{} does not store pictures as {}", name(format), name(pictures));
        let known = known.iter().map(|&way| name(way)).collect::<Vec<_>>().join(", ");
        return Err(Error::Selection { fact, expected: format!("it knows {known}") });
    }
    let folder = NewFolder::begin(out, [recording.path()])?;
    let (episodes, rows) = match format {
        ExportFormat::Minari => minari::write(recording, out, folder.path(), stop)?,
        ExportFormat::Lerobot => lerobot::write(recording, pictures, folder.path(), stop)?,
        ExportFormat::Parquet => parquet::write(recording, pictures, folder.path(), stop)?,
    };
    let bytes = size_of(folder.path())?;
    folder.finish()?;
    Ok(ExportReport { episodes, rows, bytes, left_out: recording.episodes().len() - episodes })
}

/// The episodes that have a step: readers of Minari and LeRobot fail on an episode without one.
///
/// # Errors
/// When there is none.
fn with_steps(recording: &Recording) -> Result<Vec<&EpisodeEntry>> {
    let episodes: Vec<&EpisodeEntry> = recording.episodes().iter().filter(|entry| entry.steps > 0).collect();
    if episodes.is_empty() {
        let expected = "a recording with steps".to_owned();
        return Err(Error::Selection { fact: "no episode has an action".to_owned(), expected });
    }
    Ok(episodes)
}

/// An enum's name as it is typed.
fn name<T: Serialize>(value: T) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

fn size_of(folder: &Path) -> Result<u64> {
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
        let path = entry.map_err(Error::io("list", folder))?.path();
        let metadata = path.metadata().map_err(Error::io("read", &path))?;
        bytes += if metadata.is_dir() { size_of(&path)? } else { metadata.len() };
    }
    Ok(bytes)
}

/// Writes JSON to a file of the folder, making the folders above it.
fn write_json(path: &Path, value: &serde_json::Value) -> Result<()> {
    make_parent(path)?;
    let text = serde_json::to_vec_pretty(value).unwrap_or_default();
    std::fs::write(path, text).map_err(Error::io("write", path))
}

fn make_parent(path: &Path) -> Result<()> {
    let parent = path.parent().unwrap_or(path);
    std::fs::create_dir_all(parent).map_err(Error::io("create", parent))
}
