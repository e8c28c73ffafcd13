//! `SimSR` (bit1029public/SimSR): the cosine distance of two latents should be that of their rewards and of their sampled successors.
//!
//! ```text
//! d_ij = 1 − cos(z_i, z_j)      target_ij = |r_i − r_j| + γ (1 − cos(z′_i, z′_j))      loss = mean Huber(d − target)
//! ```

use burn::tensor::Tensor;

use super::pair::{Penalty, pair_loss, products, reward_distances};

/// `1 − cos` of all pairs: `[rows, rows]`.
///
/// # Shapes
/// - `z`: `[rows, dims]`
pub fn distance(z: &Tensor<2>) -> Tensor<2> {
    let (dot, rows, columns) = products(z, z);
    (dot / (rows.sqrt() * columns.sqrt())).neg() + 1.0
}

/// The loss over all pairs.
///
/// # Shapes
/// - `z`: `[rows, dims]`; `next`: `[rows, dims]`, samples of the successors by the model
/// - `rewards`: `[rows]`
pub fn loss(z: &Tensor<2>, next: Tensor<2>, rewards: &Tensor<1>, discount: f32) -> Tensor<1> {
    let target = reward_distances(rewards) + distance(&next.detach()) * discount;
    pair_loss(distance(z), target, Penalty::Huber)
}
