//! The actor: a trunk of its own on the critic's convolutions, and a perceptron whose output stands for a tanh-squashed normal distribution of actions.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use super::config::SacConfig;
use super::features::{Trunk, orthogonal_mlp, relu_forward};
use crate::actions::{ActionDistribution, Actions};
use crate::error::ModelError;
use crate::mlp::Mlp;

/// Upper bound of the standard deviation's logarithm, which tanh maps between the configured lower one and this.
pub(super) const LOG_STD_MAX: f32 = 2.0;

/// Maps of the critic's convolutions to a distribution of actions.
#[derive(Module, Debug)]
pub struct SoftActor {
    /// From maps to features.
    pub trunk: Trunk,
    /// From features to mean and standard deviation: `[feature]` to `[2A]`
    pub mlp: Mlp,
    #[module(skip)]
    log_std_min: f32,
}

impl SoftActor {
    /// Orthogonal weights.
    ///
    /// # Errors
    /// The pictures are too small.
    pub fn init(config: &SacConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        let sizes = [config.feature, config.hidden, 2 * config.actions()];
        let (trunk, mlp) = (Trunk::init(config, rng, device)?, orthogonal_mlp(sizes, rng, device));
        Ok(Self { trunk, mlp, log_std_min: config.log_std_min })
    }

    /// The distribution of actions.
    ///
    /// # Shapes
    /// - `maps`: `[rows, maps]`, of the critic's convolutions, without gradient
    pub fn forward(&self, maps: Tensor<2>) -> Actions<2> {
        self.of_features(self.trunk.forward(maps))
    }

    /// The same from features that something else made: `[rows, feature]`.
    pub fn of_features(&self, features: Tensor<2>) -> Actions<2> {
        let output = relu_forward(&self.mlp, features);
        let width = output.dims()[1] / 2;
        let [low, high] = [self.log_std_min, LOG_STD_MAX];
        let log_std = (output.clone().narrow(1, width, width).tanh() + 1.0) * ((high - low) / 2.0) + low;
        Actions::new(ActionDistribution::TanhNormal, output.narrow(1, 0, width), log_std.exp())
    }
}
