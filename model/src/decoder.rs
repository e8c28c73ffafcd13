//! The decoder `p_θ(o_t | s_t)` of the reconstruction ablation: the observation network run backwards. Pictures come out of a linear layer and
//! transposed 4×4 convolutions with stride 2 that retrace the sizes of the picture network; vectors out of a perceptron.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::cnn::CnnConfig;
use crate::config::{ModelConfig, ObservationKind};
use crate::error::ModelError;
use crate::init::{constant, he_normal};
use crate::kernels::{TransposedLayer, pixel_error, transposed};
use crate::linear::{Linear, LinearConfig};
use crate::mlp::{Mlp, MlpConfig};
use crate::observe::Frames;

/// A transposed 4×4 convolution with stride 2.
#[derive(Module, Debug)]
pub struct ConvUpLayer {
    /// `[in, out, 4, 4]`
    pub weight: Param<Tensor<4>>,
    /// `[out]`
    pub bias: Param<Tensor<1>>,
    /// Rows and columns to add at the far edge, where the forward convolution left one unseen.
    #[module(skip)]
    padding: [usize; 2],
}

/// Latent to picture.
#[derive(Module, Debug)]
pub struct PictureDecoder {
    /// Latent to the smallest feature map.
    pub linear: Linear,
    /// Transposed convolutions, from the smallest map to the picture.
    pub layers: Vec<ConvUpLayer>,
    /// `[height, width, channels]` of the smallest map.
    #[module(skip)]
    start: [usize; 3],
}

/// Latent to observation.
#[derive(Module, Debug)]
pub struct Decoder {
    /// For pictures.
    pub picture: Option<PictureDecoder>,
    /// For vectors.
    pub vector: Option<Mlp>,
}

impl Decoder {
    /// # Errors
    /// The picture is too small.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        Ok(match config.observation {
            ObservationKind::Pixels { height, width } => {
                let maps = CnnConfig { height, width, depth: config.depth, output: config.hidden }.maps()?;
                let picture = PictureDecoder::init(config.latent, &maps, rng, device);
                Self { picture: Some(picture), vector: None }
            }
            ObservationKind::Vector { len } => {
                let vector = MlpConfig { input: config.latent, hidden: config.head, output: len }.init(rng, device);
                Self { picture: None, vector: Some(vector) }
            }
        })
    }

    /// Log-density of the observations given the latents, in nats up to a constant, for a unit variance on the scaled values.
    ///
    /// # Shapes
    /// - `frames`: `length·batch` observations, `latents`: `[length, batch, latent]`
    /// - output: `[length, batch]`
    ///
    /// # Errors
    /// The frames are of another kind than the model's.
    pub fn log_prob(&self, frames: Frames, latents: Tensor<3>) -> Result<Tensor<2>, ModelError> {
        let [length, batch, latent] = latents.dims();
        let latents = latents.reshape([length * batch, latent]);
        let errors = match (frames, &self.picture, &self.vector) {
            (Frames::Pixels(pixels), Some(net), _) => pixel_error(net.forward(latents), pixels),
            (Frames::Vectors(vectors), _, Some(net)) => {
                (net.forward(latents) - vectors).square().sum_dim(1).squeeze_dim(1)
            }
            _ => {
                let (wanted, found) = ("its own kind of observation".to_owned(), "another kind".to_owned());
                return Err(ModelError::Mismatch { wanted, found });
            }
        };
        Ok(errors.mul_scalar(-0.5).reshape([length, batch]))
    }
}

impl PictureDecoder {
    fn init(latent: usize, maps: &[[usize; 3]], rng: &mut impl Rng, device: &Device) -> Self {
        let start = maps.last().copied().unwrap_or([1, 1, 1]);
        let layers = maps.windows(2).rev().map(|pair| {
            let ([to_h, to_w, output], [from_h, from_w, input]) = (pair[0], pair[1]);
            ConvUpLayer {
                // Every output pixel is reached by four of the sixteen taps.
                weight: he_normal([input, output, 4, 4], 4 * input, rng, device),
                bias: constant([output], 0.0, device),
                padding: [to_h - (2 * from_h + 2), to_w - (2 * from_w + 2)],
            }
        });
        let layers = layers.collect();
        Self { linear: LinearConfig { input: latent, output: start.iter().product() }.init(rng, device), layers, start }
    }

    /// # Shapes
    /// - `latents`: `[frames, latent]`
    /// - output: `[frames, height, width, 3]`, scaled to −0.5..0.5
    pub fn forward(&self, latents: Tensor<2>) -> Tensor<4> {
        let [frames, _] = latents.dims();
        let [height, width, channels] = self.start;
        let mut x = self.linear.forward(latents).reshape([frames, height, width, channels]);
        let last = self.layers.len().saturating_sub(1);
        for (index, layer) in self.layers.iter().enumerate() {
            let (weight, bias) = (layer.weight.val(), layer.bias.val());
            x = transposed(x, &TransposedLayer { weight, bias, padding: layer.padding, relu: index < last });
        }
        x
    }
}
