//! What a recurrent agent can be asked for, and its systems by name. In: a system's name, a size. Out: options. Constants are those of apple/ml-core (configs/dcs/core.yaml).

use serde::{Deserialize, Serialize};
use vibes_data::Spec;
use vibes_model::gaussian::LatentForm;
use vibes_model::numbers::NumberConfig;
use vibes_model::recurrent::RecurrentConfig;
use vibes_model::{HeadConfig, ModelConfig, ObservationKind};

use crate::learners::sac::augment::Augment;
use crate::learners::sac::options::Size;

/// The head that predicts the next picture's features from the prior.
pub const NEXT_FEATURE: &str = "next feature";
/// The head that predicts the reward that led to a state.
pub const REWARD: &str = "reward before";
/// The head that predicts the action between two states.
pub const ACTION: &str = "action between";
/// The number that the contrast's logits are scaled by.
pub const SHARPNESS: &str = "contrast temperature";

/// The resolved options of a recurrent agent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecurrentOptions {
    /// How pictures are varied, alike over a window.
    pub augment: Augment,
    /// Windows a batch.
    pub windows: usize,
    /// Rows of a window.
    pub length: usize,
    /// Channels after the first convolution.
    pub depth: usize,
    /// Width of the features and of both hidden states.
    pub memory: usize,
    /// Width of the latents.
    pub latent: usize,
    /// Width of the perceptrons of the losses beside the critics'.
    pub head: usize,
    /// Width of the hidden layers of actor and critics.
    pub hidden: usize,
    /// Weight of the next feature's contrast; of the rewards; of the actions between two states; of the latents' divergence from the dynamics.
    pub contrast_weight: f64,
    /// Weight of the reward's loss.
    pub reward_weight: f64,
    /// Weight of the loss of the action between two states.
    pub inverse_weight: f64,
    /// Weight of the latents' divergence from what the dynamics predict.
    pub divergence_weight: f64,
    /// Nats of that divergence that cost nothing.
    pub free_nats: f64,
    /// Weight of the critics' loss, whose gradient enters the encoder.
    pub critic_weight: f64,
    /// Adam's step size for critics and actor.
    pub lr: f64,
    /// Adam's step size for encoder, dynamics and heads.
    pub model_lr: f64,
    /// Adam's step size for the temperature.
    pub temperature_lr: f64,
    /// Discount of an agent step.
    pub discount: f64,
    /// Share of the way that the slow critics go at every update.
    pub slow_rate: f64,
}

/// A recurrent system's name and its options.
pub type RecurrentSystem = (&'static str, fn() -> RecurrentOptions);

/// The systems by name.
pub const SYSTEMS: [RecurrentSystem; 2] = [("rsac", rsac), ("core", core)];

impl RecurrentOptions {
    /// The options of a system at a size; none if there is no such system.
    pub fn system(name: &str, size: Size) -> Option<Self> {
        let (_, options) = SYSTEMS.iter().find(|(system, _)| *system == name)?;
        let options = options();
        Some(match size {
            Size::Paper => options,
            Size::Small => {
                Self { windows: 8, length: 16, depth: 16, memory: 128, latent: 32, head: 128, hidden: 256, ..options }
            }
        })
    }

    /// Whether anything stands beside the critics' loss.
    pub fn has_model_losses(&self) -> bool {
        [self.contrast_weight, self.reward_weight, self.inverse_weight, self.divergence_weight].iter().any(|&w| w > 0.0)
    }

    /// The networks these options ask for, for pictures and actions of a task.
    pub fn networks(&self, spec: &Spec, picture: [usize; 2]) -> RecurrentConfig {
        let [height, width] = self.augment.size(picture);
        let bound = |bounds: &[f64]| bounds.iter().map(|&bound| bound as f32).collect::<Vec<_>>();
        let (state, actions) = (self.memory + self.latent, spec.action.min.len());
        let head = |name: &str, input, output| HeadConfig { name: name.to_owned(), input, output };
        let model = ModelConfig {
            task: spec.task.clone(),
            observation: ObservationKind::Pixels { height, width },
            action_min: bound(&spec.action.min),
            action_max: bound(&spec.action.max),
            depth: self.depth,
            hidden: self.memory,
            head: self.head,
            latent: self.latent,
            latent_std: 0.1,
            prediction_floor: 0.1,
            reward_floor: 0.1,
            reward_scale: 1.0,
            gru_update_bias: -1.0,
            adversary: false,
            decoder: false,
            heads: vec![
                head(NEXT_FEATURE, self.latent, self.memory),
                head(REWARD, state, 1),
                head(ACTION, 2 * state, actions),
            ],
            numbers: vec![NumberConfig { name: SHARPNESS.to_owned(), start: 1.0 }],
            latents: LatentForm::UnitNorm,
            blind_to_actions: false,
        };
        RecurrentConfig { model, picture, hidden: self.hidden }
    }
}

fn core() -> RecurrentOptions {
    RecurrentOptions {
        augment: Augment::Crop,
        windows: 32,
        length: 32,
        depth: 32,
        memory: 200,
        latent: 64,
        head: 256,
        hidden: 1024,
        contrast_weight: 1.0,
        reward_weight: 1.0,
        inverse_weight: 1.0,
        divergence_weight: 0.01,
        free_nats: 1.0,
        critic_weight: 0.5,
        lr: 1e-3,
        model_lr: 3e-4,
        temperature_lr: 1e-3,
        discount: 0.99,
        slow_rate: 0.005,
    }
}

/// `CoRe`'s own ablation: every loss but the critics' left out.
fn rsac() -> RecurrentOptions {
    RecurrentOptions { contrast_weight: 0.0, reward_weight: 0.0, inverse_weight: 0.0, divergence_weight: 0.0, ..core() }
}
