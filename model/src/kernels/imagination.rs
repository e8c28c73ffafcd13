//! Acting in the learned dynamics for some steps, as one operation: actor, reward model, GRU and the head of the next latent, step after step, on rows that know
//! nothing of each other.
//!
//! In: weights, states, noise. Out: what actor and critic see at every row, rewards, and the actor's outputs. Differentiable in the actor's weights alone: the
//! world's are constants, and the actor's own input is cut off (see [`imagine`](crate::imagine)).

use burn::tensor::Tensor;

use super::LayerWeights;
use super::instructions::Instructions;
use crate::actions::ActionDistribution;

mod backward;
mod forward;
mod operation;

/// The world's weights, without autodiff.
#[derive(Debug, Clone)]
pub struct WorldWeights {
    /// The reward model's perceptron: (latent, action) to (mean, spread).
    pub reward: [LayerWeights; 3],
    /// One unit of the reward model's output, in units of reward.
    pub reward_scale: f32,
    /// The dynamics' GRU: input `[latent + A, 3·hidden]` and hidden `[hidden, 3·hidden]`.
    pub gru: [LayerWeights; 2],
    /// The dynamics' head: hidden state to (mean before it is normalised, spread).
    pub head: [LayerWeights; 3],
    /// Least standard deviation of the next latent.
    pub floor: f32,
}

/// The actor's weights.
#[derive(Debug, Clone)]
pub struct ActorWeights {
    /// Its perceptron: (state, latent) to `2A`.
    pub layers: [LayerWeights; 3],
    /// What its output stands for.
    pub distribution: ActionDistribution,
}

/// What is imagined from.
#[derive(Debug, Clone)]
pub struct Beginning {
    /// `[rows, hidden]`
    pub states: Tensor<2>,
    /// `[rows, latent]`
    pub latents: Tensor<2>,
    /// `[horizon, rows, A]`
    pub action_noise: Tensor<3>,
    /// `[horizon, rows, latent]`
    pub latent_noise: Tensor<3>,
}

#[cfg(test)]
impl Beginning {
    /// Rows of a lane: tests begin with more of them.
    pub(crate) const LANE: usize = forward::ROWS;
}

/// What was imagined.
#[derive(Debug, Clone)]
pub struct Imagined {
    /// `[horizon + 1, rows, hidden + latent]`
    pub features: Tensor<3>,
    /// `[horizon, rows]`
    pub rewards: Tensor<2>,
    /// The actor's outputs: `[horizon, rows, 2A]`
    pub outputs: Tensor<3>,
}

/// Imagines, or gives nothing where the custom path does not apply: on another device than `flex`, or in another precision than float32.
pub fn imagination(world: &WorldWeights, actor: &ActorWeights, beginning: Beginning) -> Option<Imagined> {
    operation::imagination(world, actor, beginning, Instructions::best())
}

#[cfg(test)]
mod tests;
