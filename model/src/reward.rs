//! The reward model `p_θ(r_t | s_t, a_t)`: a Gaussian that sees the latent and the action taken there, and never a hidden state.

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::softplus};
use rand::Rng;

use crate::config::ModelConfig;
use crate::gaussian::Gaussian;
use crate::mlp::{Mlp, MlpConfig};

/// Above this softplus and its inverse give back what they are given, to the last digit of single precision; somewhat above 88 an exponential in it overflows.
const STRAIGHT: f32 = 20.0;

/// Latent and action to the reward earned there.
#[derive(Module, Debug)]
pub struct Reward {
    /// (latent, action) to mean and standard deviation.
    pub head: Mlp,
    #[module(skip)]
    floor: f32,
    #[module(skip)]
    scale: f32,
}

impl Reward {
    /// He-initialised head.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Self {
        let head = MlpConfig { input: config.latent + config.actions(), hidden: config.head, output: 2 };
        Self { head: head.init(rng, device), floor: config.reward_floor, scale: config.reward_scale }
    }

    /// The model that predicts the mean and standard deviation of these rewards whatever it sees, and learns from there. Otherwise the first thing
    /// it learns is their mean, and it learns it by pulling all latents to one point.
    pub fn calibrated(self, rewards: &[f32]) -> Self {
        Self { head: self.calibrated_head(self.head.clone(), rewards), ..self }
    }

    /// A perceptron of two outputs that makes the same prediction through [`Reward::gaussian`], whatever it sees.
    pub fn calibrated_head(&self, head: Mlp, rewards: &[f32]) -> Mlp {
        let count = rewards.len().max(1) as f32;
        let mean = rewards.iter().sum::<f32>() / count;
        let std = (rewards.iter().map(|reward| (reward - mean).powi(2)).sum::<f32>() / count).sqrt();
        // The inverse of softplus, where the floor leaves anything to invert.
        let above = ((std - self.floor) / self.scale).max(1e-3);
        let mut head = head.last_zeroed();
        let before_softplus = if above > STRAIGHT { above } else { above.exp_m1().ln() };
        let start = [mean / self.scale, before_softplus];
        head.last.bias = head.last.bias.map(|bias| Tensor::from_data(start, &bias.device()));
        head
    }

    /// One unit of the head's output, in units of reward.
    pub(crate) fn scale(&self) -> f32 {
        self.scale
    }

    /// # Shapes
    /// - `latents`: `[length, batch, latent]`, `actions`: `[length, batch, A]`
    /// - output: mean and standard deviation, both `[length, batch, 1]`, in units of reward
    pub fn forward(&self, latents: Tensor<3>, actions: Tensor<3>) -> Gaussian {
        let output = self.head.forward(Tensor::cat(vec![latents, actions], 2));
        self.gaussian(output)
    }

    /// A network's two outputs as mean and standard deviation, with this model's unit and floor.
    ///
    /// # Shapes
    /// - `output`: `[length, batch, 2]`
    pub fn gaussian(&self, output: Tensor<3>) -> Gaussian {
        let std = softplus(output.clone().narrow(2, 1, 1), 1.0) * self.scale + self.floor;
        Gaussian { mean: output.narrow(2, 0, 1) * self.scale, std }
    }
}
