//! From stacked pictures to features: the convolutions, whose output critic and actor share, and a trunk that each has for itself.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, module};
use rand::Rng;

use super::config::{FILTERS, LAYERS, SacConfig};
use crate::error::ModelError;
use crate::init::{constant, delta_orthogonal, orthogonal};
use crate::kernels::{self, Conv3Layer, conv3_size};
use crate::linear::Linear;
use crate::mlp::Mlp;

/// A 3×3 convolution and its `ReLU`.
#[derive(Module, Debug)]
pub struct Convolution {
    /// `[32, in, 3, 3]`
    pub weight: Param<Tensor<4>>,
    /// `[32]`
    pub bias: Param<Tensor<1>>,
}

/// The four convolutions.
#[derive(Module, Debug)]
pub struct Convolutions {
    /// In order; the first has stride 2.
    pub layers: Vec<Convolution>,
}

impl Convolutions {
    /// Delta-orthogonal weights, zero bias.
    pub fn init(config: &SacConfig, rng: &mut impl Rng, device: &Device) -> Self {
        let gain = std::f32::consts::SQRT_2;
        let mut layer = |index| {
            let input = if index == 0 { config.channels() } else { FILTERS };
            Convolution {
                weight: delta_orthogonal([FILTERS, input], 3, gain, rng, device),
                bias: constant([FILTERS], 0.0, device),
            }
        };
        Self { layers: (0..LAYERS).map(&mut layer).collect() }
    }

    /// # Shapes
    /// - `pixels`: `[rows, height, width, 3·stack]`, bytes
    /// - output: `[rows, maps]`
    pub fn forward(&self, pixels: Tensor<4, Int>) -> Tensor<2> {
        let layer = |layer: &Convolution| Conv3Layer { weight: layer.weight.val(), bias: layer.bias.val() };
        kernels::conv3_features(pixels, &self.layers.iter().map(layer).collect::<Vec<_>>())
    }

    /// Width of the output for pictures of the configured size.
    ///
    /// # Errors
    /// They are too small for four layers.
    pub fn width(config: &SacConfig) -> Result<usize, ModelError> {
        let [height, width] = config.view;
        let maps = conv3_size(config.view, LAYERS).filter(|size| !size.contains(&0));
        maps.map(|[h, w]| h * w * FILTERS).ok_or(ModelError::StackTooSmall { height, width })
    }
}

/// Linear layer, layer norm and, where configured, tanh.
#[derive(Module, Debug)]
pub struct Trunk {
    /// From the maps to the features.
    pub linear: Linear,
    /// Scale of the layer norm: `[feature]`
    pub norm_scale: Param<Tensor<1>>,
    /// Shift of the layer norm: `[feature]`
    pub norm_shift: Param<Tensor<1>>,
    #[module(skip)]
    squash: bool,
}

impl Trunk {
    /// Orthogonal weights.
    ///
    /// # Errors
    /// The pictures are too small.
    pub fn init(config: &SacConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        Ok(Self {
            linear: orthogonal_linear([Convolutions::width(config)?, config.feature], rng, device),
            norm_scale: constant([config.feature], 1.0, device),
            norm_shift: constant([config.feature], 0.0, device),
            squash: config.squash,
        })
    }

    /// # Shapes
    /// - `maps`: `[rows, maps]`, of [`Convolutions::forward`]
    /// - output: `[rows, feature]`
    pub fn forward(&self, maps: Tensor<2>) -> Tensor<2> {
        let x = self.linear.forward(maps);
        let x = module::layer_norm(x, self.norm_scale.val(), Some(self.norm_shift.val()), 1e-5);
        if self.squash { x.tanh() } else { x }
    }
}

/// A linear layer with orthogonal weights and zero bias.
pub(crate) fn orthogonal_linear([input, output]: [usize; 2], rng: &mut impl Rng, device: &Device) -> Linear {
    Linear { weight: orthogonal([input, output], 1.0, rng, device), bias: constant([output], 0.0, device) }
}

/// A perceptron of two hidden layers with orthogonal weights, to be run by [`relu_forward`].
pub(crate) fn orthogonal_mlp([input, hidden, output]: [usize; 3], rng: &mut impl Rng, device: &Device) -> Mlp {
    Mlp {
        first: orthogonal_linear([input, hidden], rng, device),
        second: orthogonal_linear([hidden, hidden], rng, device),
        last: orthogonal_linear([hidden, output], rng, device),
    }
}

/// Linear, `ReLU`, linear, `ReLU`, linear.
pub(crate) fn relu_forward(mlp: &Mlp, x: Tensor<2>) -> Tensor<2> {
    let x = mlp.first.forward(x).clamp_min(0.0);
    let x = mlp.second.forward(x).clamp_min(0.0);
    mlp.last.forward(x)
}
