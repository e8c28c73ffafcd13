//! A linear layer over the last axis: `y = x W + b`.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, module};
use rand::Rng;

use crate::init::{constant, he_normal};

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
        module::linear(x, self.weight.val(), Some(self.bias.val()))
    }
}
