//! What a world is asked to be: the arguments of `vibes.make`, read once into the types of the environment.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;
use vibes_data::MOST_ACTION_REPEAT;
use vibes_env::distractors::{Axes, Difficulty, DistractorSettings};
use vibes_env::render::{Look, MAX_SIZE, RenderSettings};
use vibes_env::videos::{MOST_VIDEOS, VideoLibrary, VideoSet, VideoSource};
use vibes_env::{ChosenSeeds, Environment, EnvironmentOptions, EpisodeSeeds};

use crate::error::refused;

/// The arguments as they come. Numbers may be below zero, so that whoever knows their bounds can say them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    task: String,
    difficulty: String,
    dynamic: bool,
    distract: Vec<String>,
    videos: Option<PathBuf>,
    video_set: String,
    video_count: Option<i64>,
    size: Option<i64>,
    action_repeat: Option<i64>,
    render: String,
    raw_torques: bool,
    axis_seeds: ChosenSeeds,
}

/// Everything that decides what a world shows.
#[derive(Clone, Debug)]
pub(crate) struct WorldOptions {
    pub task: String,
    pub environment: EnvironmentOptions,
    pub distractors: DistractorSettings,
    pub videos: VideoSource,
    pub video_set: VideoSet,
    pub video_count: Option<usize>,
    pub size: Option<u32>,
    pub look: Look,
    pub axis_seeds: ChosenSeeds,
}

impl WorldOptions {
    /// Reads the arguments; the message names the one that is wrong and what would be right.
    pub(super) fn read(asked: &Bound<'_, PyDict>) -> PyResult<Self> {
        let asked: Asked = pythonize::depythonize(asked).map_err(refused)?;
        let within = |what: &str, value: Option<i64>, most: u32| -> PyResult<Option<u32>> {
            let Some(value) = value else { return Ok(None) };
            match u32::try_from(value) {
                Ok(number) if (1..=most).contains(&number) => Ok(Some(number)),
                _ => Err(refused(format!("{what} {value}; right is 1 to {most}"))),
            }
        };
        let distract = if asked.distract.is_empty() { "none".to_owned() } else { asked.distract.join(",") };
        Ok(Self {
            task: asked.task,
            environment: EnvironmentOptions {
                action_repeat: within("an action repeat of", asked.action_repeat, MOST_ACTION_REPEAT)?,
                raw_torques: asked.raw_torques,
            },
            distractors: DistractorSettings {
                axes: distract.parse::<Axes>().map_err(refused)?,
                difficulty: asked.difficulty.parse::<Difficulty>().map_err(refused)?,
                dynamic: asked.dynamic,
            },
            videos: asked.videos.map_or(VideoSource::Procedural, VideoSource::Folder),
            video_set: asked.video_set.parse().map_err(refused)?,
            video_count: within("a video count of", asked.video_count, u32::from(MOST_VIDEOS))?
                .map(|count| count as usize),
            size: within("a size of", asked.size, MAX_SIZE as u32)?,
            look: asked.render.parse().map_err(refused)?,
            axis_seeds: asked.axis_seeds,
        })
    }

    pub(super) fn environment(&self) -> vibes_env::Result<Environment> {
        Environment::new(&self.task, self.environment)
    }

    pub(super) fn pictures(&self) -> Option<RenderSettings> {
        self.size.map(|size| RenderSettings { size: size as usize, look: self.look })
    }

    /// The background videos, the same as the collector's for the same arguments; none where no picture would show them.
    pub(super) fn open_videos(&self) -> vibes_env::Result<VideoLibrary> {
        let Some(size) = self.size.filter(|_| self.distractors.axes.background) else {
            return Ok(VideoLibrary::none());
        };
        let count = self.video_count.or(self.distractors.difficulty.videos());
        let names = self.videos.list(self.video_set, count)?;
        VideoLibrary::open(&self.videos, self.video_set, &names, self.look.sky_side(size as usize))
    }

    /// The seeds of an episode, as a recording of this seed has them.
    pub(super) fn seeds(&self, seed: u64, state: u32, distractor: u32) -> EpisodeSeeds {
        self.axis_seeds.of_episode(seed, state, distractor)
    }
}
