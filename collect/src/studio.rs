//! From a state trajectory and a distractor trajectory to an episode with pictures.
//!
//! In: a [`StateTrajectory`], a [`DistractorTrajectory`]. Out: an [`Episode`], its rows aligned by `vibes-data`'s builder. One [`Studio`] a thread.

use std::sync::Arc;

use vibes_data::{Episode, EpisodeBuilder, Frame};

use crate::Result;
use crate::plan::{ChosenSeeds, PlannedEpisode, RecordOptions};
use crate::stored::Acted;
use vibes_env::distractors::{AxisSeeds, DistractorSettings, DistractorTrajectory, Undistracted};
use vibes_env::render::{RenderSettings, Renderer, undistracted};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, StateTrajectory};

/// What is the same for every episode of a recording.
#[derive(Debug)]
pub struct StudioSettings {
    distractors: DistractorSettings,
    seed: u64,
    axis_seeds: ChosenSeeds,
    undistracted: Undistracted,
    videos: Arc<VideoLibrary>,
    pictures: Option<RenderSettings>,
}

impl StudioSettings {
    /// Reads the camera and the colours that the distractors start from off the task's model.
    ///
    /// # Errors
    /// When the model has no camera that the distractors can move.
    pub fn new(
        options: &RecordOptions,
        seed: u64,
        environment: &Environment,
        videos: Arc<VideoLibrary>,
    ) -> Result<Self> {
        Ok(Self {
            distractors: options.distractors,
            seed,
            axis_seeds: options.axis_seeds,
            undistracted: undistracted(environment.scenery(), environment.physics().model(), &videos)?,
            videos,
            pictures: options.pictures(),
        })
    }

    /// The parameters of one distractor trajectory of T agent steps.
    pub fn distractor(&self, number: u32, steps: usize, action_repeat: u32) -> DistractorTrajectory {
        let repeat = action_repeat as usize;
        DistractorTrajectory::generate(&self.distractors, &self.undistracted, steps, repeat, self.seeds(number))
    }

    /// The seeds of one distractor trajectory.
    pub fn seeds(&self, number: u32) -> AxisSeeds {
        self.axis_seeds.of_trajectory(self.seed, number)
    }

    /// The background videos.
    pub fn videos(&self) -> &Arc<VideoLibrary> {
        &self.videos
    }
}

/// A render context, if pictures are asked for, and the settings.
#[derive(Debug)]
pub struct Studio<'a> {
    settings: &'a StudioSettings,
    renderer: Option<Renderer>,
}

impl<'a> Studio<'a> {
    /// Opens a render context on this thread.
    ///
    /// # Errors
    /// [`vibes_env::Error::NoEgl`] on a machine that cannot draw.
    pub fn new(settings: &'a StudioSettings, environment: &Environment) -> Result<Self> {
        let physics = environment.physics();
        let open = |pictures| Renderer::new(pictures, environment.scenery(), physics.model());
        Ok(Self { settings, renderer: settings.pictures.map(open).transpose()? })
    }

    /// Draws a state trajectory under a distractor trajectory. The environment lends its model, with the episode's overrides.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn draw_episode(
        &mut self,
        planned: PlannedEpisode,
        acted: &Acted,
        distractor: &DistractorTrajectory,
        environment: &mut Environment,
    ) -> Result<Episode> {
        let trajectory = &acted.trajectory;
        self.begin(trajectory, environment)?;
        let first = self.frame(trajectory, distractor, 0)?;
        let mut builder =
            EpisodeBuilder::first(planned.index, planned.cell, first).acting_under(acted.acting_distractor);
        for step in 0..trajectory.steps() {
            let action: Vec<f32> = trajectory.actions[step].iter().map(|&number| number as f32).collect();
            let next = self.frame(trajectory, distractor, step + 1)?;
            builder.step(&action, trajectory.rewards[step] as f32, 1.0, next);
        }
        // The suite's tasks stop, but never end in a terminal state.
        Ok(builder.finish(false))
    }

    /// Puts an episode's model overrides and first positions in place.
    pub(crate) fn begin(&mut self, trajectory: &StateTrajectory, environment: &mut Environment) -> Result<()> {
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        environment.reset_to(&trajectory.start)?;
        renderer.set_model(environment.physics().model())?;
        Ok(renderer.begin_episode(&trajectory.qpos[0])?)
    }

    /// Everything seen at one row.
    pub(crate) fn frame(
        &mut self,
        trajectory: &StateTrajectory,
        distractor: &DistractorTrajectory,
        row: usize,
    ) -> Result<Frame> {
        let mut pixels = Vec::new();
        if let Some(renderer) = &mut self.renderer {
            pixels.resize(renderer.picture_bytes(), 0);
            renderer.draw(&trajectory.qpos[row], &distractor.view(row), &self.settings.videos, &mut pixels)?;
        }
        Ok(Frame {
            observation: trajectory.observations[row].iter().map(|&number| number as f32).collect(),
            qpos: trajectory.qpos[row].clone(),
            qvel: trajectory.qvel[row].clone(),
            pixels,
            camera: distractor.cameras[row],
            background: distractor.backgrounds[row],
            colors: distractor.colors(row).to_vec(),
        })
    }
}
