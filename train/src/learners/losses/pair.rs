//! The one loss of all bisimulation metrics: distances between rows should equal target distances, which carry no gradient. In: both. Out: the mean penalty.

use burn::tensor::Tensor;

/// What the difference between a distance and its target costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Penalty {
    /// Its square.
    Squared,
    /// [`huber`]
    Huber,
}

/// Mean penalty over all pairs (and dimensions, where distances have them): `[1]`.
pub fn pair_loss<const D: usize>(distance: Tensor<D>, target: Tensor<D>, penalty: Penalty) -> Tensor<1> {
    let error = distance - target.detach();
    let penalties = match penalty {
        Penalty::Squared => error.square(),
        Penalty::Huber => huber(error),
    };
    let count = penalties.shape().num_elements() as f32;
    // Row by row: of millions of numbers at once the sum would depend on the number of threads.
    let sum = (0..D).rev().fold(penalties, |sums, dim| sums.sum_dim(dim));
    sum.reshape([1_usize]) / count
}

/// Half the square of an error up to 1, linear beyond ("smooth L1").
pub fn huber<const D: usize>(error: Tensor<D>) -> Tensor<D> {
    let size = error.abs();
    let inner = size.clone().clamp_max(1.0);
    inner.clone() * (size - inner * 0.5)
}

/// `|r_i − r_j|` of all pairs.
///
/// # Shapes
/// - `rewards`: `[rows]`
/// - output: `[rows, rows]`
pub fn reward_distances(rewards: &Tensor<1>) -> Tensor<2> {
    let column = rewards.clone().unsqueeze_dim::<2>(1);
    (column.clone() - column.transpose()).abs()
}

/// `x_i · y_j` and the lengths of both, for all pairs; `[rows, rows]`, `[rows, 1]`, `[1, rows]`.
pub(super) fn products(x: &Tensor<2>, y: &Tensor<2>) -> (Tensor<2>, Tensor<2>, Tensor<2>) {
    let squares = |x: &Tensor<2>| x.clone().square().sum_dim(1);
    (x.clone().matmul(y.clone().transpose()), squares(x), squares(y).transpose())
}
