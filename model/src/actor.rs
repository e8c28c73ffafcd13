//! The actor `π(a_k | h_k, s_k)`: a perceptron over the dynamics' state and the latent. The state is the one *before* the action is consumed; the encoder's
//! state, which needs pictures to advance, is never seen.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::actions::{ActionDistribution, Actions};
use crate::config::{BehaviourConfig, ModelConfig};
use crate::mlp::{Mlp, MlpConfig};

/// (state, latent) to a distribution of actions.
#[derive(Module, Debug)]
pub struct Actor {
    /// `[hidden + latent]` to `[2A]`
    pub mlp: Mlp,
    #[module(skip)]
    distribution: ActionDistribution,
}

impl Actor {
    /// He-initialised, with a last layer a hundredth of that size: the first actions are drawn around the middle, whatever is seen.
    pub fn init(model: &ModelConfig, config: BehaviourConfig, rng: &mut impl Rng, device: &Device) -> Self {
        let input = model.hidden + model.latent;
        let mlp = MlpConfig { input, hidden: config.hidden, output: 2 * model.actions() }.init(rng, device);
        Self { mlp: mlp.last_scaled(0.01), distribution: config.actions }
    }

    /// Which distribution its output stands for.
    pub fn distribution(&self) -> ActionDistribution {
        self.distribution
    }

    /// # Shapes
    /// - `features`: `[…, hidden + latent]`, see [`features`]
    pub fn forward<const D: usize>(&self, features: Tensor<D>) -> Actions<D> {
        self.distribution.of(self.mlp.forward(features))
    }
}

/// What actor and critic see: `[h, s]` side by side.
///
/// # Shapes
/// - `states`: `[…, hidden]`, the dynamics' state before the action is consumed
/// - `latents`: `[…, latent]`
pub fn features<const D: usize>(states: Tensor<D>, latents: Tensor<D>) -> Tensor<D> {
    Tensor::cat(vec![states, latents], D - 1)
}
