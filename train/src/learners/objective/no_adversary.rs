//! The ablation "No Adv.": the dynamics' log-likelihood stands alone, without an adversary to compare it with and so without clipping. No adversary is
//! built or run for it.
//!
//! ```text
//! L = 1/(T B) Σ_t Σ_b [ log p_θ(s_t | h_t−1, s_t−1, a_t−1) + log p_θ(r_t | s_t, a_t) ]
//! ```

use rand_chacha::ChaCha8Rng;

use super::{Definition, Networks, Pictures, Rival, Value, Weights};
use crate::error::Result;
use crate::learners::scene::{Predictions, Scene};
use crate::settings::Settings;

/// The ablation without an adversary.
#[derive(Debug)]
pub struct NoAdversary;

impl Definition for NoAdversary {
    fn name(&self) -> &'static str {
        "no-adversary"
    }

    fn about(&self) -> &'static str {
        "the next latent and the reward are predicted, without an adversary: the paper's ablation \"No Adv.\""
    }

    fn networks(&self, _options: &Settings, _actions: usize) -> Networks {
        Networks::default()
    }

    fn takes_recipe(&self) -> bool {
        true
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        Ok(value(&scene.predictions, Weights::of(scene)))
    }
}

/// The value of the objective.
pub fn value(predictions: &Predictions, weights: Weights) -> Value {
    let dynamics = predictions.latent_log_prob(&predictions.dynamics).sum();
    Value::of(dynamics.clone(), dynamics, predictions.reward_log_prob(), &weights)
}
