//! Sizes of the model-free agents' networks, saved with their weights.

use serde::{Deserialize, Serialize};

use crate::cross_entropy::CrossEntropy;

/// Filters of every convolution.
pub const FILTERS: usize = 32;
/// Convolutions; the first has stride 2.
pub const LAYERS: usize = 4;

/// Sizes and constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SacConfig {
    /// The task it was made for.
    pub task: String,
    /// Rows and columns of a recorded picture.
    pub picture: [usize; 2],
    /// Rows and columns that the convolutions see, cut from the middle where nothing is varied.
    pub view: [usize; 2],
    /// Pictures side by side in the channels.
    pub stack: usize,
    /// Lower bounds of the action; actions enter the networks scaled to −1..1.
    pub action_min: Vec<f32>,
    /// Upper bounds of the action.
    pub action_max: Vec<f32>,
    /// Width of the features.
    pub feature: usize,
    /// Width of the perceptrons' hidden layers.
    pub hidden: usize,
    /// Whether tanh follows the features' layer norm (DrQ, SAR; not CURL, DBC, `MICo`).
    pub squash: bool,
    /// The search for the best action, where there is no actor (QT-Opt).
    pub search: Option<CrossEntropy>,
    /// Share of random actions while collecting, where there is no actor.
    pub random_share: f32,
    /// Whether there is a bilinear form between features (CURL).
    #[serde(default)]
    pub bilinear: bool,
    /// Whether there is a model of the next features and of the reward (`DeepMDP`, DBC, `SimSR`).
    #[serde(default)]
    pub transition: bool,
    /// Steps whose actions' characteristic function is expected (SAR); 0 for none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub sequence: usize,
    /// Lower bound of the logarithm of the actor's standard deviation; the upper one is 2.
    #[serde(default = "least_log_std", skip_serializing_if = "is_least_log_std")]
    pub log_std_min: f32,
}

/// As in the SAC-AE lineage.
pub const LOG_STD_MIN: f32 = -10.0;

fn least_log_std() -> f32 {
    LOG_STD_MIN
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_least_log_std(bound: &f32) -> bool {
    bound.to_bits() == LOG_STD_MIN.to_bits()
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(steps: &usize) -> bool {
    *steps == 0
}

impl SacConfig {
    /// Number of values of an action.
    pub fn actions(&self) -> usize {
        self.action_min.len()
    }

    /// Channels of a stack.
    pub fn channels(&self) -> usize {
        3 * self.stack
    }
}
