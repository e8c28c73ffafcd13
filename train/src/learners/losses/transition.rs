//! `DeepMDP`'s losses, which DBC and `SimSR` share: the next latent and the reward are predicted. In: latents, a Gaussian of the next latent with a standard deviation
//! per dimension, rewards. Out: the mean negative log-likelihood up to a constant, and the mean squared error.

use burn::tensor::Tensor;

use super::dbc::NextLatent;

/// `½ ((z′ − μ)/σ)² + ln σ`, mean over rows and dimensions; no gradient to the target z′.
///
/// # Shapes
/// - `next`: `[rows, dims]`
pub fn latent(prediction: &NextLatent, next: Tensor<2>) -> Tensor<1> {
    let distance = (next.detach() - prediction.mean.clone()) / prediction.std.clone();
    (distance.square() * 0.5 + prediction.std.clone().log()).mean()
}

/// Mean squared error of the rewards.
///
/// # Shapes
/// - `predictions`, `rewards`: `[rows]`
pub fn reward(predictions: Tensor<1>, rewards: Tensor<1>) -> Tensor<1> {
    (predictions - rewards).square().mean()
}
