//! The small model that the tests of networks and devices share.

use vibes_model::gaussian::LatentForm;
use vibes_model::{ModelConfig, ObservationKind};

pub(crate) fn config(observation: ObservationKind) -> ModelConfig {
    ModelConfig {
        task: "made-up".to_owned(),
        observation,
        action_min: vec![-1.0, 0.0],
        action_max: vec![1.0, 4.0],
        depth: 4,
        hidden: 24,
        head: 16,
        latent: 6,
        latent_std: 0.1,
        prediction_floor: 0.1,
        reward_floor: 0.1,
        reward_scale: 1.0,
        gru_update_bias: 0.0,
        adversary: true,
        decoder: true,
        heads: Vec::new(),
        numbers: Vec::new(),
        latents: LatentForm::UnitNorm,
        blind_to_actions: false,
    }
}
