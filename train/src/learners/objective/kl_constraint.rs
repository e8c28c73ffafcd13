//! The reward is predicted, and what the latents say beyond their prediction is held at a target (`RePo`, zchuning/repo).
//!
//! ```text
//! L = Σ log p(r_t | s_t, a_t) − β KL(N(e_t, σ²) | p(s_t | h_t)) ,   β rises while the divergence is above its target
//! ```
//!
//! Five sixths of the divergence's gradient go to the dynamics, one sixth to the encoder. The dual variable's logarithm takes Adam's steps like every other parameter, at
//! the run's rate; `RePo` gives it a third of that.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use vibes_model::numbers::NumberConfig;

use super::steps::Steps;
use super::{Definition, Networks, Pictures, Rival, Value, Weights, no_adversary};
use crate::error::Result;
use crate::learners::losses::kl_constraint::{Beliefs, dual_loss};
use crate::learners::scene::{Predictions, Scene};
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The objective.
#[derive(Debug)]
pub struct KlConstraint;

/// The divergence that is allowed.
pub const TARGET: Declared = Declared {
    flag: "kl-target",
    kind: Kind::Number { default: 3.0 },
    help: "Divergence of a latent from its prediction that is aimed at, in nats a row (kl-constraint; RePo has 3)",
};

/// First value of the dual variable, as its logarithm: `RePo`'s 1e-5.
const LOG_BETA: f32 = -11.512_925;
const NUMBER: &str = "log beta";

impl Definition for KlConstraint {
    fn name(&self) -> &'static str {
        "kl-constraint"
    }

    fn about(&self) -> &'static str {
        "the reward is predicted, and the latents' divergence from their prediction is held at a target (RePo)"
    }

    fn options(&self) -> &'static [Declared] {
        &[TARGET]
    }

    fn networks(&self, _options: &Settings, _actions: usize) -> Networks {
        Networks { numbers: vec![NumberConfig { name: NUMBER.to_owned(), start: LOG_BETA }], ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let before_last = |x: &Tensor<3>| x.clone().narrow(0, 0, scene.batch.length - 1);
        let (prior, _) =
            scene.world.dynamics.forward(before_last(&scene.latents), before_last(&scene.batch.actions), None);
        let beliefs = Beliefs {
            mean: steps.next.clone(),
            std: scene.config.latent_std,
            prior_mean: steps.choose(prior.mean.clone()),
            prior_std: steps.choose(prior.std.clone()),
        };
        let divergence = beliefs.balanced_divergence().mean();
        let log_beta = scene.world.number(NUMBER)?;
        let dual = dual_loss(log_beta.clone(), divergence.clone(), scene.options.own.number(&TARGET) as f32);
        let held = divergence.clone() * log_beta.clone().detach().exp();
        // What is reported of the dynamics is their log-likelihood, as everywhere; the divergence takes its place in the objective.
        let reported =
            no_adversary::value(&Predictions { dynamics: prior, ..scene.predictions.clone() }, Weights::of(scene));
        let weight = scene.schedule.reward_weight;
        Ok(Value {
            objective: reported.reward.clone() * weight - held - dual,
            stated: vec![("divergence", divergence), ("log_beta", log_beta)],
            ..reported
        })
    }
}
