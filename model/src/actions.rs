//! The two distributions of actions between −1 and 1 that are in use, from a network's output. In: the output, noise. Out: samples through which gradients
//! flow, their log-density and entropy.

use burn::tensor::activation::{sigmoid, softplus};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::gaussian::log_prob;
use crate::parameters::to_values;

/// Softplus of this is 5: the first standard deviation of a [`ActionDistribution::TanhNormal`], Dreamer's.
pub(crate) const RAW_FIVE: f32 = 4.993_239;
const LOG_TWO: f32 = std::f32::consts::LN_2;
/// Entropy of a standard normal number, nats.
const UNIT_ENTROPY: f32 = 1.418_938_5;

/// How a network's output `[…, 2A]` (first halves of means, then of spreads) becomes a distribution of `A` numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActionDistribution {
    /// `DreamerV3`'s: a normal with mean `tanh(m)` and standard deviation `0.9 σ(v + 2) + 0.1`, whose samples are cut to −1..1. Its entropy has a closed form.
    BoundedNormal,
    /// Dreamer's and `RePo`'s: `tanh(x)` of a normal `x` with mean `5 tanh(m / 5)` and standard deviation `softplus(v + 4.99) + 0.1`, which begins at 5.1.
    TanhNormal,
}

/// Which action of the actor's distribution is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The mean's: for evaluation.
    Mode,
    /// A drawn one: for exploration.
    Sample,
}

/// Distributions of actions, one a row.
#[derive(Debug, Clone)]
pub struct Actions<const D: usize> {
    kind: ActionDistribution,
    /// Means of the normal: `[…, A]`
    pub mean: Tensor<D>,
    /// Standard deviations of the normal: `[…, A]`
    pub std: Tensor<D>,
}

/// A sample of actions.
#[derive(Debug, Clone)]
pub struct ActionSample<const D: usize> {
    /// The sample of the normal, before it is cut or squashed: `[…, A]`. Kept, so that no inverse of tanh is ever needed.
    pub normal: Tensor<D>,
    /// The action: `[…, A]`, within −1..1
    pub action: Tensor<D>,
}

impl ActionDistribution {
    /// The distributions that a network's output stands for.
    ///
    /// # Shapes
    /// - `output`: `[…, 2A]`
    pub fn of<const D: usize>(self, output: Tensor<D>) -> Actions<D> {
        let width = output.dims()[D - 1] / 2;
        let (mean, spread) = (output.clone().narrow(D - 1, 0, width), output.narrow(D - 1, width, width));
        let (mean, std) = match self {
            Self::BoundedNormal => (mean.tanh(), sigmoid(spread + 2.0) * 0.9 + 0.1),
            Self::TanhNormal => ((mean / 5.0).tanh() * 5.0, softplus(spread + RAW_FIVE, 1.0) + 0.1),
        };
        Actions { kind: self, mean, std }
    }
}

impl<const D: usize> Actions<D> {
    /// The distribution of this mean and standard deviation.
    pub fn new(kind: ActionDistribution, mean: Tensor<D>, std: Tensor<D>) -> Self {
        Self { kind, mean, std }
    }

    /// The action of the mean: what is done when nothing is to be explored.
    pub fn mode(&self) -> Tensor<D> {
        match self.kind {
            ActionDistribution::BoundedNormal => self.mean.clone(),
            ActionDistribution::TanhNormal => self.mean.clone().tanh(),
        }
    }

    /// The action that standard normal `noise` `[…, A]` draws. Gradients flow to mean and standard deviation, through the cut as if it were not there.
    pub fn sample(&self, noise: Tensor<D>) -> ActionSample<D> {
        let normal = self.mean.clone() + self.std.clone() * noise;
        let action = match self.kind {
            ActionDistribution::BoundedNormal => {
                let cut = normal.clone().clamp(-1.0, 1.0);
                normal.clone() + (cut - normal.clone()).detach()
            }
            ActionDistribution::TanhNormal => normal.clone().tanh(),
        };
        ActionSample { normal, action }
    }

    /// The actions that are chosen, between −1 and 1, one row after the other: `[… · A]`. Only a drawn one takes numbers from `rng`.
    pub fn chosen(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        to_values(match choice {
            Choice::Mode => self.mode(),
            Choice::Sample => self.sample(noise(self.mean.dims(), rng, &self.mean.device())).action,
        })
    }

    /// Log-density of the action that came of `normal` (see [`ActionSample::normal`]), summed over dimensions: `[…, 1]`. Of a cut action it is the density
    /// before the cut.
    pub fn log_prob(&self, normal: Tensor<D>) -> Tensor<D> {
        let density = log_prob(normal.clone(), self.mean.clone(), self.std.clone());
        let density = match self.kind {
            ActionDistribution::BoundedNormal => density,
            ActionDistribution::TanhNormal => density - log_slope(normal),
        };
        density.sum_dim(D - 1)
    }

    /// Entropy in nats, summed over dimensions: `[…, 1]`. Of a tanh-normal, whose entropy has no closed form, it is the estimate of one sample, which must
    /// have been drawn from this distribution.
    pub fn entropy(&self, sample: &ActionSample<D>) -> Tensor<D> {
        match self.kind {
            ActionDistribution::BoundedNormal => (self.std.clone().log() + UNIT_ENTROPY).sum_dim(D - 1),
            ActionDistribution::TanhNormal => self.log_prob(sample.normal.clone()).neg(),
        }
    }
}

/// `ln(1 − tanh²(x)) = 2 (ln 2 − x − softplus(−2x))`, finite where the slope itself is rounded to zero.
fn log_slope<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    let tail = softplus(x.clone() * -2.0, 1.0);
    (x + tail - LOG_TWO) * -2.0
}

/// Standard normal numbers from a generator: `[…]`.
pub fn noise<const D: usize>(shape: [usize; D], rng: &mut impl Rng, device: &Device) -> Tensor<D> {
    let values = crate::init::normal(shape.iter().product(), rng);
    Tensor::from_data(burn::tensor::TensorData::new(values, shape), device)
}

#[cfg(test)]
mod tests;
