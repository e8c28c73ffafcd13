//! A trained model-free agent at work: it follows one episode, picture by picture, and chooses actions. In: plain slices, as an environment gives them. Out: actions in
//! the task's bounds, and features.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use super::actor::SoftActor;
use super::config::SacConfig;
use super::critic::TwinCritic;
use super::cut::{Border, cut};
use super::networks::{FILE, SacNetworks};
use super::stack::FrameStack;
use crate::actions::Choice;
use crate::error::ModelError;
use crate::kernels::pixel_tensor;
use crate::parameters::to_values;
use crate::scale;

/// Follows an episode and acts in it.
#[derive(Debug, Clone)]
pub struct SacAgent {
    config: SacConfig,
    critic: TwinCritic,
    actor: Option<SoftActor>,
    stack: FrameStack,
    device: Device,
    /// Maps of the stack taken in last: `[1, maps]`
    maps: Option<Tensor<2>>,
}

impl SacAgent {
    /// An agent of these weights, which it copies.
    pub fn new(networks: &SacNetworks, device: &Device) -> Self {
        Self {
            config: networks.config.clone(),
            critic: networks.critic.valid(),
            actor: networks.actor.as_ref().map(Module::valid),
            stack: FrameStack::new(networks.config.stack),
            device: device.clone().inner(),
            maps: None,
        }
    }

    /// The agent of a checkpoint's folder.
    ///
    /// # Errors
    /// The folder holds no such networks, or a damaged file.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        Ok(Self::new(&SacNetworks::load(&checkpoint.join(FILE), device)?, device))
    }

    /// What it looks at, and the actions it takes.
    pub fn config(&self) -> &SacConfig {
        &self.config
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        self.stack.begin();
        self.maps = None;
    }

    /// Takes in the next picture `[height, width, 3]` and returns the critics' features: `[feature]`.
    ///
    /// # Errors
    /// The picture is of another size than the networks'.
    pub fn observe(&mut self, picture: &[u8]) -> Result<Vec<f32>, ModelError> {
        let SacConfig { picture: [height, width], view, .. } = self.config;
        if picture.len() != height * width * 3 {
            let (wanted, found) = (format!("pixels of {height}×{width}"), format!("{} bytes a picture", picture.len()));
            return Err(ModelError::Mismatch { wanted, found });
        }
        self.stack.push(picture);
        let channels = self.config.channels();
        let place = [height - view[0], width - view[1]].map(|room| (room / 2) as i32);
        let mut seen = Vec::new();
        cut(&self.stack.stacked(), [height, width, channels], place, view, Border::Repeated, &mut seen);
        let maps = self.critic.convolutions.forward(pixel_tensor(seen, [1, view[0], view[1], channels], &self.device));
        self.maps = Some(maps.clone());
        Ok(to_values(self.critic.trunk.forward(maps)))
    }

    /// Chooses the action of the picture taken in last, in the task's bounds: `[A]`. Without a picture it is the middle of the bounds.
    pub fn choose(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        let width = self.config.actions();
        let mut action = match &self.maps {
            None => vec![0.0; width],
            Some(maps) => self.action(maps.clone(), choice, rng),
        };
        scale::to_bounds(&mut action, &self.config.action_min, &self.config.action_max);
        action
    }

    fn action(&self, maps: Tensor<2>, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        let width = self.config.actions();
        match (&self.actor, choice) {
            (Some(actor), _) => actor.forward(maps).chosen(choice, rng),
            (None, Choice::Sample) if rng.random::<f32>() < self.config.random_share => {
                (0..width).map(|_| rng.random_range(-1.0..=1.0)).collect()
            }
            (None, _) => {
                let features = self.critic.trunk.forward(maps);
                to_values(self.critic.best_action(features, self.config.search.unwrap_or_default(), [1, width], rng))
            }
        }
    }
}
