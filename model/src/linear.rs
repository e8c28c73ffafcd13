//! A linear layer over the last axis: `y = x W + b`.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::init::{constant, he_normal};
use crate::kernels;

/// Sizes of a [`Linear`] layer.
#[derive(Debug, Clone, Copy)]
pub struct LinearConfig {
    /// Width of the input.
    pub input: usize,
    /// Width of the output.
    pub output: usize,
}

/// `y = x W + b` over the last axis.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[input, output]`
    pub weight: Param<Tensor<2>>,
    /// `[output]`
    pub bias: Param<Tensor<1>>,
}

impl LinearConfig {
    /// He-initialised weights, zero bias.
    pub fn init(&self, rng: &mut impl Rng, device: &Device) -> Linear {
        Linear {
            weight: he_normal([self.input, self.output], self.input, rng, device),
            bias: constant([self.output], 0.0, device),
        }
    }
}

impl Linear {
    /// # Shapes
    /// - `x`: `[…, input]`
    /// - output: `[…, output]`
    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        let mut shape = x.dims();
        let rows = shape[..D - 1].iter().product::<usize>();
        let output = kernels::linear(x.reshape([rows, shape[D - 1]]), self.weight.val(), self.bias.val());
        shape[D - 1] = output.dims()[1];
        output.reshape(shape)
    }

    /// The layer scaled and shifted so that each of its outputs has mean 0 and standard deviation 1 over these inputs; an output that
    /// never changes is only shifted.
    ///
    /// # Shapes
    /// - `inputs`: `[rows, input]`
    pub fn standardized(self, inputs: Tensor<2>) -> Self {
        let outputs = self.forward(inputs);
        let mean = outputs.clone().mean_dim(0);
        let std = (outputs - mean.clone()).powi_scalar(2).mean_dim(0).sqrt();
        let still = std.clone().lower_equal_elem(1e-6);
        let std = std.mask_fill(still, 1.0);
        let width = self.bias.val().dims();
        let (shift, scale) = (mean.reshape(width), std.clone().reshape(width));
        Self { weight: self.weight.map(|weight| weight / std), bias: self.bias.map(|bias| (bias - shift) / scale) }
    }
}
