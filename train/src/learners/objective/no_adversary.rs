//! The ablation "No Adv.": the dynamics' log-likelihood stands alone, without an adversary to compare it with and so without clipping. No adversary is
//! built or run for it.
//!
//! ```text
//! L = 1/(T B) Σ_t Σ_b [ log p_θ(s_t | h_t−1, s_t−1, a_t−1) + log p_θ(r_t | s_t, a_t) ]
//! ```

use super::{Predictions, Value};

/// The value of the objective.
pub fn value(predictions: &Predictions, reward_weight: f32) -> Value {
    let dynamics = predictions.latent_log_prob(&predictions.dynamics).sum();
    let reward = predictions.reward_log_prob();
    let count = predictions.count;
    Value {
        objective: (dynamics.clone() + reward.clone() * reward_weight) / count,
        dynamics: dynamics / count,
        reward: reward / count,
        clipped: None,
        reconstruction: None,
    }
}
