//! A trained recurrent agent at work: it follows one episode, picture by picture, and chooses actions. In: plain slices, as an environment gives them. Out: actions in the
//! task's bounds, and latents.

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use rand::Rng;

use super::networks::{FILE, RecurrentConfig, RecurrentNetworks, StateActor};
use crate::actions::Choice;
use crate::belief::Belief;
use crate::config::ObservationKind;
use crate::encode::RawFrames;
use crate::error::ModelError;
use crate::sac::cut::{Border, cut};

/// Follows an episode and acts in it.
#[derive(Debug, Clone)]
pub struct RecurrentAgent {
    config: RecurrentConfig,
    belief: Belief,
    actor: StateActor,
}

impl RecurrentAgent {
    /// An agent of these weights, which it copies.
    pub fn new(networks: &RecurrentNetworks, device: &Device) -> Self {
        Self {
            config: networks.config.clone(),
            belief: Belief::new(&networks.config.model, &networks.world, device),
            actor: networks.actor.valid(),
        }
    }

    /// The agent of a checkpoint's folder.
    ///
    /// # Errors
    /// The folder holds no such networks, or a damaged file.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        Ok(Self::new(&RecurrentNetworks::load(&checkpoint.join(FILE), device)?, device))
    }

    /// What it looks at, and the actions it takes.
    pub fn config(&self) -> &RecurrentConfig {
        &self.config
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        self.belief.begin();
    }

    /// Takes in the next picture `[height, width, 3]` and the action that was executed before it, and returns the latent: `[latent]`.
    ///
    /// # Errors
    /// The picture is of another size than the networks', or the action.
    pub fn observe(&mut self, picture: &[u8], previous_action: &[f32]) -> Result<Vec<f32>, ModelError> {
        let [height, width] = self.config.picture;
        let view = match self.config.model.observation {
            ObservationKind::Pixels { height, width } => [height, width],
            ObservationKind::Vector { .. } => self.config.picture,
        };
        if picture.len() != height * width * 3 {
            let (wanted, found) = (format!("pixels of {height}×{width}"), format!("{} bytes a picture", picture.len()));
            return Err(ModelError::Mismatch { wanted, found });
        }
        let place = [height - view[0], width - view[1]].map(|room| (room / 2) as i32);
        let mut seen = Vec::new();
        cut(picture, [height, width, 3], place, view, Border::Repeated, &mut seen);
        self.belief.observe(RawFrames::Pixels(&seen), previous_action)
    }

    /// Chooses the action of the picture taken in last, in the task's bounds: `[A]`. Without a picture it is the middle of the bounds.
    pub fn choose(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        self.belief.choose(|seen| self.actor.forward(seen), choice, rng)
    }
}
