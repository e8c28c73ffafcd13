//! The rewards of the next `K` steps, told from `(h_t, s_t)` and the actions taken, without a picture on the way. The paper lacks it.
//!
//! ```text
//! 1/(N K) Σ_t Σ_k log p_θ(r_t+k | ŝ_t+k, a_t+k),   ŝ from the dynamics run ahead under the recorded actions
//! ```
//!
//! A bisimulation implies it: where one step of latents and rewards is right, so are all. Learned from one step alone it comes late or not at all, because the side of a
//! pole, say, shows in the reward only some steps after the action.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;

use super::{Auxiliary, reaches};
use crate::error::Result;
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The term.
#[derive(Debug)]
pub struct RewardAhead;

/// How far ahead.
pub const STEPS: Declared = Declared {
    flag: "reward-steps",
    kind: Kind::Whole { default: 0 },
    help: "Steps ahead that rewards are predicted from (h, s) under the recorded actions; 0 leaves it out (the paper lacks it)",
};

/// Weight of the term.
pub const WEIGHT: Declared =
    Declared { flag: "reward-steps-weight", kind: Kind::Number { default: 0.3 }, help: "Weight of --reward-steps" };

impl Auxiliary for RewardAhead {
    fn metric(&self) -> &'static str {
        "reward_ahead_log_likelihood"
    }

    fn options(&self) -> &'static [Declared] {
        &[STEPS, WEIGHT]
    }

    fn weight(&self, options: &Settings) -> f64 {
        if options.own.whole(&STEPS) == 0 { 0.0 } else { options.own.number(&WEIGHT) }
    }

    fn waits(&self) -> bool {
        true
    }

    fn steps(&self) -> Option<&'static Declared> {
        Some(&STEPS)
    }

    fn rolls(&self) -> bool {
        true
    }

    fn value(&self, scene: &Scene<'_>, _rng: &mut ChaCha8Rng) -> Result<Tensor<1>> {
        let (rollout, reach) = (scene.rollout(&reaches(scene.options)), scene.options.own.whole(&STEPS) as usize);
        let actions = rollout.recorded(&scene.batch.actions, reach);
        let prediction = scene.world.reward.forward(rollout.ahead(reach).mean, actions);
        Ok(rollout.mean(prediction.log_prob(rollout.recorded(&scene.batch.rewards, reach)), reach))
    }
}
