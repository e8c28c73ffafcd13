//! The critic `v(h_k, s_k)`: a perceptron whose output stands for a distribution of returns. Its slow copy follows it.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::config::{BehaviourConfig, ModelConfig};
use crate::linear::Linear;
use crate::mlp::{Mlp, MlpConfig};
use crate::values::ValueDistribution;

/// (state, latent) to a distribution of returns.
#[derive(Module, Debug)]
pub struct Critic {
    /// `[hidden + latent]` to the distribution's output
    pub mlp: Mlp,
    #[module(skip)]
    distribution: ValueDistribution,
}

impl Critic {
    /// He-initialised with a last layer of zeros, so that it begins at exactly 0.
    pub fn init(model: &ModelConfig, config: BehaviourConfig, rng: &mut impl Rng, device: &Device) -> Self {
        let input = model.hidden + model.latent;
        let mlp = MlpConfig { input, hidden: config.hidden, output: config.values.width() }.init(rng, device);
        Self { mlp: mlp.last_zeroed(), distribution: config.values }
    }

    /// Which distribution its output stands for.
    pub fn distribution(&self) -> ValueDistribution {
        self.distribution
    }

    /// Values of rows: `[rows, hidden + latent]` to `[rows]`.
    pub fn values(&self, features: Tensor<2>) -> Tensor<1> {
        self.distribution.value(self.mlp.forward(features))
    }

    /// This critic moved the share `rate` of the way towards `goal`; neither is followed by autodiff.
    pub fn towards(self, goal: &Self, rate: f32) -> Self {
        let Mlp { first, second, last } = self.mlp;
        let mlp = Mlp {
            first: moved(first, &goal.mlp.first, rate),
            second: moved(second, &goal.mlp.second, rate),
            last: moved(last, &goal.mlp.last, rate),
        };
        Self { mlp, distribution: self.distribution }
    }
}

fn moved(layer: Linear, goal: &Linear, rate: f32) -> Linear {
    fn between<const D: usize>(from: Param<Tensor<D>>, to: &Param<Tensor<D>>, rate: f32) -> Param<Tensor<D>> {
        let to = to.val().inner();
        from.map(|from| {
            let from = from.inner();
            from.clone() + (to - from) * rate
        })
    }
    Linear { weight: between(layer.weight, &goal.weight, rate), bias: between(layer.bias, &goal.bias, rate) }
}

#[cfg(test)]
mod tests;
