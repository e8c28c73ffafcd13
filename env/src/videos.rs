//! Background videos: where they come from, and quick access to any frame.
//!
//! In: a [`VideoSource`] (a folder of frame folders, or the built-in procedural one), a [`VideoSet`] and how many. Out: a [`VideoLibrary`]:
//! names and lengths for the distractors, and frames resized to the sky's texture for the renderer. Everything is
//! decoded when the library is opened, or was by an earlier run; never at a reset.

pub mod davis;
pub mod picture;
pub mod procedural;
mod resample;
mod store;

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::UNIX_EPOCH;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vibes_data::{BackgroundFrame, Video, find_place, is_same_place};

use crate::error::{Error, Result};
pub(crate) use resample::SUITE_SIDE;
use store::FrameStore;
pub(crate) use store::LEVELS;

/// Most videos of a set that may be asked for: the programs take no more, and a larger number in a file is a damaged or hostile one.
pub const MOST_VIDEOS: u16 = 10_000;

/// Videos of a library whose files are kept open: as many as DAVIS has for training. A process may have some thousand files open, often no more than 1024, so that of a
/// larger library every frame opens its own.
const MOST_OPEN: usize = 64;

/// Asked before every frame that is made, with the number of videos of a library that no earlier run has made: whether to go on.
pub type GoOn<'a> = &'a (dyn Fn(usize) -> bool + Sync);

/// Which videos: those for training, or those held out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VideoSet {
    /// For training.
    #[default]
    Train,
    /// Held out, for evaluation.
    Val,
}

impl VideoSet {
    /// The set's name as typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Val => "val",
        }
    }
}

impl fmt::Display for VideoSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for VideoSet {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "train" => Ok(Self::Train),
            "val" => Ok(Self::Val),
            _ => Err(Error::UnknownName { what: "video set", name: text.to_owned(), known: "train, val".to_owned() }),
        }
    }
}

/// Where videos come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VideoSource {
    /// Made by [`procedural`].
    #[default]
    Procedural,
    /// `DIR/<video>/<frame>.jpg`.
    Folder(PathBuf),
}

impl VideoSource {
    /// `procedural`, or the name of the folder without its place.
    pub fn name(&self) -> String {
        match self {
            Self::Procedural => "procedural".to_owned(),
            Self::Folder(folder) => {
                folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
            }
        }
    }

    /// Whether this is a folder of DAVIS 2017 with the first `count` videos of both official lists, each with all its frames as far as [`davis::FIRST_FRAMES`] knows them.
    pub fn is_davis(&self, count: usize) -> bool {
        let Self::Folder(folder) = self else { return false };
        let is_official = |(name, wanted): (&String, &&str)| {
            let known = davis::FIRST_FRAMES.iter().find(|(video, _)| video == wanted);
            let found = || davis::frames(folder, name).map_or(0, |files| files.len());
            name == wanted && known.is_none_or(|(_, frames)| found() == *frames)
        };
        let is_whole = |set, official: &[&str]| {
            self.list(set, Some(count)).is_ok_and(|names| names.iter().zip(official).all(is_official))
        };
        is_whole(VideoSet::Train, &davis::TRAIN) && is_whole(VideoSet::Val, &davis::VAL)
    }

    /// Whether a film that somebody saw, out of `other`, is this source's film of the same name. A folder may have been copied, or be gone by now: a film of another place is the same
    /// where its frames are as many and, while both are there, as large.
    pub fn has_film(&self, film: &Video, other: &Self) -> bool {
        let (own, other) = match (self, other) {
            (Self::Procedural, Self::Procedural) => return true,
            (Self::Procedural, Self::Folder(_)) | (Self::Folder(_), Self::Procedural) => return false,
            (Self::Folder(own), Self::Folder(other)) => (own, other),
        };
        is_same_place(own, other)
            || match (frame_sizes(own, &film.name), frame_sizes(other, &film.name)) {
                (Some(own), Some(other)) => own == other,
                (Some(own), None) => own.len() == film.frames as usize,
                (None, _) => false,
            }
    }

