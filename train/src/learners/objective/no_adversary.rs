//! The ablation "No Adv.": the dynamics' log-likelihood stands alone, without an adversary to compare it with and so without clipping. No adversary is
//! built or run for it.
//!
//! ```text
//! L = 1/(T B) Σ_t Σ_b [ log p_θ(s_t | h_t−1, s_t−1, a_t−1) + log p_θ(r_t | s_t, a_t) ]
//! ```
//!
//! It does not wait for the reward, as the paper does not. `vibes` does here, so that the two differ in the wait too; with [`WAIT`] they differ in the adversary alone.

use rand_chacha::ChaCha8Rng;
use vibes_model::World;

use super::action_baseline::ActionBaseline;
use super::{Condition, Definition, Networks, Pictures, Rival, Value, Weights};
use crate::error::Result;
use crate::learners::scene::{Predictions, Scene};
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// Whether it waits as `vibes` does.
pub const WAIT: Declared = Declared {
    flag: "wait",
    kind: Kind::Choice { default: "no", among: &["no", "yes"] },
    help: "Whether the dynamics term waits for the reward as with --objective vibes, by --dynamics-start and --dynamics-after (only with --objective no-adversary)",
};

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

    fn options(&self) -> &'static [Declared] {
        &[WAIT]
    }

    fn dynamics_shape_latents(&self) -> bool {
        true
    }

    fn networks(&self, options: &Settings, actions: usize) -> Networks {
        let baseline = self.gate(options).filter(|condition| condition.gain > 0.0);
        Networks { heads: baseline.map(|_| ActionBaseline::head(actions)).into_iter().collect(), ..Networks::default() }
    }

    fn gate(&self, options: &Settings) -> Option<Condition> {
        let waits = options.own.text(&WAIT) == "yes";
        waits.then_some(Condition { start: options.dynamics_start, gain: options.dynamics_after })
    }

    fn calibrated(&self, world: World, rewards: &[f32]) -> World {
        ActionBaseline::calibrated(world, rewards)
    }

    fn takes_recipe(&self) -> bool {
        true
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let value = value(&scene.predictions, Weights::of(scene));
        match self.gate(scene.options).filter(|condition| condition.gain > 0.0) {
            Some(_) => ActionBaseline::add(scene, value),
            None => Ok(value),
        }
    }
}

/// The value of the objective.
pub fn value(predictions: &Predictions, weights: Weights) -> Value {
    let dynamics = predictions.latent_log_prob(&predictions.dynamics).sum();
    Value::of(dynamics.clone(), dynamics, predictions.reward_log_prob(), &weights)
}
