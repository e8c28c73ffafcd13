//! SAR's loss: several heads' expectations of a characteristic function against its own cosines and sines. In: waves at drawn frequencies. Out: one number.
//!
//! ```text
//! Σ over the best heads of  views · mean (ψ̂ − ψ)²   +   Σ over the best heads of  −mean log softmax(cos(ψ̂_i, ψ_j) / 0.1)_ii
//! ```
//!
//! DMU-XMU/SAR (`auxiliary/sar.py`). The best heads are those of the smallest error, in each of the two sums for itself. The cross entropy compares rows of the first view.

use burn::tensor::activation::log_softmax;
use burn::tensor::{Int, Tensor, TensorData};
use vibes_model::parameters::to_values;
use vibes_model::sac::characteristic::Waves;

/// What cosines of the angle between expected and own waves are divided by.
const TEMPERATURE: f32 = 0.1;
/// Least squared length of a row's waves.
const LEAST: f32 = 1e-12;

/// The loss.
///
/// # Shapes
/// - `expected`: `[samples, views · rows, heads]`, one view after the other; `own`: `[samples, views · rows]`
pub fn loss(expected: Waves<3>, own: Waves<2>, views: usize, best: usize) -> Tensor<1> {
    let [samples, all, heads] = expected.cosines.dims();
    let rows = all / views.max(1);
    let error = |expected: &Tensor<3>, own: &Tensor<2>| (expected.clone() - own.clone().unsqueeze_dim(2)).square();
    let errors = error(&expected.cosines, &own.cosines) + error(&expected.sines, &own.sines);
    let errors = errors.reshape([samples * all, heads]).mean_dim(0).squeeze_dim::<1>(0);
    // [rows, 2·samples] of the first view, of unit length, for every head and for the actions.
    let wave = |cosines: Tensor<2>, sines: Tensor<2>| unit(Tensor::cat(vec![cosines, sines], 0).transpose());
    let of_head =
        |waves: &Tensor<3>, head: usize| waves.clone().narrow(1, 0, rows).narrow(2, head, 1).reshape([samples, rows]);
    let wanted = wave(own.cosines.narrow(1, 0, rows), own.sines.narrow(1, 0, rows)).transpose();
    let entropies = (0..heads).map(|head| {
        let found = wave(of_head(&expected.cosines, head), of_head(&expected.sines, head));
        let likeness = log_softmax(found.matmul(wanted.clone()) / TEMPERATURE, 1);
        (likeness * Tensor::<2>::eye(rows, &wanted.device())).sum().neg() / rows as f32
    });
    smallest(errors, best).sum() * views as f32 + smallest(Tensor::cat(entropies.collect(), 0), best).sum()
}

/// Rows of unit length: `[rows, dims]`.
fn unit(x: Tensor<2>) -> Tensor<2> {
    let length = (x.clone().square().sum_dim(1) + LEAST).sqrt();
    x / length
}

/// The `count` smallest numbers.
fn smallest(x: Tensor<1>, count: usize) -> Tensor<1> {
    let values = to_values(x.clone());
    let mut order: Vec<i32> = (0..values.len() as i32).collect();
    order.sort_by(|&a, &b| values[a as usize].total_cmp(&values[b as usize]));
    order.truncate(count);
    let kept = order.len();
    x.clone().select(0, Tensor::<1, Int>::from_data(TensorData::new(order, [kept]), &x.device()))
}
