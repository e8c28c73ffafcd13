//! How many pictures a second, and where the time goes.
//!
//! In: a [`SpeedTrial`]. Out: its [`Speed`]. Every thread simulates random actions, walks its own distractors and draws with its own renderer, as a
//! recording does; nothing is written.

use std::time::{Duration, Instant};

use mujoco_rs::prelude::{MjData, MjModel};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{RenderSettings, Renderer, undistracted};
use crate::distractors::{AxisSeeds, DistractorSettings, DistractorTrajectory, Scenery, View};
use crate::error::{Error, Result};
use crate::videos::VideoLibrary;

/// What is measured.
#[derive(Clone, Copy, Debug)]
pub struct SpeedTrial<'a> {
    /// The task's scenery.
    pub scenery: Scenery,
    /// Its model.
    pub model: &'a MjModel,
    /// Size and look.
    pub settings: RenderSettings,
    /// None for the task as it is.
    pub distractors: Option<DistractorSettings>,
    /// The videos, of [`Look::sky_side`](super::Look::sky_side)'s side.
    pub videos: &'a VideoLibrary,
    /// Control steps per picture.
    pub action_repeat: usize,
    /// Physics steps per control step.
    pub physics_steps: usize,
    /// Pictures per thread.
    pub pictures: usize,
    /// Renderers at work at the same time.
    pub threads: usize,
    /// Wait for every stage to end, so that [`Speed::stages`] are true; slower.
    pub separate_stages: bool,
    /// Leave every body out of the scene.
    pub is_empty: bool,
}

/// Time spent in the stages of drawing, summed over threads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Simulating.
    pub physics: Duration,
    /// Placing bodies, camera and colours, and making MuJoCo's scene.
    pub scene: Duration,
    /// Reading the video frame and uploading it.
    pub upload: Duration,
    /// OpenGL's drawing.
    pub render: Duration,
    /// Reading the picture back.
    pub read_back: Duration,
}

impl std::ops::AddAssign for StageTimes {
    fn add_assign(&mut self, other: Self) {
        self.physics += other.physics;
        self.scene += other.scene;
        self.upload += other.upload;
        self.render += other.render;
        self.read_back += other.read_back;
    }
}

/// What a trial came to.
#[derive(Clone, Copy, Debug)]
pub struct Speed {
    /// Pictures of all threads.
    pub pictures: usize,
    /// Wall time, renderers already open.
    pub elapsed: Duration,
    /// Where it went.
    pub stages: StageTimes,
}

impl Speed {
    /// Pictures a second.
    pub fn pictures_per_second(&self) -> f64 {
        self.pictures as f64 / self.elapsed.as_secs_f64()
    }
}

impl SpeedTrial<'_> {
    /// Runs the trial.
    ///
    /// # Errors
    /// When nothing can be drawn.
    pub fn run(&self) -> Result<Speed> {
        let outcomes: Vec<Result<(Instant, Instant, StageTimes)>> = std::thread::scope(|scope| {
            let threads: Vec<_> =
                (0..self.threads).map(|thread| scope.spawn(move || self.run_thread(thread as u64))).collect();
            let died = || Error::Render {
                fact: "a drawing thread died".to_owned(),
                expected: "threads end by themselves".to_owned(),
            };
            threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| Err(died()))).collect()
        });
        let outcomes = outcomes.into_iter().collect::<Result<Vec<_>>>()?;
        let mut stages = StageTimes::default();
        outcomes.iter().for_each(|outcome| stages += outcome.2);
        let first = outcomes.iter().map(|outcome| outcome.0).min();
        let last = outcomes.iter().map(|outcome| outcome.1).max();
        let elapsed = first.zip(last).map_or(Duration::ZERO, |(first, last)| last - first);
        Ok(Speed { pictures: self.pictures * self.threads, elapsed, stages })
    }

    fn run_thread(&self, seed: u64) -> Result<(Instant, Instant, StageTimes)> {
        let refused = |error: &dyn std::fmt::Display| Error::Render {
            fact: error.to_string(),
            expected: "enough memory".to_owned(),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let undistracted = undistracted(self.scenery, self.model, self.videos)?;
        let mut data = MjData::try_new(self.model).map_err(|error| refused(&error))?;
        let mut renderer = Renderer::new(self.settings, self.scenery, self.model)?;
        let mut picture = vec![0; renderer.picture_bytes()];
        renderer.separate_stages(self.separate_stages);
        if self.is_empty {
            renderer.option.geomgroup = [0; 6];
        }
        renderer.begin_episode(data.qpos())?;
        renderer.draw(data.qpos(), &View::default(), self.videos, &mut picture)?;
        renderer.take_stages();
        let (begin, mut physics) = (Instant::now(), Duration::ZERO);
        let trajectory = self.distractors.map(|distractors| {
            DistractorTrajectory::generate(
                &distractors,
                &undistracted,
                self.pictures,
                self.action_repeat,
                AxisSeeds::from(seed),
            )
        });
        for row in 0..self.pictures {
            let simulating = Instant::now();
            data.ctrl_mut().fill_with(|| rng.random_range(-1.0..1.0));
            (0..self.action_repeat * self.physics_steps).for_each(|_| data.step());
            physics += simulating.elapsed();
            let view = trajectory.as_ref().map_or_else(View::default, |trajectory| trajectory.view(row));
            renderer.draw(data.qpos(), &view, self.videos, &mut picture)?;
        }
        let stages = StageTimes { physics, ..renderer.take_stages() };
        Ok((begin, Instant::now(), stages))
    }
}
