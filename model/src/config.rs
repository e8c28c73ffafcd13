//! The sizes and constants of a model: everything needed to build it anew before its weights are read. Saved inside every checkpoint.

use serde::{Deserialize, Serialize};

use crate::actions::ActionDistribution;
use crate::gaussian::LatentForm;
use crate::heads::HeadConfig;
use crate::numbers::NumberConfig;
use crate::values::ValueDistribution;

/// What the model looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum ObservationKind {
    /// RGB pictures.
    Pixels {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// The task's vector observation; a perceptron takes the place of the picture network, nothing else changes.
    Vector {
        /// Number of values.
        len: usize,
    },
}

impl std::fmt::Display for ObservationKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Pixels { height, width } => write!(f, "pixels of {height}×{width}"),
            Self::Vector { len } => write!(f, "observation vectors of {len}"),
        }
    }
}

/// Sizes and constants of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelConfig {
    /// The task it was made for.
    pub task: String,
    /// What it looks at.
    pub observation: ObservationKind,
    /// Lower bounds of the action; actions enter the networks scaled to −1..1.
    pub action_min: Vec<f32>,
    /// Upper bounds of the action.
    pub action_max: Vec<f32>,
    /// Channels after the first convolution. Open in the paper; 32 is Dreamer's.
    pub depth: usize,
    /// Width of features and hidden states. Open in the paper.
    pub hidden: usize,
    /// Width of the heads' hidden layers. Open in the paper.
    pub head: usize,
    /// Dimensions of the latent. Open in the paper.
    pub latent: usize,
    /// Standard deviation of the encoder, fixed (0.1: variance 0.01, Appendix C).
    pub latent_std: f32,
    /// Least standard deviation of the dynamics and the adversary. Open in the paper. A latent carries noise of `latent_std`, so no
    /// predictor of it can be surer than that and a lower floor would only let the likelihood explode.
    pub prediction_floor: f32,
    /// Least standard deviation of the reward, in units of reward. Open in the paper.
    pub reward_floor: f32,
    /// One unit of the reward model's output, in units of reward. Open in the paper; 1 in checkpoints that do not say.
    #[serde(default = "one")]
    pub reward_scale: f32,
    /// First value of the update gates' bias, added to the random one: above 0 the hidden states begin with a longer memory. The paper lacks it.
    #[serde(default)]
    pub gru_update_bias: f32,
    /// Whether there is an adversary (objective `vibes`).
    pub adversary: bool,
    /// Whether there is a decoder (objective `reconstruction`).
    pub decoder: bool,
    /// Further heads of the world model, which objectives and auxiliary terms ask for.
    #[serde(default)]
    pub heads: Vec<HeadConfig>,
    /// Further numbers of the world model that are learned like weights.
    #[serde(default)]
    pub numbers: Vec<NumberConfig>,
    /// Whether latents have unit norm, as in the paper.
    #[serde(default)]
    pub latents: LatentForm,
    /// Whether the encoder sees no actions: for objectives whose answer it would else hand over from its memory. The paper's encoder sees them.
    #[serde(default)]
    pub blind_to_actions: bool,
}

fn one() -> f32 {
    1.0
}

impl ModelConfig {
    /// Number of values of an action.
    pub fn actions(&self) -> usize {
        self.action_min.len()
    }
}

/// What actor and critic are made of, beside the model they act in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BehaviourConfig {
    /// The actor's distribution.
    pub actions: ActionDistribution,
    /// The critic's distribution.
    pub values: ValueDistribution,
    /// Width of the hidden layers of both.
    pub hidden: usize,
}
