//! Writing a recording, episode by episode, so that it can be killed at any moment: every episode is written beside its
//! place and renamed into it, the Arrow file last, and the same command goes on where it stopped.

mod files;
mod request;

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::arrow_table::arrow_bytes;
use crate::mcap_log::mcap_bytes;
use crate::recording::{EPISODES, MANIFEST, episode_path};
use crate::{
    Episode, EpisodeEntry, EpisodeView, Error, FileEntry, FolderLock, Manifest, Recording, Result, write_atomically,
};
use files::{check, check_empty, is_older, remove_if_there, remove_partial_files, transfer};
use request::same_request;

/// How often the manifest follows the episodes while a recording grows; at the end it is always complete.
const MANIFEST_EVERY: Duration = Duration::from_secs(2);

/// What an episode's entry says beside what its columns hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpisodeInfo {
    /// The behaviour policy.
    pub policy: String,
    /// The seed of the state trajectory.
    pub seed: u64,
    /// What the episode changed in the model, by object name.
    pub model_overrides: serde_json::Value,
}

/// How a file whose bytes need not change comes into another recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FileTransfer {
    /// One file under two names, where the file system can; else a copy. Finished episodes are never written again, so that neither
    /// recording can change the other; removing one leaves the other whole.
    #[default]
    Link,
    /// A copy, so that damage to one file leaves the other.
    Copy,
}

/// A recording that grows. Episodes may come from several threads and in any order.
#[derive(Debug)]
pub struct RecordingWriter {
    path: PathBuf,
    with_mcap: bool,
    /// It began before there was the column of the distractor that a policy saw.
    is_older: bool,
    growing: Mutex<Growing>,
    // Nobody else removes partial files or completes the manifest meanwhile.
    _lock: FolderLock,
}

#[derive(Debug)]
struct Growing {
    manifest: Manifest,
    flushed: Instant,
}

impl RecordingWriter {
    /// Begins a recording, or goes on with the one that is there if it was asked for with the same options. Episodes whose files are missing or of another size are not
    /// there any more: they are to be written again.
    ///
    /// # Errors
    /// [`Error::OtherRecording`] when a recording of other options is there, [`Error::OtherVideos`] when their videos are others by now, [`Error::Malformed`] when it is damaged
    /// or episodes lie there without a manifest, [`Error::Owned`] when another process writes into it.
    pub fn create_or_resume(path: &Path, manifest: Manifest, with_mcap: bool) -> Result<Self> {
        // Before anything is on disk: a manifest that could not be read again.
        manifest.check(&path.join(MANIFEST))?;
        let folder = path.join(EPISODES);
        let lock = FolderLock::acquire(path)?;
        let manifest = match Recording::open(path) {
            Ok(found) => {
                same_request(path, found.manifest(), &manifest)?;
                let whole = found.episodes().iter().filter(|entry| entry.has_its_files(path));
                Manifest { episodes: whole.cloned().collect(), ..manifest }
            }
            Err(Error::NoRecording { .. }) => {
                check_empty(path)?;
                manifest
            }
            Err(error) => return Err(error),
        };
        std::fs::create_dir_all(&folder).map_err(Error::io("create", &folder))?;
        remove_partial_files(&folder)?;
        manifest.write(&path.join(MANIFEST))?;
        let is_older = is_older(path, &manifest.episodes);
        let growing = Mutex::new(Growing { manifest, flushed: Instant::now() });
        Ok(Self { path: path.into(), with_mcap, is_older, growing, _lock: lock })
    }

    /// Whether the episode of this number is there already.
    pub fn has(&self, index: u32) -> bool {
        self.growing().manifest.episodes.binary_search_by_key(&index, |entry| entry.index).is_ok()
    }

    fn entry(&self, index: u32) -> Option<EpisodeEntry> {
        let growing = self.growing();
        let place = growing.manifest.episodes.binary_search_by_key(&index, |entry| entry.index).ok()?;
        Some(growing.manifest.episodes[place].clone())
    }

    /// How many episodes are there.
    pub fn len(&self) -> usize {
        self.growing().manifest.episodes.len()
    }

    /// Whether no episode is there yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes one episode; afterwards it is there whole, or, on an error, not at all.
    ///
    /// # Errors
    /// [`Error::Episode`] when its columns do not fit the spec, [`Error::Io`] when the disk is full.
    pub fn write(&self, episode: &Episode, info: EpisodeInfo) -> Result<()> {
        self.put_episode(Cow::Borrowed(episode), info, self.with_mcap)
    }

