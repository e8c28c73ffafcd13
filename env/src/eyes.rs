//! Eyes: an environment, the distractors of an episode and a renderer under one clock, so that pictures can be had while the episode goes on.
//!
//! In: a start, seeds, actions. Out: rewards, and, only when they are asked for, the row's picture and parameters. Inside an action repeat the
//! distractors advance with every control step and nothing is drawn.
//!
//! A row that is drawn here is byte for byte the row that a recording draws afterwards from the stored state with the same seeds: both put
//! positions and a [`View`](crate::distractors::View) through the same [`Renderer`].
//!
//! ```no_run
//! use std::sync::Arc;
//! use rand::SeedableRng;
//! use vibes_env::distractors::{AxisSeeds, Difficulty, DistractorSettings};
//! use vibes_env::render::RenderSettings;
//! use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};
//! use vibes_env::{Environment, EnvironmentOptions, Eyes};
//!
//! # fn main() -> vibes_env::Result<()> {
//! let environment = Environment::new("reacher-easy", EnvironmentOptions::default())?;
//! let pictures = RenderSettings::default();
//! let source = VideoSource::Procedural;
//! let names = source.list(VideoSet::Train, Difficulty::Easy.videos())?;
//! let videos = VideoLibrary::open(&source, VideoSet::Train, &names, pictures.look.sky_side(pictures.size))?;
//! let mut eyes = Eyes::new(environment, DistractorSettings::default(), Some(pictures), Arc::new(videos))?;
//! eyes.reset(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1), AxisSeeds::from(2))?;
//! let reward = eyes.step(&[0.1, -0.2])?;
//! let frame = eyes.frame()?; // the row: observation, qpos, qvel, pixels, camera, background, colours
//! # Ok(()) }
//! ```

use std::sync::Arc;

use rand::RngCore;
use vibes_data::Frame;

use crate::distractors::{Axes, AxisSeeds, DistractorSettings, DistractorWalk, Undistracted};
use crate::policies::Sight;
use crate::render::{RenderSettings, Renderer, undistracted};
use crate::videos::VideoLibrary;
use crate::{Environment, Result, Start};

/// See the module. Stays on its thread, as an OpenGL context does, unless it is used inside [`visiting`](crate::render::visiting).
#[derive(Debug)]
pub struct Eyes {
    environment: Environment,
    distractors: DistractorSettings,
    undistracted: Undistracted,
    walk: DistractorWalk,
    videos: Arc<VideoLibrary>,
    renderer: Option<Renderer>,
    /// The vector observation of the present row, in double and single precision.
    observation: (Vec<f64>, Vec<f32>),
    /// The picture of the present row, if it was asked for.
    picture: Vec<u8>,
    is_drawn: bool,
}

impl Eyes {
    /// Opens eyes on an environment. Without `pictures` no OpenGL context is opened and every picture is empty. `videos` has frames of the side
    /// that [`Look::sky_side`](crate::render::Look::sky_side) says; [`VideoLibrary::none`] shows the model's own sky.
    ///
    /// # Errors
    /// [`Error::NoEgl`](crate::Error::NoEgl) on a machine that cannot draw; [`Error::Render`](crate::Error::Render) for an impossible size.
    pub fn new(
        environment: Environment,
        distractors: DistractorSettings,
        pictures: Option<RenderSettings>,
        videos: Arc<VideoLibrary>,
    ) -> Result<Self> {
        let model = environment.physics().model();
        let undistracted = undistracted(environment.scenery(), model, &videos)?;
        let renderer = pictures.map(|pictures| Renderer::new(pictures, environment.scenery(), model)).transpose()?;
        let walk = DistractorWalk::reset(&distractors, &undistracted, AxisSeeds::from(0));
        let picture = vec![0; renderer.as_ref().map_or(0, Renderer::picture_bytes)];
        let observation = Default::default();
        let mut eyes = Self {
            environment,
            distractors,
            undistracted,
            walk,
            videos,
            renderer,
            observation,
            picture,
            is_drawn: false,
        };
        eyes.observe();
        Ok(eyes)
    }

    /// Eyes for a policy that acts without pictures: no distractors, nothing drawn.
    ///
    /// # Errors
    /// When the model has no camera of the kinds the suite can move.
    pub fn blind(environment: Environment) -> Result<Self> {
        let distractors = DistractorSettings { axes: Axes::NONE, ..DistractorSettings::default() };
        Self::new(environment, distractors, None, Arc::new(VideoLibrary::none()))
    }

