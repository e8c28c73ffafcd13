//! The latents of the next `K` steps, told from `(h_t, s_t)` and the actions taken, without a picture on the way. The paper predicts one step.
//!
//! ```text
//! 1/(N K) Σ_t Σ_k log p_θ(s_t+k | h_t+k run ahead under the recorded actions),   targets s_t+k without gradient
//! ```
//!
//! The targets are held fixed, as in self-predictive representations (SPR, TD-MPC): the term asks the start to hold what its future needs, and never asks the
//! future to be easier to predict.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;

use super::{Auxiliary, reaches};
use crate::error::Result;
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The term.
#[derive(Debug)]
pub struct LatentAhead;

/// How far ahead.
pub const STEPS: Declared = Declared {
    flag: "latent-steps",
    kind: Kind::Whole { default: 0 },
    help: "Steps ahead that latents are predicted from (h, s) under the recorded actions; 0 leaves it out (the paper predicts one)",
};

/// Weight of the term.
pub const WEIGHT: Declared =
    Declared { flag: "latent-steps-weight", kind: Kind::Number { default: 0.1 }, help: "Weight of --latent-steps" };

impl Auxiliary for LatentAhead {
    fn metric(&self) -> &'static str {
        "latent_ahead_log_likelihood"
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
        let targets = rollout.recorded(&scene.latents.clone().detach(), reach);
        Ok(rollout.mean(rollout.ahead(reach).log_prob(targets), reach))
    }
}
