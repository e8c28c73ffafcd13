//! Normal distributions with one standard deviation for all dimensions: what every prediction of a latent is.

use burn::tensor::{Tensor, activation::softplus};

const HALF_LOG_TWO_PI: f32 = 0.918_938_5;

/// `N(mean, std² I)`.
#[derive(Debug, Clone)]
pub struct Gaussian {
    /// `[length, batch, dims]`
    pub mean: Tensor<3>,
    /// `[length, batch, 1]`, the same for every dimension.
    pub std: Tensor<3>,
}

impl Gaussian {
    /// From a network's output: a mean of unit norm (all columns but the last) and softplus of the last column above `floor`.
    ///
    /// # Shapes
    /// - `output`: `[length, batch, dims + 1]`
    pub fn unit_mean(output: Tensor<3>, floor: f32) -> Self {
        let dims = output.dims()[2] - 1;
        let mean = unit_norm(output.clone().narrow(2, 0, dims));
        Self { mean, std: softplus(output.narrow(2, dims, 1), 1.0) + floor }
    }

    /// Log-density of `x`, each dimension by itself, in nats.
    ///
    /// # Shapes
    /// - `x`: `[length, batch, dims]`
    /// - output: `[length, batch, dims]`
    pub fn log_prob(&self, x: Tensor<3>) -> Tensor<3> {
        log_prob(x, self.mean.clone(), self.std.clone())
    }
}

/// Log-density of `x` under `N(mean, std²)`, elementwise with broadcasting.
pub fn log_prob<const D: usize>(x: Tensor<D>, mean: Tensor<D>, std: Tensor<D>) -> Tensor<D> {
    let distance = (x - mean) * std.clone().recip();
    distance.square().mul_scalar(-0.5) - (std.log() + HALF_LOG_TWO_PI)
}

/// Divides by the ℓ₂ norm over the last axis.
pub fn unit_norm<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    let norm = (x.clone().square().sum_dim(D - 1) + 1e-12).sqrt();
    x / norm
}
