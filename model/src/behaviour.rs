//! Actor, critic and the critic's slow copy, and their file beside a model's: `behaviour.safetensors`, with the [`BehaviourConfig`] as JSON in its metadata.

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use rand::{Rng, SeedableRng};

use crate::actor::Actor;
use crate::checkpoint::{load_described, save_described};
use crate::config::{BehaviourConfig, ModelConfig};
use crate::critic::Critic;
use crate::described::{Described, Matrix};
use crate::error::ModelError;
use crate::parameters::{HostTensors, read_parameters, write_parameters};

/// Who acts and who judges.
#[derive(Debug, Clone)]
pub struct Behaviour {
    /// What they are made of.
    pub config: BehaviourConfig,
    /// Chooses actions.
    pub actor: Actor,
    /// Predicts returns.
    pub critic: Critic,
    /// Follows the critic slowly; without autodiff.
    pub slow: Critic,
}

impl Behaviour {
    /// First weights drawn from `rng`; the slow copy begins as the critic.
    pub fn init(model: &ModelConfig, config: BehaviourConfig, rng: &mut impl Rng, device: &Device) -> Self {
        let actor = Actor::init(model, config, rng, device);
        let critic = Critic::init(model, config, rng, device);
        Self { config, actor, slow: critic.clone(), critic }
    }

    /// Writes all three to a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        save_described(path, &self.parameters(), ("config", &self.config))
    }

    fn parameters(&self) -> HostTensors {
        let mut tensors = read_parameters(&self.actor, "actor");
        tensors.extend(read_parameters(&self.critic, "critic"));
        tensors.extend(read_parameters(&self.slow, "slow_critic"));
        tensors
    }

    /// Reads the file of a model's actor and critic.
    ///
    /// # Errors
    /// The file is missing or damaged, or belongs to a model of other sizes.
    pub fn load(path: &Path, model: &ModelConfig, device: &Device) -> Result<Self, ModelError> {
        let (tensors, config): (_, BehaviourConfig) = load_described(path, "config")?;
        // The first values are overwritten, so any generator does.
        let first = Self::init(model, config, &mut rand_chacha::ChaCha8Rng::seed_from_u64(0), device);
        Ok(Self {
            config,
            actor: write_parameters(first.actor, "actor", &tensors)?,
            critic: write_parameters(first.critic, "critic", &tensors)?,
            slow: write_parameters(first.slow, "slow_critic", &tensors)?,
        })
    }

    /// The first weight that is no finite number, if there is one.
    pub fn first_not_finite(&self) -> Option<f32> {
        let tensors = self.parameters();
        tensors.values().flat_map(|tensor| &tensor.values).copied().find(|weight| !weight.is_finite())
    }

    /// Actor and critic as modules in training; the slow copy stays without autodiff.
    #[must_use]
    pub fn train(self) -> Self {
        Self { config: self.config, actor: self.actor.train(), critic: self.critic.train(), slow: self.slow }
    }
}

impl Described for BehaviourConfig {
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_> {
        // The other sides are the model's, which is there already.
        Box::new(std::iter::once(("actor.mlp.second.weight".to_owned(), vec![self.hidden; 2])))
    }
}
