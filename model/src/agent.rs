//! A trained agent at work: it follows one episode, observation by observation, and chooses actions. In: plain slices, as an environment gives them. Out: actions
//! in the task's bounds, and latents. It knows no simulator.
//!
//! Everything it remembers of an episode (the encoder's state, the dynamics' state, the last latent, whether there was a last action) is cleared together by
//! [`Agent::begin`]. Latents are the posterior's means, the same numbers that encoding the episode as one window gives.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

use crate::actions::noise;
use crate::actor::{Actor, features};
use crate::behaviour::Behaviour;
use crate::config::ModelConfig;
use crate::dynamics::Dynamics;
use crate::encode::{RawFrames, to_frames};
use crate::encoder::Encoder;
use crate::error::ModelError;
use crate::model::Model;
use crate::parameters::to_values;
use crate::scale;

/// Which action of the actor's distribution is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The mean's: for evaluation.
    Mode,
    /// A drawn one: for exploration.
    Sample,
}

/// Follows an episode and acts in it.
#[derive(Debug, Clone)]
pub struct Agent {
    config: ModelConfig,
    encoder: Encoder,
    dynamics: Dynamics,
    actor: Actor,
    device: Device,
    /// None before an episode's first observation.
    memory: Option<Memory>,
}

/// What is carried from one observation to the next.
#[derive(Debug, Clone)]
struct Memory {
    /// The encoder's: `[1, hidden]`
    encoder: Tensor<2>,
    /// The dynamics', before the next action is consumed: `[1, hidden]`
    dynamics: Tensor<2>,
    /// `[1, 1, latent]`
    latent: Tensor<3>,
}

impl Agent {
    /// An agent of these weights, which it copies.
    pub fn new(model: &Model, actor: &Actor, device: &Device) -> Self {
        Self {
            config: model.config.clone(),
            encoder: model.world.encoder.valid(),
            dynamics: model.world.dynamics.valid(),
            actor: actor.valid(),
            device: device.clone().inner(),
            memory: None,
        }
    }

    /// The agent of a checkpoint's folder.
    ///
    /// # Errors
    /// The folder holds no model, or a model without an actor, or a damaged file.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        let model = Model::load(&checkpoint.join("model.safetensors"), device)?;
        let behaviour = Behaviour::load(&checkpoint.join("behaviour.safetensors"), &model.config, device)?;
        Ok(Self::new(&model, &behaviour.actor, device))
    }

    /// What it looks at, and the actions it takes.
    pub fn config(&self) -> &ModelConfig {
        &self.config
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        self.memory = None;
    }

    /// Takes in one observation and the action that was executed before it (in the task's bounds, as it was executed; not used at an episode's first
    /// observation), and returns the latent: `[latent]`.
    ///
    /// # Errors
    /// The observation or the action is of another kind or size than the model's.
    pub fn observe(&mut self, frame: RawFrames<'_>, previous_action: &[f32]) -> Result<Vec<f32>, ModelError> {
        let width = self.config.actions();
        let mut action = previous_action.to_vec();
        if self.memory.is_none() {
            action = vec![0.0; width];
        } else if action.len() == width {
            scale::actions(&mut action, &self.config.action_min, &self.config.action_max);
        } else {
            let (wanted, found) = (format!("actions of {width}"), format!("actions of {}", action.len()));
            return Err(ModelError::Mismatch { wanted, found });
        }
        let frames = to_frames(frame, self.config.observation, 1, &self.device)?;
        let action = Tensor::<3>::from_data(TensorData::new(action, [1, 1, width]), &self.device);
        let (state, dynamics) = match self.memory.take() {
            None => (None, Tensor::zeros([1, self.config.hidden], &self.device)),
            Some(Memory { encoder, dynamics, latent }) => {
                let input = Tensor::cat(vec![latent, action.clone()], 2);
                (Some(encoder), self.dynamics.gru.forward(input, Some(dynamics)).squeeze_dim(0))
            }
        };
        let encoding = self.encoder.forward(frames, action, state)?;
        let latent = to_values(encoding.means.clone());
        self.memory = Some(Memory { encoder: encoding.state, dynamics, latent: encoding.means });
        Ok(latent)
    }

    /// Chooses the action of the observation taken in last, in the task's bounds: `[A]`. Without an observation it is the middle of the bounds.
    pub fn choose(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        let width = self.config.actions();
        let mut action = match &self.memory {
            None => vec![0.0; width],
            Some(memory) => {
                let seen = features(memory.dynamics.clone(), memory.latent.clone().squeeze_dim::<2>(0));
                let actions = self.actor.forward(seen);
                to_values(match choice {
                    Choice::Mode => actions.mode(),
                    Choice::Sample => actions.sample(noise([1, width], rng, &self.device)).action,
                })
            }
        };
        scale::to_bounds(&mut action, &self.config.action_min, &self.config.action_max);
        action
    }

    /// [`Agent::observe`], then [`Agent::choose`].
    ///
    /// # Errors
    /// As [`Agent::observe`].
    pub fn act(
        &mut self,
        frame: RawFrames<'_>,
        previous_action: &[f32],
        choice: Choice,
        rng: &mut impl Rng,
    ) -> Result<Vec<f32>, ModelError> {
        self.observe(frame, previous_action)?;
        Ok(self.choose(choice, rng))
    }

    /// What the actor sees of the observation taken in last, `[hidden + latent]`; empty before the first.
    pub fn features(&self) -> Vec<f32> {
        self.memory.as_ref().map_or_else(Vec::new, |memory| {
            to_values(features(memory.dynamics.clone(), memory.latent.clone().squeeze_dim::<2>(0)))
        })
    }
}
