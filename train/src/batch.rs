//! One batch of windows as tensors on a device. In: what the sampler gathered. Out: observations, scaled actions, rewards, and which rows count.

use burn::tensor::{Device, Tensor, TensorData};
use vibes_data::WindowBatch;
use vibes_model::encode::{RawFrames, to_frames};
use vibes_model::observe::Frames;
use vibes_model::{ModelConfig, ObservationKind, scale};

use crate::error::Result;

/// A batch on a device. Shapes are `[length, batch, …]`.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Rows a window.
    pub length: usize,
    /// Windows.
    pub batch: usize,
    /// `length·batch` observations.
    pub frames: Frames,
    /// Scaled to −1..1: `[length, batch, A]`
    pub actions: Tensor<3>,
    /// The action before each row, zeros at an episode's start: `[length, batch, A]`
    pub previous_actions: Tensor<3>,
    /// `[length, batch, 1]`
    pub rewards: Tensor<3>,
    /// 1 where a row counts, 0 where it only warms up the hidden states: `[length, batch, 1]`
    pub counted: Tensor<3>,
    /// How many rows count.
    pub count: f32,
}

impl Batch {
    /// # Errors
    /// The recording's observations are not the model's.
    pub fn new(windows: &WindowBatch, config: &ModelConfig, burn_in: usize, device: &Device) -> Result<Self> {
        let (length, batch) = (windows.length, windows.batch);
        let raw = match config.observation {
            ObservationKind::Pixels { .. } => RawFrames::Pixels(&windows.pixels),
            ObservationKind::Vector { .. } => RawFrames::Vectors(&windows.observations),
        };
        let scaled = |actions: &[f32]| {
            let mut actions = actions.to_vec();
            scale::actions(&mut actions, &config.action_min, &config.action_max);
            actions
        };
        let mut previous = scaled(&windows.previous_actions);
        for (action, _) in
            previous.chunks_exact_mut(config.actions().max(1)).zip(&windows.is_first).filter(|(_, first)| **first)
        {
            action.fill(0.0);
        }
        let counted = counted(windows, burn_in);
        let tensor =
            |values: Vec<f32>, width| Tensor::from_data(TensorData::new(values, [length, batch, width]), device);
        Ok(Self {
            length,
            batch,
            frames: to_frames(raw, config.observation, length * batch, device)?,
            actions: tensor(scaled(&windows.actions), config.actions()),
            previous_actions: tensor(previous, config.actions()),
            rewards: tensor(windows.rewards.clone(), 1),
            count: counted.iter().sum(),
            counted: tensor(counted, 1),
        })
    }
}

/// All rows of a window that begins with its episode, all but the first `burn_in` of any other.
fn counted(windows: &WindowBatch, burn_in: usize) -> Vec<f32> {
    let rows = (0..windows.length).flat_map(|step| (0..windows.batch).map(move |window| (step, window)));
    rows.map(|(step, window)| if step >= burn_in || windows.is_first[window] { 1.0 } else { 0.0 }).collect()
}
