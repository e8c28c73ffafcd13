//! What a critic's output stands for: a distribution of returns. In: the output of its network. Out: values, and losses against target values.

use burn::tensor::{Int, Tensor, TensorData, activation::log_softmax};
use serde::{Deserialize, Serialize};

use crate::parameters::to_values;

/// Bins of the two-hot distribution, symexp of evenly spaced numbers between −20 and 20.
pub const BINS: usize = 255;
const REACH: f64 = 20.0;

/// What a critic's output stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ValueDistribution {
    /// `DreamerV3`'s: a softmax over [`BINS`] values that grow exponentially; a target is split over the two bins beside it, and the loss is the cross entropy.
    TwoHot,
    /// Dreamer's and `RePo`'s: the mean of a normal with unit variance, so the loss is half the squared error.
    Gaussian,
}

impl ValueDistribution {
    /// Numbers of output a row.
    pub fn width(self) -> usize {
        match self {
            Self::TwoHot => BINS,
            Self::Gaussian => 1,
        }
    }

    /// The value that an output stands for.
    ///
    /// # Shapes
    /// - `output`: `[rows, width]`
    /// - result: `[rows]`
    pub fn value(self, output: Tensor<2>) -> Tensor<1> {
        match self {
            Self::Gaussian => output.squeeze_dim(1),
            Self::TwoHot => two_hot_value(output),
        }
    }

    /// What a loss is divided by when returns are measured in units of `scale`: a squared error grows with its square, a cross entropy not at all.
    pub fn loss_unit(self, scale: f64) -> f64 {
        match self {
            Self::Gaussian => scale * scale,
            Self::TwoHot => 1.0,
        }
    }

    /// The loss of an output against target values, one a row.
    ///
    /// # Shapes
    /// - `output`: `[rows, width]`, `targets`: `[rows]`, through which no gradient flows
    /// - result: `[rows]`
    pub fn loss(self, output: Tensor<2>, targets: Tensor<1>) -> Tensor<1> {
        let targets = targets.inner();
        match self {
            Self::Gaussian => (output.squeeze_dim::<1>(1) - targets).square() * 0.5,
            Self::TwoHot => two_hot_loss(output, &to_values(targets)),
        }
    }
}

/// `sign(x) (exp|x| − 1)` of evenly spaced numbers, ascending; the middle one is exactly 0.
fn bins() -> Vec<f64> {
    let step = 2.0 * REACH / (BINS - 1) as f64;
    let middle = (BINS / 2) as f64;
    (0..BINS).map(|bin| (bin as f64 - middle) * step).map(|x| x.signum() * x.abs().exp_m1()).collect()
}

/// The mean over the bins. Bins of opposite sign are paired first, so that equal probabilities give exactly 0 although the outermost bins are huge.
fn two_hot_value(output: Tensor<2>) -> Tensor<1> {
    let half = BINS / 2;
    let upper: Vec<f32> = bins()[half + 1..].iter().map(|&bin| bin as f32).collect();
    let upper = Tensor::<2>::from_data(TensorData::new(upper, [1, half]), &output.device());
    let chances = log_softmax(output, 1).exp();
    let above = chances.clone().narrow(1, half + 1, half);
    let below = chances.narrow(1, 0, half).flip([1]);
    ((above - below) * upper).sum_dim(1).squeeze_dim(1)
}

/// Cross entropy with the target split, in the values' own space, over the two bins beside it.
fn two_hot_loss(output: Tensor<2>, targets: &[f32]) -> Tensor<1> {
    let (bins, rows) = (bins(), targets.len());
    let (mut places, mut shares) = (Vec::with_capacity(2 * rows), Vec::with_capacity(2 * rows));
    for &target in targets {
        let (lower, share) = split(&bins, f64::from(target));
        places.extend([lower as i64, lower as i64 + 1]);
        shares.extend([1.0 - share as f32, share as f32]);
    }
    let device = output.device();
    let places = Tensor::<2, Int>::from_data(TensorData::new(places, [rows, 2]), &device);
    let shares = Tensor::<2>::from_data(TensorData::new(shares, [rows, 2]), &device);
    let likelihood = log_softmax(output, 1).gather(1, places);
    (likelihood * shares).sum_dim(1).squeeze_dim::<1>(1).neg()
}

/// The bin below a value, and the share that the bin above it gets.
fn split(bins: &[f64], value: f64) -> (usize, f64) {
    let lower = bins.partition_point(|&bin| bin <= value).clamp(1, BINS - 1) - 1;
    let share = (value - bins[lower]) / (bins[lower + 1] - bins[lower]);
    (lower, share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests;
