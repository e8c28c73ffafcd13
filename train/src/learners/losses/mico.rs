//! The `MICo` distance (google-research/google-research, mico): a distance of a row to itself is not 0, so the norms of the latents carry information.
//!
//! ```text
//! U(x, y) = ½ (|x|² + |y|²) + 0.1 angle(x, y)      target_ij = |r_i − r_j| + γ U(x′_i, x′_j)      loss = mean Huber(U(x_i, y_j) − target_ij)
//! ```
//!
//! x comes from the encoder in training; y and x′ from its slow copy, without gradient.

use burn::tensor::Tensor;

use super::pair::{Penalty, pair_loss, products, reward_distances};

/// Weight of the angle.
const ANGLE: f32 = 0.1;

/// `U(x_i, y_j)` of all pairs: `[rows, rows]`.
///
/// # Shapes
/// - `x`, `y`: `[rows, dims]`
pub fn distance(x: &Tensor<2>, y: &Tensor<2>) -> Tensor<2> {
    let (dot, x_squares, y_squares) = products(x, y);
    let cosine = dot / (x_squares.clone().sqrt() * y_squares.clone().sqrt() + 1e-9);
    // Guarded at 0: the root has no gradient there.
    let sine = (cosine.clone().square().neg() + 1.0).clamp_min(0.0).add_scalar(1e-12).sqrt();
    (x_squares + y_squares) * 0.5 + sine.atan2(cosine) * ANGLE
}

/// The loss over all pairs.
///
/// # Shapes
/// - `x`: `[rows, dims]`, with gradient; `slow`, `slow_next`: `[rows, dims]`, the same rows and their successors by the slow copy
/// - `rewards`: `[rows]`
pub fn loss(x: &Tensor<2>, slow: Tensor<2>, slow_next: Tensor<2>, rewards: &Tensor<1>, discount: f32) -> Tensor<1> {
    let (slow, next) = (slow.detach(), slow_next.detach());
    let target = reward_distances(rewards) + distance(&next, &next) * discount;
    pair_loss(distance(x, &slow), target, Penalty::Huber)
}