    /// The same of an episode that is not needed any more: its pictures, which are most of it, become the table's without a copy.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn write_owned(&self, episode: Episode, info: EpisodeInfo) -> Result<()> {
        self.put_episode(Cow::Owned(episode), info, self.with_mcap)
    }

    /// Writes an episode of another recording whose number, cell or videos have changed; it has a log if it had one.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn rewrite(&self, episode: &Episode, before: &EpisodeEntry) -> Result<()> {
        let EpisodeEntry { policy, seed, model_overrides, .. } = before.clone();
        self.put_episode(Cow::Borrowed(episode), EpisodeInfo { policy, seed, model_overrides }, before.mcap.is_some())
    }

    /// Takes over an episode of another recording as it is: its files' bytes, its number, its cell and its checksums, by which damage is still found where a file is linked and not read.
    ///
    /// # Errors
    /// [`Error::Malformed`] when a file has another size than its manifest says, or, copied, another checksum; [`Error::Io`].
    pub fn take(&self, from: &Recording, entry: &EpisodeEntry, way: FileTransfer) -> Result<()> {
        let mut entry = entry.clone();
        let index = entry.index;
        let folders = (from.path(), self.path.as_path());
        if let Some(log) = &mut entry.mcap {
            transfer(folders, log, episode_path(index, "mcap"), way)?;
        }
        transfer(folders, &mut entry.arrow, episode_path(index, "arrow"), way)?;
        self.enlist(entry)
    }

    /// Whether logs are asked for and the episode of this number, which is there, has none.
    pub fn lacks_log(&self, index: u32) -> bool {
        self.with_mcap && self.entry(index).is_some_and(|entry| entry.mcap.is_none())
    }

    /// Writes the log of an episode that is there without one, from its table: the log that it would have been written with.
    ///
    /// # Errors
    /// [`Error::NoEpisode`], [`Error::Malformed`] when the table is damaged, [`Error::Io`].
    pub fn add_log(&self, index: u32) -> Result<()> {
        let no_episode = || Error::NoEpisode { index, count: self.len(), path: self.path.clone() };
        let entry = self.entry(index).ok_or_else(no_episode)?;
        check(&self.path, &entry.arrow, "remove the file and repeat the command, which makes it again")?;
        let spec = self.growing().manifest.spec.clone();
        let episode = EpisodeView::open(&self.path.join(&entry.arrow.path), &spec)?.to_episode();
        episode.check(&spec)?;
        let itself = EpisodeEntry { arrow: FileEntry::default(), mcap: None, ..entry.clone() };
        let log = self.put(index, "mcap", &mcap_bytes(&episode, &spec, &itself)?)?;
        self.enlist(EpisodeEntry { mcap: Some(log), ..entry })
    }

    /// The log first, and gone from memory before there is a table.
    fn put_episode(&self, episode: Cow<'_, Episode>, info: EpisodeInfo, with_mcap: bool) -> Result<()> {
        let spec = self.growing().manifest.spec.clone();
        episode.check(&spec)?;
        let index = episode.index;
        let itself = EpisodeEntry {
            index,
            cell: episode.cell,
            steps: episode.steps() as u32,
            episode_return: episode.episode_return(),
            policy: info.policy,
            seed: info.seed,
            model_overrides: info.model_overrides,
            arrow: FileEntry::default(),
            mcap: None,
        };
        let mcap = if with_mcap {
            Some(self.put(index, "mcap", &mcap_bytes(&episode, &spec, &itself)?)?)
        } else {
            // One that lies there is another episode's, and beside a finished table it would be taken for this one's.
            remove_if_there(&self.path.join(episode_path(index, "mcap")))?;
            None
        };
        let arrow = self.put(index, "arrow", &arrow_bytes(episode, &spec, &itself, self.is_older)?)?;
        self.enlist(EpisodeEntry { arrow, mcap, ..itself })
    }

    /// Maps an episode that is there.
    ///
    /// # Errors
    /// [`Error::Io`] when it is not, [`Error::Malformed`] when it is damaged.
    pub fn episode(&self, index: u32) -> Result<EpisodeView> {
        let spec = self.growing().manifest.spec.clone();
        EpisodeView::open(&self.path.join(episode_path(index, "arrow")), &spec)
    }

    /// Removes every episode from number `first` on: those that a stopped program made after it last saved where it stood.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_from(&self, first: u32) -> Result<()> {
        let mut growing = self.growing();
        let kept = growing.manifest.episodes.partition_point(|entry| entry.index < first);
        let removed = growing.manifest.episodes.split_off(kept);
        growing.manifest.write(&self.path.join(MANIFEST))?;
        for file in removed.iter().flat_map(|entry| [Some(&entry.arrow), entry.mcap.as_ref()]).flatten() {
            remove_if_there(&self.path.join(&file.path))?;
        }
        Ok(())
    }

    /// Brings the manifest on disk up to the episodes that are there, while the recording goes on growing.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn complete(&self) -> Result<()> {
        self.growing().manifest.write(&self.path.join(MANIFEST))
    }

    /// Completes the manifest.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self) -> Result<Recording> {
        self.complete()?;
        Recording::open(&self.path)
    }

    fn put(&self, index: u32, ending: &str, contents: &[u8]) -> Result<FileEntry> {
        let name = episode_path(index, ending);
        write_atomically(&self.path.join(&name), contents)?;
        Ok(FileEntry::of(name, contents))
    }

    fn enlist(&self, entry: EpisodeEntry) -> Result<()> {
        let mut growing = self.growing();
        let episodes = &mut growing.manifest.episodes;
        match episodes.binary_search_by_key(&entry.index, |listed| listed.index) {
            Ok(place) => episodes[place] = entry,
            Err(place) => episodes.insert(place, entry),
        }
        if growing.flushed.elapsed() >= MANIFEST_EVERY {
            growing.manifest.write(&self.path.join(MANIFEST))?;
            growing.flushed = Instant::now();
        }
        Ok(())
    }

    /// A thread that panicked while listing an episode leaves the list whole: entries are inserted in one step.
    fn growing(&self) -> MutexGuard<'_, Growing> {
        self.growing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
