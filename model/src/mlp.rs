//! A perceptron with two hidden layers and ELU between them: the heads of the dynamics, the reward and the adversary, and what takes the place of the
//! picture network when observations are vectors.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::kernels::plain::elu;
use crate::kernels::{self, LayerWeights};
use crate::linear::{Linear, LinearConfig};

/// Sizes of an [`Mlp`].
#[derive(Debug, Clone, Copy)]
pub struct MlpConfig {
    /// Width of the input.
    pub input: usize,
    /// Width of both hidden layers.
    pub hidden: usize,
    /// Width of the output.
    pub output: usize,
}

/// Linear, ELU, linear, ELU, linear.
#[derive(Module, Debug)]
pub struct Mlp {
    /// `[input, hidden]`
    pub first: Linear,
    /// `[hidden, hidden]`
    pub second: Linear,
    /// `[hidden, output]`
    pub last: Linear,
}

impl MlpConfig {
    /// He-initialised layers.
    pub fn init(&self, rng: &mut impl Rng, device: &Device) -> Mlp {
        let layer = |input, output, rng: &mut _| LinearConfig { input, output }.init(rng, device);
        Mlp {
            first: layer(self.input, self.hidden, rng),
            second: layer(self.hidden, self.hidden, rng),
            last: layer(self.hidden, self.output, rng),
        }
    }
}

impl Mlp {
    /// The network with its last layer [standardized](Linear::standardized) over these inputs: `[rows, input]`.
    pub fn calibrated(mut self, x: Tensor<2>) -> Self {
        let x = elu(self.first.forward(x));
        let x = elu(self.second.forward(x));
        self.last = self.last.clone().standardized(x);
        self
    }

    /// The network whose output is zero whatever it sees, and learns from there.
    pub fn last_zeroed(mut self) -> Self {
        let last = self.last.clone();
        self.last = Linear {
            weight: last.weight.map(|weight| weight.zeros_like()),
            bias: last.bias.map(|bias| bias.zeros_like()),
        };
        self
    }

    /// The network with the weights of its last layer scaled.
    pub fn last_scaled(mut self, scale: f32) -> Self {
        let last = self.last.clone();
        self.last = Linear { weight: last.weight.map(|weight| weight * scale), bias: last.bias };
        self
    }

    /// # Shapes
    /// - `x`: `[…, input]`
    /// - output: `[…, output]`
    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        let mut shape = x.dims();
        let rows = shape[..D - 1].iter().product::<usize>();
        let output = kernels::perceptron(x.reshape([rows, shape[D - 1]]), self.weights());
        shape[D - 1] = output.dims()[1];
        output.reshape(shape)
    }

    /// Weights and biases of its three layers.
    pub fn weights(&self) -> [LayerWeights; 3] {
        [&self.first, &self.second, &self.last].map(|layer| (layer.weight.val(), layer.bias.val()))
    }
}
