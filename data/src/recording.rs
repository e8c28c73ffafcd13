//! An open recording: its manifest, and its episodes memory-mapped on demand.
//!
//! A recording that was killed half-way opens too: finished episodes that the manifest does not list yet are found by their
//! files, which carry their own entries. A file that is no episode of the recording is left alone, for `verify` to name.

use std::path::{Path, PathBuf};

use crate::arrow_table::read_episode_entry;
use crate::{EpisodeEntry, EpisodeView, Error, FileEntry, Finding, Manifest, Result};

/// The folder of episode files inside a recording.
pub(crate) const EPISODES: &str = "episodes";

/// The manifest's file name.
pub(crate) const MANIFEST: &str = "manifest.json";

/// A recording on disk.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    manifest: Manifest,
    strays: Vec<Finding>,
}

impl Recording {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`Error::NoRecording`], or [`Error::Malformed`] for a damaged manifest.
    pub fn open(path: &Path) -> Result<Self> {
        let mut manifest = Manifest::read(&path.join(MANIFEST))?;
        let strays = adopt_unlisted(path, &mut manifest)?;
        Ok(Self { path: path.into(), manifest, strays })
    }

    /// Files among the episodes that the manifest does not list and that are no episodes of this recording.
    pub fn strays(&self) -> &[Finding] {
        &self.strays
    }

    /// Where the recording lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What was asked for, and the list of episodes.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Every finished episode, by number.
    pub fn episodes(&self) -> &[EpisodeEntry] {
        &self.manifest.episodes
    }

    /// Bytes of all its episodes' files, as the manifest has them.
    pub fn bytes(&self) -> u64 {
        let of =
            |entry: &EpisodeEntry| entry.arrow.bytes.saturating_add(entry.mcap.as_ref().map_or(0, |file| file.bytes));
        self.episodes().iter().map(of).fold(0, u64::saturating_add)
    }

    /// Maps one episode, by its number.
    ///
    /// # Errors
    /// [`Error::NoEpisode`], or [`Error::Malformed`] for a damaged file.
    pub fn episode(&self, index: u32) -> Result<EpisodeView> {
        let position = self.episodes().binary_search_by_key(&index, |entry| entry.index);
        let no_episode = |_| Error::NoEpisode { index, count: self.episodes().len(), path: self.path.clone() };
        let entry = &self.episodes()[position.map_err(no_episode)?];
        let path = self.path.join(&entry.arrow.path);
        let view = EpisodeView::open(&path, &self.manifest.spec)?;
        if view.index() != index || view.steps() != entry.steps as usize || view.cell() != entry.cell {
            let fact = format!("episode {} of {} steps in cell {:?}", view.index(), view.steps(), view.cell());
            let expected =
                format!("episode {index} of {} steps in cell {:?}, as the manifest says", entry.steps, entry.cell);
            return Err(Error::malformed(path, fact, expected));
        }
        Ok(view)
    }
}

/// The path of an episode's file inside the recording.
pub(crate) fn episode_path(index: u32, ending: &str) -> String {
    format!("{EPISODES}/{index:06}.{ending}")
}

/// Adds finished episodes that the manifest does not list; returns the files that are none.
fn adopt_unlisted(path: &Path, manifest: &mut Manifest) -> Result<Vec<Finding>> {
    let mut strays = Vec::new();
    for index in finished_files(&path.join(EPISODES))? {
        let Err(place) = manifest.episodes.binary_search_by_key(&index, |entry| entry.index) else { continue };
        let fault = match adopt(path, index) {
            Ok(entry) => {
                manifest.episodes.insert(place, entry);
                let checked = manifest.check(&path.join(MANIFEST));
                if checked.is_err() {
                    manifest.episodes.remove(place);
                }
                checked.err()
            }
            Err(error) => Some(error),
        };
        let file = path.join(episode_path(index, "arrow"));
        strays.extend(fault.map(|error| Finding { path: file, fault: format!("not in the manifest: {error}") }));
    }
    Ok(strays)
}

fn adopt(path: &Path, index: u32) -> Result<EpisodeEntry> {
    let file = |ending: &str| -> Result<FileEntry> {
        let name = episode_path(index, ending);
        let contents = std::fs::read(path.join(&name)).map_err(Error::io("read", path.join(&name)))?;
        Ok(FileEntry::of(name, &contents))
    };
    let mut entry = read_episode_entry(&path.join(episode_path(index, "arrow")))?;
    let has_mcap = path.join(episode_path(index, "mcap")).is_file();
    entry.index = index;
    entry.arrow = file("arrow")?;
    entry.mcap = if has_mcap { Some(file("mcap")?) } else { None };
    Ok(entry)
}

/// The numbers of the Arrow files in place; partial files have another ending.
fn finished_files(folder: &Path) -> Result<Vec<u32>> {
    let Ok(listing) = std::fs::read_dir(folder) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for file in listing {
        let name = file.map_err(Error::io("list", folder))?.file_name();
        let number = name.to_str().and_then(|name| name.strip_suffix(".arrow")).filter(|stem| stem.len() == 6);
        found.extend(number.and_then(|stem| stem.parse::<u32>().ok()));
    }
    found.sort_unstable();
    Ok(found)
}
