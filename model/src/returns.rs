//! λ-returns, and the scale of returns. In: rewards `r_k = r(s_k, a_k)` and values along trajectories that never end. Out: what the actor maximises and the
//! critic is to predict.

use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

/// `G_k = r_k + γ [(1 − λ) v_{k+1} + λ G_{k+1}]`, `G_H = v_H`. The action at row k earns `r_k`; a time limit is not an end, so nothing cuts the sum.
///
/// # Shapes
/// - `rewards`: `[horizon, rows]`; `values`: `[horizon + 1, rows]`
/// - output: `[horizon, rows]`
pub fn lambda_returns(rewards: Tensor<2>, values: Tensor<2>, discount: f64, lambda: f64) -> Tensor<2> {
    let [horizon, rows] = rewards.dims();
    let device = rewards.device();
    // Unrolled: G_k = Σ_{j ≥ k} (γλ)^{j−k} (r_j + γ (1 − λ) v_{j+1}) + (γλ)^{H−k} v_H, a product with a triangular matrix.
    let power = |exponent: usize| (discount * lambda).powi(exponent as i32) as f32;
    let weights: Vec<f32> =
        (0..horizon).flat_map(|k| (0..horizon).map(move |j| if j >= k { power(j - k) } else { 0.0 })).collect();
    let weights = Tensor::<2>::from_data(TensorData::new(weights, [horizon, horizon]), &device);
    let tails: Vec<f32> = (0..horizon).map(|k| power(horizon - k)).collect();
    let tails = Tensor::<2>::from_data(TensorData::new(tails, [horizon, 1]), &device);
    let next = values.clone().narrow(0, 1, horizon);
    let last = values.narrow(0, horizon, 1).expand([horizon, rows]);
    weights.matmul(rewards + next * (discount * (1.0 - lambda))) + last * tails
}

/// A moving range of returns, `DreamerV3`'s: the distance of the 5th and the 95th percentile, each a moving average of rate 0.01 from 0 that is not
/// corrected for its start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ReturnScale {
    /// Moving 5th percentile.
    pub low: f64,
    /// Moving 95th percentile.
    pub high: f64,
}

/// Share of a new percentile in the moving average.
const RATE: f64 = 0.01;

impl ReturnScale {
    /// The scale after another batch of returns.
    #[must_use]
    pub fn after(self, returns: &[f32]) -> Self {
        let mut sorted = returns.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let moved = |average: f64, share: f64| average + RATE * (percentile(&sorted, share) - average);
        Self { low: moved(self.low, 0.05), high: moved(self.high, 0.95) }
    }

    /// What returns are divided by: never below 1, so that small returns are not blown up.
    pub fn divisor(self) -> f64 {
        (self.high - self.low).max(1.0)
    }
}

/// A percentile of sorted values, linear between them.
fn percentile(sorted: &[f32], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let (below, above) = (f64::from(sorted[at.floor() as usize]), f64::from(sorted[at.ceil() as usize]));
    below + (above - below) * at.fract()
}

#[cfg(test)]
mod tests;
