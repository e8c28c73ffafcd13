//! The objective `L` that the world model is trained to maximise (equation 1, Algorithm 1 lines 11–15), and the adversary's `J` (line 17). In:
//! latents, predictions and rewards of a window. Out: one number to maximise, and the log-likelihoods it is made of. The three objectives share the reward
//! term and everything before it; each has its own file for what stands beside the reward.

use std::fmt;
use std::str::FromStr;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use vibes_model::gaussian::Gaussian;

use crate::error::TrainError;

pub mod no_adversary;
pub mod reconstruction;
pub mod vibes;

/// Which objective the world model is trained with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// Dynamics against the adversary, and reward: the paper's equation 1.
    Vibes,
    /// Dynamics and reward alone: the ablation "No Adv.".
    NoAdversary,
    /// Observation, dynamics and reward: the ablation "Recon.".
    Reconstruction,
}

impl Objective {
    /// Every objective.
    pub const ALL: [Self; 3] = [Self::Vibes, Self::NoAdversary, Self::Reconstruction];

    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vibes => "vibes",
            Self::NoAdversary => "no-adversary",
            Self::Reconstruction => "reconstruction",
        }
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Objective {
    type Err = TrainError;

    fn from_str(text: &str) -> Result<Self, TrainError> {
        Self::ALL.into_iter().find(|objective| objective.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            TrainError::Options(format!("no objective `{text}`; there are {names}"))
        })
    }
}

/// The same latents, through which only a share of the gradient passes to the encoder. The dynamics term is computed on these, so that the dynamics
/// model learns at its full rate from the first update on while the encoder gives way to it as much as `weight` says (the idea of KL balancing).
pub fn hear(latents: &Tensor<3>, weight: f32) -> Tensor<3> {
    if weight == 1.0 {
        return latents.clone();
    }
    latents.clone() * weight + latents.clone().detach() * (1.0 - weight)
}

/// A window as the objective sees it.
#[derive(Debug, Clone)]
pub struct Predictions {
    /// Sampled latents, as the dynamics term [hears](hear) them: `[length, batch, latent]`
    pub latents: Tensor<3>,
    /// The dynamics' prediction of the latents `1..length`: `[length − 1, batch, …]`
    pub dynamics: Gaussian,
    /// The prediction of the rewards: `[length, batch, 1]`
    pub reward: Gaussian,
    /// `[length, batch, 1]`
    pub rewards: Tensor<3>,
    /// 1 where a row counts, 0 where it only warms up the hidden states: `[length, batch, 1]`
    pub counted: Tensor<3>,
    /// Number of rows that count, the paper's `T·B`.
    pub count: f32,
}

/// The value of an objective and what it is made of.
#[derive(Debug, Clone)]
pub struct Value {
    /// To be maximised: `[1]`
    pub objective: Tensor<1>,
    /// Log-likelihood of the latents under the dynamics, nats a row: `[1]`
    pub dynamics: Tensor<1>,
    /// Log-likelihood of the rewards, nats a row: `[1]`
    pub reward: Tensor<1>,
    /// Share of the (step, dimension) pairs whose log-ratio was cut to zero: `[1]`
    pub clipped: Option<Tensor<1>>,
    /// Log-likelihood of the observations, nats a row, up to a constant: `[1]`
    pub reconstruction: Option<Tensor<1>>,
}

impl Predictions {
    /// Log-density of the latents `1..length`, zero in rows that do not count.
    ///
    /// # Shapes
    /// - output: `[length − 1, batch, latent]`
    pub fn latent_log_prob(&self, prediction: &Gaussian) -> Tensor<3> {
        let length = self.latents.dims()[0];
        let next = self.latents.clone().narrow(0, 1, length - 1);
        prediction.log_prob(next) * self.counted.clone().narrow(0, 1, length - 1)
    }

    /// Sum over the rows that count of `log p(r_t | s_t, a_t)`: `[1]`
    pub fn reward_log_prob(&self) -> Tensor<1> {
        (self.reward.log_prob(self.rewards.clone()) * self.counted.clone()).sum()
    }
}

/// The adversary's objective `J_ψ`: the mean log-likelihood of the latents under its prediction, nats a row (Algorithm 1, line 17).
pub fn adversary_objective(log_prob: Tensor<3>, count: f32) -> Tensor<1> {
    log_prob.sum() / count
}

#[cfg(test)]
mod tests;
