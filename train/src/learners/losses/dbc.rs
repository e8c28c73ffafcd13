//! Deep bisimulation for control (`facebookresearch/deep_bisim4control`): each dimension of two latents should differ as much as the rewards and the predicted next
//! latents do.
//!
//! ```text
//! d_ij = h(z_i − z_j)      target_ij = h(r_i − r_j) + γ W₂(N(μ_i, σ_i), N(μ_j, σ_j))      loss = ½ mean (d − target)²      h: Huber
//! ```

use burn::tensor::{Int, Tensor};

use super::pair::{Penalty, huber, pair_loss};

/// A model's Gaussian of the next latent.
#[derive(Debug, Clone)]
pub struct NextLatent {
    /// `[rows, dims]`
    pub mean: Tensor<2>,
    /// `[rows, dims]`
    pub std: Tensor<2>,
}

/// The target distance of row i and row `partners[i]`, per dimension: `[rows, dims]`.
pub fn target(rewards: &Tensor<1>, next: &NextLatent, partners: &Tensor<1, Int>, discount: f32) -> Tensor<2> {
    let rewards = rewards.clone().unsqueeze_dim::<2>(1);
    let reward = huber(difference(rewards, partners));
    let mean = difference(next.mean.clone(), partners).square();
    let std = difference(next.std.clone(), partners).square();
    reward + (mean + std).sqrt() * discount
}

/// The loss, with its weight of one half.
///
/// # Shapes
/// - `latents`: `[rows, dims]`, `rewards`: `[rows]`
/// - `partners`: `[rows]`, a permutation of the rows
pub fn loss(
    latents: Tensor<2>,
    rewards: &Tensor<1>,
    next: &NextLatent,
    partners: &Tensor<1, Int>,
    discount: f32,
) -> Tensor<1> {
    let distance = huber(difference(latents, partners));
    pair_loss(distance, target(rewards, next, partners, discount), Penalty::Squared) * 0.5
}

fn difference(x: Tensor<2>, partners: &Tensor<1, Int>) -> Tensor<2> {
    x.clone() - x.select(0, partners.clone())
}