    /// The environment in its present state.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// The environment, to be lent to whoever draws stored states with its model. The next episode has to begin with a reset.
    pub fn environment_mut(&mut self) -> &mut Environment {
        &mut self.environment
    }

    /// Size and look of the pictures; none if it draws none.
    pub fn pictures(&self) -> Option<RenderSettings> {
        self.renderer.as_ref().map(Renderer::settings)
    }

    /// The distractors it sees.
    pub fn distractors(&self) -> &DistractorSettings {
        &self.distractors
    }

    /// Begins an episode at a drawn start, which is returned, under the distractors of `seeds`.
    ///
    /// # Errors
    /// When no start is found.
    pub fn reset(&mut self, rng: &mut impl RngCore, seeds: AxisSeeds) -> Result<Start> {
        let start = self.environment.reset(rng)?;
        self.begin(seeds)?;
        Ok(start)
    }

    /// Begins an episode at a given start, under the distractors of `seeds`.
    ///
    /// # Errors
    /// When the start is not one of this task.
    pub fn reset_to(&mut self, start: &Start, seeds: AxisSeeds) -> Result<()> {
        self.environment.reset_to(start)?;
        self.begin(seeds)
    }

    fn begin(&mut self, seeds: AxisSeeds) -> Result<()> {
        self.walk = DistractorWalk::reset(&self.distractors, &self.undistracted, seeds);
        if let Some(renderer) = &mut self.renderer {
            let physics = self.environment.physics();
            renderer.set_model(physics.model())?;
            renderer.begin_episode(physics.qpos())?;
        }
        self.observe();
        Ok(())
    }

    /// One agent step: the action `[action]` is held for the action repeat, and the distractors advance with every control step of it. Returns the
    /// sum of the rewards; nothing is drawn.
    ///
    /// # Errors
    /// When the action has the wrong length or the simulation becomes unstable.
    pub fn step(&mut self, action: &[f64]) -> Result<f64> {
        let reward = self.environment.step(action)?;
        (0..self.environment.action_repeat()).for_each(|_| self.walk.advance());
        self.observe();
        Ok(reward)
    }

    fn observe(&mut self) {
        let (exact, single) = &mut self.observation;
        self.environment.observe(exact);
        single.clear();
        single.extend(exact.iter().map(|&number| number as f32));
        self.is_drawn = false;
    }

    /// The vector observation of the present row, `[observation]`.
    pub fn observation(&self) -> &[f64] {
        &self.observation.0
    }

    /// The picture of the present row, `[size, size, 3]`, drawn when it is first asked for; empty without pictures.
    ///
    /// # Errors
    /// When a video frame cannot be read or the OpenGL context is lost.
    pub fn picture(&mut self) -> Result<&[u8]> {
        if let (Some(renderer), false) = (&mut self.renderer, self.is_drawn) {
            let qpos = self.environment.physics().qpos();
            renderer.draw(qpos, &self.walk.view(), &self.videos, &mut self.picture)?;
            self.is_drawn = true;
        }
        Ok(&self.picture)
    }

    /// What a policy may see at the present row; with `pixels` the picture is drawn.
    ///
    /// # Errors
    /// As [`Self::picture`].
    pub fn sight(&mut self, pixels: bool) -> Result<Sight<'_>> {
        if pixels {
            self.picture()?;
        }
        let pixels = if pixels { self.picture.as_slice() } else { &[] };
        Ok(Sight { observation: &self.observation.1, pixels, environment: &self.environment })
    }

    /// The whole of the present row, as a recording keeps it: for [`vibes_data::EpisodeBuilder`].
    ///
    /// # Errors
    /// As [`Self::picture`].
    pub fn frame(&mut self) -> Result<Frame> {
        let pixels = self.picture()?.to_vec();
        let physics = self.environment.physics();
        Ok(Frame {
            observation: self.observation.1.clone(),
            qpos: physics.qpos().to_vec(),
            qvel: physics.qvel().to_vec(),
            pixels,
            camera: self.walk.camera(),
            background: self.walk.background(),
            colors: self.walk.colors().to_vec(),
        })
    }
}