    /// The names of the first `count` videos of a set, all of them (for the procedural source as many as DAVIS has) without a count. The two sets never share a
    /// video, whatever the counts: a folder of one's own, which knows no sets, is trained under by its first half and held out by its second.
    ///
    /// # Errors
    /// When a folder cannot be read, or holds no video of the set or fewer than `count`; for more than [`MOST_VIDEOS`], whose names alone might fill the memory.
    pub fn list(&self, set: VideoSet, count: Option<usize>) -> Result<Vec<String>> {
        if let Some(wanted) = count.filter(|&wanted| wanted > usize::from(MOST_VIDEOS)) {
            return Err(Error::TooManyVideos { wanted, most: MOST_VIDEOS });
        }
        let folder = match self {
            Self::Procedural => return Ok(procedural::list(set, count)),
            Self::Folder(folder) => folder,
        };
        let davis::Listed { mut names, what } = davis::list(folder, set)?;
        let wanted = count.unwrap_or(names.len()).max(1);
        if names.len() < wanted {
            return Err(Error::TooFewVideos { found: names.len(), what, wanted, path: folder.clone() });
        }
        names.truncate(wanted);
        Ok(names)
    }

    /// The names of the first `count` videos of both sets, those to train under and those held out; all of them without a count.
    ///
    /// # Errors
    /// As [`VideoSource::list`], of either set.
    pub fn lists(&self, count: Option<usize>) -> Result<[Vec<String>; 2]> {
        Ok([self.list(VideoSet::Train, count)?, self.list(VideoSet::Val, count)?])
    }

    /// The same as a file of `folder` has it: a folder of videos is named from there, and is where it is found.
    #[must_use]
    pub fn found(&self, folder: &Path) -> Self {
        match self {
            Self::Folder(place) => {
                let found = find_place(&place.to_string_lossy(), folder, Path::is_dir);
                Self::Folder(found.unwrap_or_else(|| folder.join(place)))
            }
            Self::Procedural => Self::Procedural,
        }
    }

    /// Finds a video, whether it was made by an earlier run or not.
    fn film<'a>(&self, cache: &Path, name: &'a str, side: usize) -> Result<Film<'a>> {
        let (identity, frames, files) = match self {
            Self::Procedural => {
                procedural::ProceduralVideo::named(name)?;
                (format!("procedural {} {name}", procedural::VERSION), procedural::FRAMES, Vec::new())
            }
            Self::Folder(folder) => {
                let files = davis::frames(folder, name)?;
                (identity(&files)?, files.len(), files)
            }
        };
        let store = FrameStore::of(cache, name, &identity, frames, side);
        let is_made = store.is_whole();
        Ok(Film { name, store, is_made, files: if is_made { Vec::new() } else { files } })
    }

    /// Makes the frames of a video, while `go_on` says yes.
    fn make(&self, film: &Film<'_>, side: usize, go_on: impl Fn() -> bool) -> Result<()> {
        let go_on = || go_on().then_some(()).ok_or(Error::Stopped);
        match self {
            Self::Procedural => {
                let video = procedural::ProceduralVideo::named(film.name)?;
                film.store.make(|frame| {
                    go_on()?;
                    Ok(resample::resample(&video.frame(frame), procedural::SIDE, procedural::SIDE, side))
                })
            }
            Self::Folder(_) => film.store.make(|frame| {
                go_on()?;
                let (rgb, width, height) = davis::decode(&film.files[frame])?;
                Ok(resample::resample(&rgb, width, height, side))
            }),
        }
    }
}

/// A video of a library, while that is opened.
struct Film<'a> {
    name: &'a str,
    store: FrameStore,
    is_made: bool,
    /// The frames of a folder's video that is yet to be made.
    files: Vec<PathBuf>,
}

