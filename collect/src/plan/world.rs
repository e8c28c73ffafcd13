//! What a plan asks of the world: its environment, its background videos, and the header of the recording that follows from both.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use vibes_data::{Manifest, Video};
use vibes_env::render::RenderSettings;
use vibes_env::videos::{GoOn, MOST_VIDEOS, VideoLibrary, VideoSource};
use vibes_env::{Environment, EnvironmentOptions, Heading};

use super::RecordOptions;
use crate::paths::rebase;
use crate::{Error, Result};

impl RecordOptions {
    /// The environment's own options.
    pub fn environment_options(&self) -> EnvironmentOptions {
        EnvironmentOptions { action_repeat: Some(self.action_repeat), raw_torques: self.raw_torques }
    }

    /// The environment of the recording.
    ///
    /// # Errors
    /// [`vibes_env::Error::UnknownTask`].
    pub fn environment(&self) -> Result<Environment> {
        Ok(Environment::new(&self.task, self.environment_options())?)
    }

    /// Size and look of the recorded pictures; none for a recording without pictures.
    pub fn pictures(&self) -> Option<RenderSettings> {
        self.size.map(|size| RenderSettings { size: size as usize, look: self.look })
    }

    /// The background videos, with frames for pictures of these settings, which are made while `go_on` says yes; none where the background axis is off.
    ///
    /// # Errors
    /// A folder that holds too few videos, a frame that cannot be decoded; [`vibes_env::Error::Stopped`].
    pub fn videos_for(&self, pictures: RenderSettings, go_on: GoOn<'_>) -> Result<Arc<VideoLibrary>> {
        if !self.distractors.axes.background {
            return Ok(Arc::new(VideoLibrary::none()));
        }
        let count = self.videos_used(self.video_count);
        let names = self.videos.list(self.video_set, count).map_err(too_few)?;
        self.open_videos(&names, pictures, go_on)
    }

    /// The same, of the recording at `place`: its manifest names its videos, whatever else the folder holds by now.
    ///
    /// # Errors
    /// A video that is gone, a frame that cannot be decoded; names that no folder has, since a damaged manifest may name anything; [`vibes_env::Error::Stopped`].
    pub fn named_videos(
        &self,
        place: &Path,
        names: &[String],
        pictures: RenderSettings,
        go_on: GoOn<'_>,
    ) -> Result<Arc<VideoLibrary>> {
        if !self.distractors.axes.background {
            return Ok(Arc::new(VideoLibrary::none()));
        }
        Self::check_names(place, names)?;
        self.open_videos(names, pictures, go_on)
    }

    /// The folder of the background videos of these names, where it or one of them is not there: they need not have travelled along with the recording at `place`.
    ///
    /// # Errors
    /// Names that no folder has.
    pub fn absent_videos(&self, place: &Path, names: &[String]) -> Result<Option<PathBuf>> {
        let VideoSource::Folder(folder) = &self.videos else { return Ok(None) };
        if !self.distractors.axes.background {
            return Ok(None);
        }
        Self::check_names(place, names)?;
        let are_there = folder.is_dir() && names.iter().all(|name| folder.join(name).is_dir());
        Ok((!are_there).then(|| folder.clone()))
    }

    /// That these are names of videos, and not too many: a damaged manifest may name anything.
    fn check_names(place: &Path, names: &[String]) -> Result<()> {
        let wanted = names.len();
        if wanted > usize::from(MOST_VIDEOS) {
            return Err(vibes_env::Error::TooManyVideos { wanted, most: MOST_VIDEOS }.into());
        }
        if let Some(name) = names.iter().find(|name| name.is_empty() || name.contains(['/', '\\'])) {
            let fact = format!("a background video is named {name:?}");
            return Err(Error::malformed(place, fact, "right is the name of a video"));
        }
        Ok(())
    }

    fn open_videos(&self, names: &[String], pictures: RenderSettings, go_on: GoOn<'_>) -> Result<Arc<VideoLibrary>> {
        let side = pictures.look.sky_side(pictures.size);
        Ok(Arc::new(VideoLibrary::open_while(&self.videos, self.video_set, names, side, go_on)?))
    }

    /// Size and look of the pictures that somebody sees: those of the recording, else those of whoever acts.
    pub(crate) fn seen(&self) -> Option<RenderSettings> {
        self.pictures().or(self.acting.iter().find_map(|acting| acting.pictures))
    }

    /// The background videos of the recording: none where nobody sees any, neither the recording nor whoever acts.
    ///
    /// # Errors
    /// As [`Self::videos_for`].
    pub fn video_library(&self, go_on: GoOn<'_>) -> Result<Arc<VideoLibrary>> {
        self.seen().map_or_else(|| Ok(Arc::new(VideoLibrary::none())), |pictures| self.videos_for(pictures, go_on))
    }

    /// The manifest of a recording in `folder`, still without episodes.
    pub fn manifest(&self, folder: &Path, seed: u64, environment: &Environment, videos: &[Video]) -> Manifest {
        let mut options = serde_json::to_value(self).unwrap_or_default();
        rebase(&mut options, None, Some(folder));
        let (spec, grid, videos) = (environment.spec(self.size), self.grid, videos.to_vec());
        Heading { spec, options, seed, grid, videos }.manifest()
    }
}

/// A folder that has some videos, and too few for the difficulty, is recorded under when fewer are asked for.
fn too_few(error: vibes_env::Error) -> Error {
    match error {
        vibes_env::Error::TooFewVideos { found, what, wanted, path } if found > 0 => {
            let fact = format!("{found} {what}; {wanted} are needed");
            Error::malformed(path, fact, format!("--video-count {found} takes those that are there"))
        }
        other => other.into(),
    }
}
