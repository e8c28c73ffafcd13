//! A trained agent at work: it follows one episode, observation by observation, and chooses actions. In: plain slices, as an environment gives them. Out: actions
//! in the task's bounds, and latents. It knows no simulator.
//!
//! What it remembers of an episode is a [`Belief`].

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use rand::Rng;

use crate::actions::Choice;
use crate::actor::Actor;
use crate::behaviour::Behaviour;
use crate::belief::Belief;
use crate::config::ModelConfig;
use crate::encode::RawFrames;
use crate::error::ModelError;
use crate::model::Model;
use crate::parameters::to_values;

/// Follows an episode and acts in it.
#[derive(Debug, Clone)]
pub struct Agent {
    belief: Belief,
    actor: Actor,
}

impl Agent {
    /// An agent of these weights, which it copies.
    pub fn new(model: &Model, actor: &Actor, device: &Device) -> Self {
        Self { belief: Belief::new(&model.config, &model.world, device), actor: actor.valid() }
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
        self.belief.config()
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        self.belief.begin();
    }

    /// Takes in one observation and the action that was executed before it (in the task's bounds, as it was executed; not used at an episode's first
    /// observation), and returns the latent: `[latent]`.
    ///
    /// # Errors
    /// The observation or the action is of another kind or size than the model's.
    pub fn observe(&mut self, frame: RawFrames<'_>, previous_action: &[f32]) -> Result<Vec<f32>, ModelError> {
        self.belief.observe(frame, previous_action)
    }

    /// Chooses the action of the observation taken in last, in the task's bounds: `[A]`. Without an observation it is the middle of the bounds.
    pub fn choose(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        self.belief.choose(|seen| self.actor.forward(seen), choice, rng)
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
        self.belief.seen().map_or_else(Vec::new, to_values)
    }
}
