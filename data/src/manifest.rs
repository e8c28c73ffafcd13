//! The manifest: what was asked for, with which versions, and the list of episodes with their checksums.
//!
//! It holds no dates and no absolute paths, so that the same command gives the same bytes.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use crate::{Error, Result, Spec, write_atomically};

/// The name and version of the format, first thing in every manifest.
pub const FORMAT: &str = "vibes-recording/1";

/// `manifest.json` of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// What every episode shares.
    pub spec: Spec,
    /// The resolved options of the program that wrote the recording.
    pub options: serde_json::Value,
    /// The seed from which every other one is derived.
    pub seed: u64,
    /// Versions of the toolkit and its libraries.
    pub versions: BTreeMap<String, String>,
    /// The grid's size, when the recording is one.
    pub grid: Option<Grid>,
    /// The background videos that `video` indexes.
    pub videos: Vec<Video>,
    /// Every finished episode, by number.
    pub episodes: Vec<EpisodeEntry>,
}

/// A grid of state trajectories (rows) under distractor trajectories (columns).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grid {
    /// Number of state trajectories.
    pub states: u32,
    /// Number of distractor trajectories.
    pub distractors: u32,
}

/// A place in the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Cell {
    /// Row: which state trajectory.
    pub state: u32,
    /// Column: which distractor trajectory.
    pub distractor: u32,
}

/// A background video.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Video {
    /// Its name: a folder's, or that of a procedural video.
    pub name: String,
    /// `train` or `val`.
    pub set: String,
    /// Number of frames.
    pub frames: u32,
}

/// One finished episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeEntry {
    /// The episode's number, its key in every table.
    pub index: u32,
    /// Its place in the grid, if there is one.
    pub cell: Option<Cell>,
    /// Number of actions T; the table has T + 1 rows.
    pub steps: u32,
    /// Sum of the rewards.
    #[serde(rename = "return")]
    pub episode_return: f64,
    /// The behaviour policy, as in `planner:noise=0.3`.
    pub policy: String,
    /// The seed of the state trajectory.
    pub seed: u64,
    /// What the episode changed in the model (target position and size, damping, …), by object name.
    pub model_overrides: serde_json::Value,
    /// The Arrow file.
    pub arrow: FileEntry,
    /// The MCAP file, if one was written.
    pub mcap: Option<FileEntry>,
}

impl EpisodeEntry {
    /// Whether its files lie in the recording's folder, as large as it says. What is in them is for [`verify_episode`](crate::verify_episode) to read.
    pub fn has_its_files(&self, recording: &Path) -> bool {
        let lies_there = |file: &FileEntry| {
            std::fs::metadata(recording.join(&file.path))
                .is_ok_and(|found| found.is_file() && found.len() == file.bytes)
        };
        [Some(&self.arrow), self.mcap.as_ref()].into_iter().flatten().all(lies_there)
    }
}

/// A file of the recording, by its path inside the folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Path inside the recording, with forward slashes.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 in hexadecimal.
    pub sha256: String,
}

impl FileEntry {
    /// The entry of a file with these contents.
    pub fn of(path: String, contents: &[u8]) -> Self {
        Self { path, bytes: contents.len() as u64, sha256: crate::sha256_hex(contents) }
    }
}

impl Manifest {
    /// Whether another program recorded it, and `vibes-collect import` read it.
    pub fn is_imported(&self) -> bool {
        self.options.get("imported").is_some()
    }

    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// [`Error::NoRecording`] without a file, [`Error::Malformed`] for JSON of another shape, another format, sizes that
    /// cannot be, or paths that leave the folder.
    pub fn read(path: &Path) -> Result<Self> {
        let text = match std::fs::read(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let folder = path.parent().unwrap_or(path);
                return Err(Error::NoRecording { path: folder.into() });
            }
            Err(error) => return Err(Error::io("read", path)(error)),
        };
        let manifest: Self = serde_json::from_slice(&text)
            .map_err(|error| Error::malformed(path, format!("the manifest cannot be read ({error})"), "valid JSON"))?;
        manifest.check(path)?;
        Ok(manifest)
    }

    /// Writes the manifest whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_vec_pretty(self)
            .map_err(|error| Error::malformed(path, error.to_string(), "a manifest that JSON can hold"))?;
        write_atomically(path, &text)
    }

    /// Checks what JSON cannot say: sizes, order, paths, the grid.
    pub(crate) fn check(&self, path: &Path) -> Result<()> {
        if self.format != FORMAT {
            return Err(Error::malformed(path, format!("format {}", self.format), format!("{FORMAT} is known")));
        }
        if let Some(fault) = self.spec.fault() {
            let expected = "sizes and an action repeat within limits, a timestep above 0, finite and rising action bounds, and quantities of numbers that are there";
            return Err(Error::malformed(path, fault, expected));
        }
        for pair in self.episodes.windows(2) {
            if pair[0].index >= pair[1].index {
                let fact = format!("episode {} is followed by {}", pair[0].index, pair[1].index);
                return Err(Error::malformed(path, fact, "episodes in rising order"));
            }
        }
        self.check_grid(path)?;
        let files = self.episodes.iter().flat_map(|entry| [Some(&entry.arrow), entry.mcap.as_ref()]);
        match files.flatten().find(|file| !stays_inside(&file.path)) {
            Some(file) => {
                Err(Error::malformed(path, format!("a file named {:?}", file.path), "a path inside the recording"))
            }
            None => Ok(()),
        }
    }
}

/// No grid and no video has more rows, columns or frames than this; a larger one is a damaged or hostile manifest.
const LARGEST_COUNT: u32 = 1 << 24;

impl Manifest {
    /// Every cell lies in the grid, and no cell is there twice.
    fn check_grid(&self, path: &Path) -> Result<()> {
        let sizes = self.grid.iter().flat_map(|grid| [grid.states, grid.distractors]);
        let frames = self.videos.iter().map(|video| video.frames);
        if let Some(count) = sizes.chain(frames).find(|&count| count > LARGEST_COUNT) {
            return Err(Error::malformed(path, format!("a grid or a video of {count}"), "a smaller size"));
        }
        let mut seen = std::collections::BTreeSet::new();
        for entry in &self.episodes {
            let Some(cell) = entry.cell else { continue };
            let place = format!("episode {} in cell {},{}", entry.index, cell.state, cell.distractor);
            match self.grid {
                None => {}
                Some(grid) if cell.state >= grid.states || cell.distractor >= grid.distractors => {
                    let expected = format!("a cell of the grid of {} x {}", grid.states, grid.distractors);
                    return Err(Error::malformed(path, place, expected));
                }
                Some(_) if !seen.insert(cell) => {
                    return Err(Error::malformed(path, format!("another {place}"), "one episode a cell"));
                }
                Some(_) => {}
            }
        }
        Ok(())
    }
}

/// Whether a path names a place below the folder it is joined to.
fn stays_inside(path: &str) -> bool {
    !path.is_empty() && Path::new(path).components().all(|part| matches!(part, Component::Normal(_)))
}
