//! From a state trajectory and a distractor trajectory to an episode with pictures.
//!
//! In: a [`StateTrajectory`], a [`DistractorTrajectory`]. Out: an [`Episode`], its rows aligned by `vibes-data`'s builder. One [`Studio`] a thread.

use vibes_data::{Episode, EpisodeBuilder, Frame};

use crate::Result;
use crate::plan::{ChosenSeeds, PlannedEpisode, RecordOptions};
use crate::recorder::own_colors;
use vibes_env::distractors::camera::CameraStart;
use vibes_env::distractors::{DistractorSettings, DistractorTrajectory, Undistracted};
use vibes_env::render::{RenderSettings, Renderer, camera_start};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, StateTrajectory};

/// What is the same for every episode of a recording.
#[derive(Debug)]
pub struct StudioSettings<'a> {
    distractors: DistractorSettings,
    seed: u64,
    axis_seeds: ChosenSeeds,
    camera: CameraStart,
    colors: Vec<f32>,
    videos: &'a VideoLibrary,
    video_frames: Vec<usize>,
    pictures: Option<RenderSettings>,
}

impl<'a> StudioSettings<'a> {
    /// Reads the camera and the colours that the distractors start from off the task's model.
    ///
    /// # Errors
    /// When the model has no camera that the distractors can move.
    pub fn new(
        options: &RecordOptions,
        seed: u64,
        environment: &Environment,
        videos: &'a VideoLibrary,
    ) -> Result<Self> {
        Ok(Self {
            distractors: options.distractors,
            seed,
            axis_seeds: options.axis_seeds,
            camera: camera_start(&options.task, environment.physics().model())?,
            colors: own_colors(environment),
            videos,
            video_frames: videos.frame_counts(),
            pictures: options.size.map(|size| RenderSettings { size: size as usize, look: options.look }),
        })
    }

    /// The parameters of one distractor trajectory of T agent steps.
    pub fn distractor(&self, number: u32, steps: usize, action_repeat: u32) -> DistractorTrajectory {
        let from = Undistracted { camera: self.camera, colors: &self.colors, video_frames: &self.video_frames };
        let seeds = self.axis_seeds.of_trajectory(self.seed, number);
        DistractorTrajectory::generate(&self.distractors, &from, steps, action_repeat as usize, seeds)
    }
}

/// A render context, if pictures are asked for, and the settings.
#[derive(Debug)]
pub struct Studio<'a> {
    settings: &'a StudioSettings<'a>,
    renderer: Option<Renderer>,
}

impl<'a> Studio<'a> {
    /// Opens a render context on this thread.
    ///
    /// # Errors
    /// [`vibes_env::Error::NoEgl`] on a machine that cannot draw.
    pub fn new(settings: &'a StudioSettings<'a>, environment: &Environment) -> Result<Self> {
        let physics = environment.physics();
        let open = |pictures| Renderer::new(pictures, environment.name(), physics.model());
        Ok(Self { settings, renderer: settings.pictures.map(open).transpose()? })
    }

    /// Draws a state trajectory under a distractor trajectory. The environment lends its model, with the episode's overrides.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn draw_episode(
        &mut self,
        planned: PlannedEpisode,
        trajectory: &StateTrajectory,
        distractor: &DistractorTrajectory,
        environment: &mut Environment,
    ) -> Result<Episode> {
        self.begin(trajectory, environment)?;
        let first = self.frame(trajectory, distractor, 0)?;
        let mut builder = EpisodeBuilder::first(planned.index, planned.cell, first);
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
        renderer.begin_episode(&trajectory.qpos[0])
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
            renderer.draw(&trajectory.qpos[row], &distractor.view(row), self.settings.videos, &mut pixels)?;
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
