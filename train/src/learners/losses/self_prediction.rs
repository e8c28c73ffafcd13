//! Self-prediction (SPR, mila-iqia/spr): predictions rolled out over several steps should point where the later latents point. In: predictions and targets of every
//! step. Out: two minus twice the cosine, summed over the steps.

use burn::tensor::Tensor;
use vibes_model::gaussian::unit_norm;

/// Sum over the steps, mean over the rows; no gradient to the targets.
///
/// # Shapes
/// - `predictions`, `targets`: `[steps, rows, dims]`
pub fn loss(predictions: Tensor<3>, targets: Tensor<3>) -> Tensor<1> {
    let rows = predictions.dims()[1];
    let cosines = (unit_norm(predictions) * unit_norm(targets.detach())).sum_dim(2);
    (cosines * -2.0 + 2.0).sum() / rows as f32
}
