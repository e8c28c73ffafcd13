//! The picture network: up to four 4×4 convolutions with stride 2 (channels depth, 2·depth, 4·depth, 8·depth), `ReLU` after each, a linear layer and a
//! layer norm. At 64×64 its sizes are 31, 14, 6, 2.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, module};
use rand::Rng;

use crate::error::ModelError;
use crate::init::{constant, he_normal};
use crate::kernels;
use crate::linear::{Linear, LinearConfig};

/// The smallest height and width the network takes.
pub const LEAST_SIZE: usize = 10;
const LAYERS: usize = 4;

/// Sizes of a [`Cnn`].
#[derive(Debug, Clone, Copy)]
pub struct CnnConfig {
    /// Rows of the picture.
    pub height: usize,
    /// Columns of the picture.
    pub width: usize,
    /// Channels after the first convolution.
    pub depth: usize,
    /// Width of the output.
    pub output: usize,
}

/// A 4×4 convolution with stride 2 and its `ReLU`.
#[derive(Module, Debug)]
pub struct ConvLayer {
    /// `[out, in, 4, 4]`
    pub weight: Param<Tensor<4>>,
    /// `[out]`
    pub bias: Param<Tensor<1>>,
}

/// The picture network.
#[derive(Module, Debug)]
pub struct Cnn {
    /// The convolutions, in order.
    pub layers: Vec<ConvLayer>,
    /// From the flattened last feature map to the output.
    pub linear: Linear,
    /// Scale of the layer norm: `[output]`
    pub norm_scale: Param<Tensor<1>>,
    /// Shift of the layer norm: `[output]`
    pub norm_shift: Param<Tensor<1>>,
}

impl CnnConfig {
    /// `[height, width, channels]` of the picture and after every convolution: as many of the four as the picture's size allows.
    ///
    /// # Errors
    /// The picture is smaller than [`LEAST_SIZE`], which leaves room for two.
    pub fn maps(&self) -> Result<Vec<[usize; 3]>, ModelError> {
        let (height, width) = (self.height, self.width);
        if height.min(width) < LEAST_SIZE {
            return Err(ModelError::PictureTooSmall { height, width, least: LEAST_SIZE });
        }
        let mut maps = vec![[height, width, 3]];
        let (mut h, mut w) = (height, width);
        for layer in 0..LAYERS {
            if h.min(w) < 4 {
                break;
            }
            (h, w) = (conv_size(h), conv_size(w));
            maps.push([h, w, self.depth << layer]);
        }
        Ok(maps)
    }

    /// He-initialised layers.
    ///
    /// # Errors
    /// As [`CnnConfig::maps`].
    pub fn init(&self, rng: &mut impl Rng, device: &Device) -> Result<Cnn, ModelError> {
        let maps = self.maps()?;
        let mut layers = Vec::new();
        for pair in maps.windows(2) {
            let ([_, _, input], [_, _, output]) = (pair[0], pair[1]);
            layers.push(ConvLayer {
                weight: he_normal([output, input, 4, 4], 16 * input, rng, device),
                bias: constant([output], 0.0, device),
            });
        }
        let flat = maps.last().map_or(0, |map| map.iter().product());
        Ok(Cnn {
            layers,
            linear: LinearConfig { input: flat, output: self.output }.init(rng, device),
            norm_scale: constant([self.output], 1.0, device),
            norm_shift: constant([self.output], 0.0, device),
        })
    }
}

impl Cnn {
    /// The network with its last layer [standardized](Linear::standardized) over these pictures: `[frames, height, width, 3]`.
    pub fn calibrated(mut self, pixels: Tensor<4, Int>) -> Self {
        self.linear = self.linear.clone().standardized(kernels::features(pixels, &self.convolutions()));
        self
    }

    /// # Shapes
    /// - `pixels`: `[frames, height, width, 3]`, bytes
    /// - output: `[frames, output]`
    pub fn forward(&self, pixels: Tensor<4, Int>) -> Tensor<2> {
        let x = self.linear.forward(kernels::features(pixels, &self.convolutions()));
        module::layer_norm(x, self.norm_scale.val(), Some(self.norm_shift.val()), 1e-5)
    }

    fn convolutions(&self) -> Vec<kernels::ConvLayer> {
        let layer = |layer: &ConvLayer| kernels::ConvLayer { weight: layer.weight.val(), bias: layer.bias.val() };
        self.layers.iter().map(layer).collect()
    }
}

/// Height or width after one 4×4 convolution with stride 2 and no padding; an odd last row or column is not seen.
fn conv_size(size: usize) -> usize {
    (size - 4) / 2 + 1
}
