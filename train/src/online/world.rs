//! The world of an online run: its environment and videos, made from [`WorldOptions`], and the header of the recording of what is lived through in it.

use std::path::Path;
use std::sync::Arc;

use vibes_data::{Manifest, Spec, Video, followed_place};
use vibes_env::distractors::Axes;
use vibes_env::render::RenderSettings;
use vibes_env::videos::{GoOn, VideoLibrary, VideoSet, VideoSource};
use vibes_env::{Environment, EnvironmentOptions, Eyes, Heading};

use super::options::{OnlineOptions, WorldOptions};
use crate::error::Result;

/// The background videos to train under and those that are held out, opened.
pub type Libraries = [Arc<VideoLibrary>; 2];

impl WorldOptions {
    /// The environment.
    ///
    /// # Errors
    /// There is no such task.
    pub fn environment(&self) -> Result<Environment> {
        let options = EnvironmentOptions { action_repeat: Some(self.action_repeat), raw_torques: false };
        Ok(Environment::new(&self.task, options)?)
    }

    /// Leaves out pictures, and with them distractors, which nobody would see.
    pub fn draw_nothing(&mut self) {
        self.size = None;
        self.distractors.axes = Axes::NONE;
    }

    /// Size and look of the pictures; none for vector observations.
    pub fn pictures(&self) -> Option<RenderSettings> {
        self.size.map(|size| RenderSettings { size: size as usize, look: self.look })
    }

    /// Whether background videos play in it.
    pub fn has_videos(&self) -> bool {
        self.pictures().is_some() && self.distractors.axes.background
    }

    /// How many videos a set has; all there are where neither the options nor the difficulty say.
    fn videos_of_a_set(&self) -> Option<usize> {
        self.video_count.or(self.distractors.difficulty.videos())
    }

    /// The background videos of a set; none where none are seen.
    ///
    /// # Errors
    /// A folder holds too few videos, or one cannot be decoded.
    pub fn video_library(&self, set: VideoSet) -> Result<Arc<VideoLibrary>> {
        self.video_library_while(set, &|_missing| true)
    }

    /// The background videos of both sets.
    ///
    /// # Errors
    /// As [`Self::video_library`].
    pub fn libraries(&self) -> Result<Libraries> {
        Ok([self.video_library(VideoSet::Train)?, self.video_library(VideoSet::Val)?])
    }

    /// The background videos of a set, made where no earlier run has, which may take minutes, as long as `go_on` says yes; it is told how many are missing.
    ///
    /// # Errors
    /// As [`Self::video_library`]; [`vibes_env::Error::Stopped`] where `go_on` says no. What is made by then is kept.
    pub fn video_library_while(&self, set: VideoSet, go_on: GoOn<'_>) -> Result<Arc<VideoLibrary>> {
        let Some(pictures) = self.pictures().filter(|_| self.distractors.axes.background) else {
            return Ok(Arc::new(VideoLibrary::none()));
        };
        let names = self.videos.list(set, self.videos_of_a_set())?;
        let side = pictures.look.sky_side(pictures.size);
        Ok(Arc::new(VideoLibrary::open_while(&self.videos, set, &names, side, go_on)?))
    }

    /// The names of the videos of a folder that are held out; none where nobody sees any, or the built-in ones are seen.
    pub fn held_out_videos(&self) -> Option<Vec<String>> {
        let is_of_a_folder = self.has_videos() && matches!(self.videos, VideoSource::Folder(_));
        is_of_a_folder.then(|| self.videos.list(VideoSet::Val, self.videos_of_a_set()).ok()).flatten()
    }

    /// The names of the held-out videos, of whatever source; none where nobody sees any, or they are not there.
    pub fn names_held_out(&self) -> Vec<String> {
        let names = self.has_videos().then(|| self.videos.list(VideoSet::Val, self.videos_of_a_set()).ok());
        names.flatten().unwrap_or_default()
    }

    /// That a folder of videos is there and holds both sets, before anything is begun.
    ///
    /// # Errors
    /// It does not, or holds too few.
    pub fn check_videos(&self) -> Result<()> {
        if self.has_videos() {
            self.videos.lists(self.videos_of_a_set())?;
        }
        Ok(())
    }

    /// Eyes on the world, under videos of one set.
    ///
    /// # Errors
    /// This machine cannot draw, or there are no such videos.
    pub fn eyes(&self, videos: Arc<VideoLibrary>) -> Result<Eyes> {
        Ok(Eyes::new(self.environment()?, self.distractors, self.pictures(), videos)?)
    }

    /// The shape of its episodes.
    ///
    /// # Errors
    /// There is no such task.
    pub fn spec(&self) -> Result<Spec> {
        Ok(self.environment()?.spec(self.size))
    }

    /// The same for a file of this folder: a folder of videos is named from there, so that both can be moved together.
    #[must_use]
    pub fn stored(&self, folder: &Path) -> Self {
        let videos = match &self.videos {
            VideoSource::Folder(path) => VideoSource::Folder(followed_place(path, folder).into()),
            source => source.clone(),
        };
        Self { videos, ..self.clone() }
    }

    /// The same as a file of this folder has it, with its folder of videos where it is.
    #[must_use]
    pub fn found(&self, folder: &Path) -> Self {
        Self { videos: self.videos.found(folder), ..self.clone() }
    }

    /// The header of the recording in `folder`, with options that the collector reads like those of its own recordings.
    ///
    /// # Errors
    /// There is no such task.
    pub fn manifest(&self, seed: u64, videos: &[Video], folder: &Path) -> Result<Manifest> {
        let mut options = serde_json::to_value(self.stored(folder)).unwrap_or_default();
        if let Some(options) = options.as_object_mut() {
            let more = serde_json::json!({
                "policy": "random", "grid": null, "episodes": 0, "raw_torques": false, "video_set": VideoSet::Train,
            });
            options.extend(more.as_object().cloned().unwrap_or_default());
        }
        Ok(Heading { spec: self.spec()?, options, seed, grid: None, videos: videos.to_vec() }.manifest())
    }
}

impl OnlineOptions {
    /// The header of the replay in `folder`, which names the protocol; but for a replay that was begun before it did, and goes on as it is.
    ///
    /// # Errors
    /// There is no such task.
    pub fn replay_manifest(&self, seed: u64, videos: &[Video], folder: &Path) -> Result<Manifest> {
        let mut manifest = self.world.manifest(seed, videos, folder)?;
        let found = Manifest::read(&folder.join("manifest.json")).ok();
        let is_older = found.is_some_and(|found| found.options.get("protocol").is_none());
        if let (Some(protocol), false, Some(options)) = (self.protocol, is_older, manifest.options.as_object_mut()) {
            options.insert("protocol".to_owned(), protocol.to_string().into());
        }
        Ok(manifest)
    }
}
