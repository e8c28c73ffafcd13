//! The objective of the paper: the dynamics must predict the next latent as well as an adversary that sees the whole history.
//!
//! ```text
//! L = 1/(T B) Σ_t [ Σ_i min( Σ_b log p_θ(s_t,b^i | h_t−1, s_t−1, a_t−1) − log p_ψ(s_t,b^i | s_<t, o_<t, a_<t), 0 ) + Σ_b log p_θ(r_t,b | s_t,b, a_t,b) ]
//! ```

use burn::tensor::Tensor;
use vibes_model::gaussian::Gaussian;

use super::{Predictions, Value};

/// The value of the objective; `adversary` predicts the same latents as the dynamics, with ψ held fixed by the caller but the latents not
/// detached, so that gradients reach the encoder through them.
pub fn value(predictions: &Predictions, adversary: &Gaussian, reward_weight: f32) -> Value {
    let dynamics = predictions.latent_log_prob(&predictions.dynamics);
    let ratio = log_ratio(dynamics.clone(), predictions.latent_log_prob(adversary));
    let reward = predictions.reward_log_prob();
    let clipped = ratio.clone().greater_scalar(0.0).float().mean();
    let objective = ratio.clamp_max(0.0).sum() + reward.clone() * reward_weight;
    let count = predictions.count;
    Value {
        objective: objective / count,
        dynamics: dynamics.sum() / count,
        reward: reward / count,
        clipped: Some(clipped),
        reconstruction: None,
    }
}

/// The log-ratio per step and dimension, summed over the batch before it is clipped (Algorithm 1, line 13).
///
/// # Shapes
/// - `dynamics`, `adversary`: log-densities `[steps, batch, latent]`
/// - output: `[steps, latent]`
pub fn log_ratio(dynamics: Tensor<3>, adversary: Tensor<3>) -> Tensor<2> {
    (dynamics - adversary).sum_dim(1).squeeze_dim(1)
}
