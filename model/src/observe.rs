//! What turns one observation into features: the picture network for pixels, a perceptron for vectors. The encoder and the adversary each have
//! their own.

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use rand::Rng;

use crate::cnn::{Cnn, CnnConfig};
use crate::config::{ModelConfig, ObservationKind};
use crate::error::ModelError;
use crate::mlp::{Mlp, MlpConfig};

/// The observations of a window, time-major and flattened over time and batch.
#[derive(Debug, Clone)]
pub enum Frames {
    /// `[length·batch, height, width, 3]`, bytes
    Pixels(Tensor<4, Int>),
    /// `[length·batch, observations]`, through [`symlog`](crate::scale::symlog)
    Vectors(Tensor<2>),
}

/// Observation to features.
#[derive(Module, Debug)]
pub struct Observe {
    /// For pictures.
    pub cnn: Option<Cnn>,
    /// For vectors.
    pub mlp: Option<Mlp>,
}

impl Observe {
    /// The network for the configured kind of observation; features have the width of the hidden state.
    ///
    /// # Errors
    /// The picture is too small.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        let output = config.hidden;
        Ok(match config.observation {
            ObservationKind::Pixels { height, width } => {
                let cnn = CnnConfig { height, width, depth: config.depth, output }.init(rng, device)?;
                Self { cnn: Some(cnn), mlp: None }
            }
            ObservationKind::Vector { len } => {
                let mlp = MlpConfig { input: len, hidden: config.head, output }.init(rng, device);
                Self { cnn: None, mlp: Some(mlp) }
            }
        })
    }

    /// The network with features standardized over these observations.
    ///
    /// # Errors
    /// The frames are not of the kind this network was made for.
    pub fn calibrated(self, frames: Frames) -> Result<Self, ModelError> {
        match (frames, self.cnn, self.mlp) {
            (Frames::Pixels(pixels), Some(cnn), mlp) => Ok(Self { cnn: Some(cnn.calibrated(pixels)), mlp }),
            (Frames::Vectors(vectors), cnn, Some(mlp)) => Ok(Self { cnn, mlp: Some(mlp.calibrated(vectors)) }),
            (Frames::Pixels(_), ..) => Err(mismatch("vector observations", "pixels")),
            (Frames::Vectors(_), ..) => Err(mismatch("pixels", "vector observations")),
        }
    }

    /// # Shapes
    /// - `frames`: `length·batch` observations
    /// - output: `[length, batch, hidden]`
    ///
    /// # Errors
    /// The frames are not of the kind this network was made for.
    pub fn forward(&self, frames: Frames, length: usize) -> Result<Tensor<3>, ModelError> {
        let features = match (frames, &self.cnn, &self.mlp) {
            (Frames::Pixels(pixels), Some(cnn), _) => cnn.forward(pixels),
            (Frames::Vectors(vectors), _, Some(mlp)) => mlp.forward(vectors),
            (Frames::Pixels(_), ..) => return Err(mismatch("vector observations", "pixels")),
            (Frames::Vectors(_), ..) => return Err(mismatch("pixels", "vector observations")),
        };
        let [frames, width] = features.dims();
        Ok(features.reshape([length, frames / length, width]))
    }
}

fn mismatch(wanted: &str, found: &str) -> ModelError {
    ModelError::Mismatch { wanted: wanted.to_owned(), found: found.to_owned() }
}
