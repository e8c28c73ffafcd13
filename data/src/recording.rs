//! An open recording: its manifest, and its episodes memory-mapped on demand.
//!
//! A recording that was killed half-way opens too: finished episodes that the manifest does not list yet are found by their
//! files, which carry their own entries. A file that is no episode of the recording is left alone, for `verify` to name.

mod unlisted;

use std::path::{Path, PathBuf};

use crate::{EpisodeEntry, EpisodeView, Error, Finding, Manifest, Result};
pub(crate) use unlisted::numbered;

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
    /// Opens a recording, named by its folder or by the manifest in it.
    ///
    /// # Errors
    /// [`Error::NoRecording`], or [`Error::Malformed`] for a damaged manifest.
    pub fn open(path: &Path) -> Result<Self> {
        let path = Self::folder_of(path);
        let mut manifest = Manifest::read(&path.join(MANIFEST))?;
        let strays = unlisted::adopt(path, &mut manifest)?;
        Ok(Self { path: path.into(), manifest, strays })
    }

    /// The folder of the recording that is named: the path itself, or where it lies if it is a recording's manifest, which tab completion ends at.
    pub fn folder_of(path: &Path) -> &Path {
        let is_manifest = path.file_name().is_some_and(|name| name == MANIFEST) && path.is_file();
        match path.parent().filter(|_| is_manifest) {
            Some(folder) if folder.as_os_str().is_empty() => Path::new("."),
            Some(folder) => folder,
            None => path,
        }
    }

    /// Files among the episodes that the manifest does not list and that are no episodes of this recording.
    pub fn strays(&self) -> &[Finding] {
        &self.strays
    }

    /// The logs among the episodes that the manifest does not list. The log of an episode that is not there is what a killed program leaves, and counts only if nothing is missing
    /// (`is_whole`).
    pub fn unlisted_logs(&self, is_whole: bool) -> Vec<Finding> {
        unlisted::logs(&self.path, &self.manifest, is_whole)
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
