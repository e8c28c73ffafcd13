//! What is known of an episode while it goes on: latent and hidden state, observation by observation. In: plain slices, as an environment gives them. Out: latents, and what
//! an actor sees. Whoever acts through a GRU stands on it.
//!
//! Everything that is remembered (the encoder's state, the dynamics' state, the last latent, whether there was a last action) is cleared together by [`Belief::begin`].
//! Latents are the posterior's means, the same numbers that encoding the episode as one window gives.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

use crate::actions::{Actions, Choice};
use crate::actor::features;
use crate::config::ModelConfig;
use crate::dynamics::Dynamics;
use crate::encode::{RawFrames, to_frames};
use crate::encoder::Encoder;
use crate::error::ModelError;
use crate::model::World;
use crate::parameters::to_values;
use crate::scale;

/// Follows an episode.
#[derive(Debug, Clone)]
pub struct Belief {
    config: ModelConfig,
    encoder: Encoder,
    dynamics: Dynamics,
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

impl Belief {
    /// By these networks, which it copies.
    pub fn new(config: &ModelConfig, world: &World, device: &Device) -> Self {
        Self {
            config: config.clone(),
            encoder: world.encoder.valid(),
            dynamics: world.dynamics.valid(),
            device: device.clone().inner(),
            memory: None,
        }
    }

    /// What it looks at, and the actions it takes in.
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

    /// Chooses an action by what is known so far, in the task's bounds: `[A]`; `actor` makes distributions of what it sees. Before the first observation it is the
    /// middle of the bounds.
    pub fn choose(&self, actor: impl FnOnce(Tensor<2>) -> Actions<2>, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        let config = &self.config;
        let mut action = match self.seen() {
            None => vec![0.0; config.actions()],
            Some(seen) => actor(seen).chosen(choice, rng),
        };
        scale::to_bounds(&mut action, &config.action_min, &config.action_max);
        action
    }

    /// What an actor sees of the observation taken in last, `[1, hidden + latent]`; none before the first.
    pub fn seen(&self) -> Option<Tensor<2>> {
        let memory = self.memory.as_ref()?;
        Some(features(memory.dynamics.clone(), memory.latent.clone().squeeze_dim::<2>(0)))
    }
}
