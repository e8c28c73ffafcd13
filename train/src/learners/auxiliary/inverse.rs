//! Which action was taken, told from where one stood and where one was `k` steps later. The paper lacks it.
//!
//! ```text
//! 1/N Σ_t log p(a_t | h_t, s_t, s_t+k, k),   k drawn from 1..K at every update
//! ```
//!
//! Reward and values are the same for a state and its mirror image, so the paper's two terms need the action's effect to tell the two apart, and what one step of it shows
//! is soon outweighed by what each held dimension costs the dynamics. This term rewards latents from which the action can be read. Its effect in the picture is one way to it: position and velocity of
//! whatever actions move, and nothing of what they do not (a target, a video), so the term stands beside the reward and never in its place.
//!
//! Memory is another way. The encoder's GRU takes in the action before each picture, so `s_t+k` has seen `a_t` for every k from 1 on, and an encoder that remembers its actions can answer without looking at
//! a picture. The objective `multi-step-inverse` keeps all actions from its encoder for this reason; this term does not, because it stands beside objectives whose encoder sees them. So what a
//! latent holds says something of the term only where it is more than past actions alone tell; gains that were measured over that control hold.
//!
//! Multi-step inverse models are known from AC-State (arXiv 2207.08229) and ACRO (arXiv 2211.00164).

use burn::tensor::{Tensor, TensorData, activation::softplus};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;
use vibes_model::gaussian::log_prob;

use super::Auxiliary;
use crate::error::Result;
use crate::learners::rollout::rows;
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The term.
#[derive(Debug)]
pub struct Inverse;

/// Weight of the term.
pub const WEIGHT: Declared = Declared {
    flag: "inverse-weight",
    kind: Kind::Number { default: 0.0 },
    help: "Weight of predicting the action from (h, s) and the latent some steps later; the encoder takes that action in on the way, so that remembering it can stand in for seeing its effect; 0 leaves it out (the paper lacks it)",
};

/// Most steps between the two latents.
pub const STEPS: Declared = Declared {
    flag: "inverse-steps",
    kind: Kind::Whole { default: 5 },
    help: "Most steps between the two latents of --inverse-weight",
};

/// Least standard deviation of a predicted action, whose range is −1..1.
const FLOOR: f32 = 0.1;
const HEAD: &str = "inverse";

impl Auxiliary for Inverse {
    fn metric(&self) -> &'static str {
        "inverse_log_likelihood"
    }

    fn options(&self) -> &'static [Declared] {
        &[WEIGHT, STEPS]
    }

    fn weight(&self, options: &Settings) -> f64 {
        options.own.number(&WEIGHT)
    }

    fn head(&self, options: &Settings, actions: usize) -> Option<HeadConfig> {
        let input = options.hidden + 2 * options.latent + most_steps(options);
        Some(HeadConfig { name: HEAD.to_owned(), input, output: 2 * actions })
    }

    fn steps(&self) -> Option<&'static Declared> {
        Some(&STEPS)
    }

    fn value(&self, scene: &Scene<'_>, rng: &mut ChaCha8Rng) -> Result<Tensor<1>> {
        let most = most_steps(scene.options);
        let steps = rng.random_range(1..=most);
        let starts = scene.batch.length - steps;
        let [_, batch, actions] = scene.batch.actions.dims();
        let count = starts * batch;
        let one_hot: Vec<f32> = (0..count * most).map(|at| if at % most + 1 == steps { 1.0 } else { 0.0 }).collect();
        let distance = Tensor::<3>::from_data(TensorData::new(one_hot, [1, count, most]), &scene.latents.device());
        let now = rows(&scene.latents, 0, starts);
        let features = vec![rows(scene.states(), 0, starts), now, rows(&scene.latents, steps, starts), distance];
        let output = scene.world.head(HEAD)?.forward(Tensor::cat(features, 2));
        let std = softplus(output.clone().narrow(2, actions, actions), 1.0) + FLOOR;
        let log_prob = log_prob(rows(&scene.batch.actions, 0, starts), output.narrow(2, 0, actions), std);
        let counted = rows(&scene.batch.counted, 0, starts);
        Ok((log_prob * counted.clone()).sum() / counted.sum().clamp_min(1.0))
    }
}

fn most_steps(options: &Settings) -> usize {
    options.own.whole(&STEPS) as usize
}
