//! SAR's head: it expects the characteristic function of the next actions, `E e^{i ω·g(a_t, …, a_t+K−1)}`, from the features and the next rewards, at frequencies drawn from a
//! distribution that is learned. In: features, rewards, actions, noise. Out: what several heads expect of its cosine and sine, and what these are.
//!
//! From DMU-XMU/SAR (`module/rl_module.py`: `CFAPredictor`). The heads are the last layer of one perceptron, whose activations are `x σ(x)`.

use burn::module::{Module, Param};
use burn::tensor::activation::silu;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use super::config::SacConfig;
use super::features::{orthogonal_linear, orthogonal_mlp};
use crate::init::constant;
use crate::linear::Linear;
use crate::mlp::Mlp;

/// Heads of the predictor.
pub const HEADS: usize = 7;
/// The logarithm of the frequencies' standard deviation is −6 + 8 tanh(p).
const LOG_STD: [f32; 2] = [-6.0, 8.0];
/// Its first p: a standard deviation of 1.
const FIRST_SPREAD: f32 = 0.972_955_1;

/// The head and what it looks at; K is the number of steps.
#[derive(Module, Debug)]
pub struct Characteristic {
    /// g, of the next K actions: `[K·A]` to `[K]`
    pub actions: Linear,
    /// Of the next K rewards: `[K]` to `[K]`
    pub rewards: Linear,
    /// Of a frequency: `[K]` to `[K]`
    pub frequency: Linear,
    /// (features, rewards, frequency) to cosines and sines: `[feature + 2·K]` to `[2·heads]`
    pub predictor: Mlp,
    /// Mean of the frequencies: `[K]`
    pub center: Param<Tensor<1>>,
    /// What their standard deviation is made of: `[K]`
    pub spread: Param<Tensor<1>>,
}

/// Cosines and sines, as what is expected of them or as they are.
#[derive(Debug, Clone)]
pub struct Waves<const D: usize> {
    /// Times π/2 where they are the actions' own.
    pub cosines: Tensor<D>,
    /// The same of the sines.
    pub sines: Tensor<D>,
}

impl Characteristic {
    /// Orthogonal weights; frequencies from a standard normal distribution.
    pub fn init(config: &SacConfig, steps: usize, rng: &mut impl Rng, device: &Device) -> Self {
        Self {
            actions: orthogonal_linear([steps * config.actions(), steps], rng, device),
            rewards: orthogonal_linear([steps, steps], rng, device),
            frequency: orthogonal_linear([steps, steps], rng, device),
            predictor: orthogonal_mlp([config.feature + 2 * steps, config.hidden, 2 * HEADS], rng, device),
            center: constant([steps], 0.0, device),
            spread: constant([steps], FIRST_SPREAD, device),
        }
    }

    /// Frequencies of standard normal noise: `[samples, K]` both.
    pub fn frequencies(&self, noise: Tensor<2>) -> Tensor<2> {
        let [low, width] = LOG_STD;
        let std = (self.spread.val().tanh() * width + low).exp();
        self.center.val().unsqueeze::<2>() + noise * std.unsqueeze::<2>()
    }

    /// π/2 times cosine and sine of `ω·g(a)`; gradients flow to g and to the frequencies, which are learned with the heads.
    ///
    /// # Shapes
    /// - `frequencies`: `[samples, K]`; `actions`: `[rows, K·A]`
    /// - output: `[samples, rows]` each
    pub fn own(&self, frequencies: Tensor<2>, actions: Tensor<2>) -> Waves<2> {
        let phase = frequencies.matmul(self.actions.forward(actions).transpose());
        let half = std::f32::consts::FRAC_PI_2;
        Waves { cosines: phase.clone().cos() * half, sines: phase.sin() * half }
    }

    /// What the heads expect.
    ///
    /// # Shapes
    /// - `features`: `[rows, feature]`; `rewards`: `[rows, K]`, discounted; `frequencies`: `[samples, K]`
    /// - output: `[samples, rows, heads]` each
    pub fn expected(&self, features: Tensor<2>, rewards: Tensor<2>, frequencies: Tensor<2>) -> Waves<3> {
        let ([rows, feature], [samples, steps]) = (features.dims(), frequencies.dims());
        let Mlp { first, second, last } = &self.predictor;
        // The first layer of rows and of frequencies apart: each is the same for all of the other.
        let [of_row, of_frequency] = [(0, feature + steps), (feature + steps, steps)]
            .map(|(from, count)| first.weight.val().narrow(0, from, count));
        let by_row = Tensor::cat(vec![features, self.rewards.forward(rewards)], 1).matmul(of_row);
        let by_frequency = self.frequency.forward(frequencies).matmul(of_frequency) + first.bias.val().unsqueeze::<2>();
        let x = silu(by_row.unsqueeze_dim::<3>(0) + by_frequency.unsqueeze_dim::<3>(1));
        let width = x.dims()[2];
        let x = silu(second.forward(x.reshape([samples * rows, width])));
        let waves = last.forward(x);
        let heads = waves.dims()[1] / 2;
        let waves = waves.reshape([samples, rows, 2 * heads]);
        Waves { cosines: waves.clone().narrow(2, 0, heads), sines: waves.narrow(2, heads, heads) }
    }
}
