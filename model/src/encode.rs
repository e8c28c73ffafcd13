//! Using a trained encoder: latents of an episode, chunk by chunk, carrying the hidden state. Memory follows the chunk, never the episode. One
//! step at a time this is also how a policy follows an environment.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use crate::config::{ModelConfig, ObservationKind};
use crate::encoder::Encoder;
use crate::error::ModelError;
use crate::kernels::pixel_tensor;
use crate::model::Model;
use crate::observe::Frames;
use crate::parameters::to_values;
use crate::scale;

/// One observation after another, as the environment or the recording gives them.
#[derive(Debug, Clone, Copy)]
pub enum RawFrames<'a> {
    /// `[length, height, width, 3]`
    Pixels(&'a [u8]),
    /// `[length, observations]`
    Vectors(&'a [f32]),
}

/// Follows one episode from its start.
#[derive(Debug)]
pub struct EpisodeEncoder<'a> {
    config: &'a ModelConfig,
    encoder: Encoder,
    device: Device,
    state: Option<Tensor<2>>,
}

impl<'a> EpisodeEncoder<'a> {
    /// At the start of an episode: the hidden state is zeros, as in training.
    pub fn new(model: &'a Model, device: &Device) -> Self {
        Self {
            config: &model.config,
            encoder: model.world.encoder.valid(),
            device: device.clone().inner(),
            state: None,
        }
    }

    /// Starts another episode.
    pub fn reset(&mut self) {
        self.state = None;
    }

    /// Posterior means of the next rows of the episode.
    ///
    /// # Shapes
    /// - `frames`: the observations of `length` rows
    /// - `previous_actions`: `[length, A]`, the action before each row in the task's bounds; at the episode's start its values are not used
    /// - output: `[length, latent]`
    ///
    /// # Errors
    /// The observations are of another kind or size than the model's.
    pub fn push(&mut self, frames: RawFrames<'_>, previous_actions: &[f32]) -> Result<Vec<f32>, ModelError> {
        let width = self.config.actions();
        let length = previous_actions.len() / width.max(1);
        let mut actions = previous_actions.to_vec();
        scale::actions(&mut actions, &self.config.action_min, &self.config.action_max);
        if self.state.is_none() {
            actions[..width].fill(0.0);
        }
        let frames = to_frames(frames, self.config.observation, length, &self.device)?;
        let actions = Tensor::<3>::from_data(TensorData::new(actions, [length, 1, width]), &self.device);
        let encoding = self.encoder.forward(frames, actions, self.state.take())?;
        self.state = Some(encoding.state);
        Ok(to_values(encoding.means))
    }
}

/// Observations as the networks take them.
///
/// # Errors
/// The observations are of another kind or size than `kind`.
pub fn to_frames(
    raw: RawFrames<'_>,
    kind: ObservationKind,
    frames: usize,
    device: &Device,
) -> Result<Frames, ModelError> {
    match (raw, kind) {
        (RawFrames::Pixels(bytes), ObservationKind::Pixels { height, width })
            if bytes.len() == frames * height * width * 3 =>
        {
            Ok(Frames::Pixels(pixel_tensor(bytes.to_vec(), [frames, height, width, 3], device)))
        }
        (RawFrames::Vectors(values), ObservationKind::Vector { len }) if values.len() == frames * len => {
            let mut values = values.to_vec();
            scale::symlog(&mut values);
            Ok(Frames::Vectors(Tensor::from_data(TensorData::new(values, [frames, len]), device)))
        }
        (raw, wanted) => {
            let found = match raw {
                RawFrames::Pixels(bytes) => format!("pixels, {} bytes a frame", bytes.len() / frames.max(1)),
                RawFrames::Vectors(values) => format!("vectors of {}", values.len() / frames.max(1)),
            };
            Err(ModelError::Mismatch { wanted: wanted.to_string(), found })
        }
    }
}
