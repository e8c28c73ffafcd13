//! Contrastive losses: each row should be recognised among all others by its own partner. In: two sets of rows in the same order. Out: cross entropies with the
//! diagonal as label.

use burn::tensor::Tensor;
use burn::tensor::activation::{log_softmax, softplus};

/// The logits `q W kᵀ` of CURL (`MishaLaskin/curl`), each row less its maximum: `[rows, rows]`.
///
/// # Shapes
/// - `queries`: `[rows, dims]`; `keys`: `[rows, dims]`, of the slow encoder; `bilinear`: `[dims, dims]`
pub fn bilinear_logits(queries: Tensor<2>, keys: Tensor<2>, bilinear: Tensor<2>) -> Tensor<2> {
    let logits = queries.matmul(bilinear).matmul(keys.detach().transpose());
    let highest = logits.clone().detach().max_dim(1);
    logits - highest
}

/// CURL's loss: no gradient to the keys.
pub fn bilinear(queries: Tensor<2>, keys: Tensor<2>, bilinear: Tensor<2>) -> Tensor<1> {
    own_partner(bilinear_logits(queries, keys, bilinear))
}

/// The logits `softplus(τ) y xᵀ` of `CoRe` (apple/ml-core): `[rows, rows]`.
pub fn scaled_logits(predictions: Tensor<2>, features: Tensor<2>, temperature: Tensor<1>) -> Tensor<2> {
    predictions.matmul(features.transpose()) * softplus(temperature, 1.0).unsqueeze()
}

/// `CoRe`'s loss: the mean of the cross entropies over rows and over columns.
///
/// # Shapes
/// - `predictions`: `[rows, dims]`, what the prior expects to see; `features`: `[rows, dims]`, of the pictures; `temperature`: `[1]`
pub fn next_feature(predictions: Tensor<2>, features: Tensor<2>, temperature: Tensor<1>) -> Tensor<1> {
    let logits = scaled_logits(predictions, features, temperature);
    (own_partner(logits.clone()) + own_partner(logits.transpose())) * 0.5
}

/// Cross entropy of each row with its own number as label.
fn own_partner(logits: Tensor<2>) -> Tensor<1> {
    let rows = logits.dims()[0];
    let own = Tensor::<2>::eye(rows, &logits.device());
    // Row by row: of millions of numbers at once the sum would depend on the number of threads.
    (log_softmax(logits, 1) * own).sum_dim(1).sum().neg() / rows as f32
}