/// Bytes of the frame files of a video, in their order; none where there is no such video.
fn frame_sizes(folder: &Path, video: &str) -> Option<Vec<u64>> {
    let files = davis::frames(folder, video).ok()?;
    files.iter().map(|file| Some(file.metadata().ok()?.len())).collect()
}

/// Names, sizes and dates of the frame files: changes whenever a picture may have.
fn identity(files: &[PathBuf]) -> Result<String> {
    let mut identity = String::new();
    for file in files {
        let metadata = file.metadata().map_err(Error::io("read the frame", file))?;
        let path = std::path::absolute(file).map_err(Error::io("read the frame", file))?;
        let changed = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let changed = changed.map_or(0, |time| time.as_nanos());
        identity += &format!("{} {} {changed}\n", path.display(), metadata.len());
    }
    Ok(identity)
}

/// A set of videos, decoded. Shared by all renderers.
#[derive(Debug)]
pub struct VideoLibrary {
    videos: Vec<Video>,
    stores: Vec<FrameStore>,
    side: usize,
}

impl VideoLibrary {
    /// Opens the videos `names` of a source, decoding what no earlier run has. `side` is the side of the frames, as
    /// [`Look::sky_side`](crate::render::Look::sky_side) says for a picture's size.
    ///
    /// # Errors
    /// When a video is missing or cannot be decoded, or the cache cannot be written.
    pub fn open(source: &VideoSource, set: VideoSet, names: &[String], side: usize) -> Result<Self> {
        Self::open_while(source, set, names, side, &|_missing| true)
    }

    /// The same, which may take minutes where nothing was made before, as long as `go_on` says yes.
    ///
    /// # Errors
    /// As [`Self::open`]; [`Error::Stopped`] where `go_on` says no. What is made by then is kept.
    pub fn open_while(
        source: &VideoSource,
        set: VideoSet,
        names: &[String],
        side: usize,
        go_on: GoOn<'_>,
    ) -> Result<Self> {
        let cache = store::cache_folder()?;
        let films: Vec<Film<'_>> =
            names.par_iter().map(|name| source.film(&cache, name, side)).collect::<Result<_>>()?;
        let missing = films.iter().filter(|film| !film.is_made).count();
        let to_make = films.par_iter().filter(|film| !film.is_made);
        to_make.try_for_each(|film| source.make(film, side, || go_on(missing)))?;
        let mut stores: Vec<FrameStore> = films.into_iter().map(|film| film.store).collect();
        if stores.len() <= MOST_OPEN {
            stores.iter_mut().try_for_each(FrameStore::keep_open)?;
        }
        let videos = names
            .iter()
            .zip(&stores)
            .map(|(name, store)| Video { name: name.clone(), set: set.name().to_owned(), frames: store.frames as u32 })
            .collect();
        Ok(Self { videos, stores, side })
    }

    /// No videos: the model's own sky.
    pub fn none() -> Self {
        Self { videos: Vec::new(), stores: Vec::new(), side: SUITE_SIDE >> (LEVELS - 1) }
    }

    /// The videos, as the manifest lists them.
    pub fn videos(&self) -> &[Video] {
        &self.videos
    }

    /// How many frames each has, for the distractors.
    pub fn frame_counts(&self) -> Vec<usize> {
        self.stores.iter().map(|store| store.frames).collect()
    }

    /// Side of the frames, pixels.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Reads a frame with its mipmap levels into `bytes`: `[side, side, 3]`, then half and quarter size.
    ///
    /// # Errors
    /// When there is no such frame, or the cache cannot be read.
    pub(crate) fn read(&self, frame: BackgroundFrame, bytes: &mut Vec<u8>) -> Result<()> {
        let store = self.stores.get(frame.video as usize).filter(|store| (frame.frame as usize) < store.frames);
        let store = store.ok_or_else(|| Error::Render {
            fact: format!("no frame {} of video {}", frame.frame, frame.video),
            expected: format!("there are {} videos", self.stores.len()),
        })?;
        store.read(frame.frame as usize, bytes)
    }
}

#[cfg(test)]
mod tests;
