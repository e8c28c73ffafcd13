//! Normal distributions with one standard deviation for all dimensions: what every prediction of a latent is.

use std::fmt;

use burn::tensor::{Tensor, activation::softplus};
use serde::{Deserialize, Serialize};

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
    /// From a network's output: a mean of the form that latents have (all columns but the last) and softplus of the last column above `floor`.
    ///
    /// # Shapes
    /// - `output`: `[length, batch, dims + 1]`
    pub fn latent(output: Tensor<3>, form: LatentForm, floor: f32) -> Self {
        let dims = output.dims()[2] - 1;
        let mean = form.mean(output.clone().narrow(2, 0, dims));
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

/// What a network's output becomes as the mean of a latent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LatentForm {
    /// Divided by its length: the paper's.
    #[default]
    UnitNorm,
    /// As it is: distances that read a latent's length need it.
    Raw,
}

impl fmt::Display for LatentForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnitNorm => "unit norm",
            Self::Raw => "raw",
        })
    }
}

impl LatentForm {
    /// The mean that an output stands for.
    ///
    /// # Shapes
    /// - `output` and result: `[…, dims]`
    pub fn mean<const D: usize>(self, output: Tensor<D>) -> Tensor<D> {
        match self {
            Self::UnitNorm => unit_norm(output),
            Self::Raw => output,
        }
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
