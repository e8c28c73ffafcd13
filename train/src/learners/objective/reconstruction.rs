//! The ablation "Recon.": the latent must explain the whole observation, as in Dreamer. The encoder's entropy is constant, because its variance is, and left
//! out as in the paper.
//!
//! ```text
//! L = 1/(T B) Σ_t Σ_b [ log p_θ(o_t | s_t) + log p_θ(r_t | s_t, a_t) + log p_θ(s_t | h_t−1, s_t−1, a_t−1) ]
//! ```

use burn::tensor::Tensor;

use super::{Predictions, Value, no_adversary};

/// The value of the objective; `observations` is the log-density of each row's observation, `[length, batch]`.
pub fn value(predictions: &Predictions, observations: Tensor<2>, reward_weight: f32) -> Value {
    let counted = predictions.counted.clone().squeeze_dim::<2>(2);
    let reconstruction = (observations * counted).sum() / predictions.count;
    let rest = no_adversary::value(predictions, reward_weight);
    Value { objective: rest.objective + reconstruction.clone(), reconstruction: Some(reconstruction), ..rest }
}
