//! Terms that may stand beside any objective of the world model: what forces the latents to hold more than one step of the paper's two terms does. In: a scene.
//! Out: a log-likelihood, added to the objective by its weight. The paper has none of them; each file says why it is here.
//!
//! To add one: a file beside `inverse.rs` with a unit struct that implements [`Auxiliary`], and one line in [`REGISTRY`]. Its options become flags and entries
//! of `config.toml`, its head is built, saved and trained with the world model, and its log-likelihood is in the metrics under its name.

use std::fmt;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;

use super::scene::Scene;
use crate::error::Result;
use crate::settings::Settings;
use crate::settings::own::Declared;

pub mod inverse;
pub mod latent_ahead;
pub mod reward_ahead;

/// Every auxiliary term.
pub const REGISTRY: [&dyn Auxiliary; 3] = [&inverse::Inverse, &reward_ahead::RewardAhead, &latent_ahead::LatentAhead];

/// What a term says about itself.
pub trait Auxiliary: fmt::Debug + Sync {
    /// The name of its log-likelihood in the metrics.
    fn metric(&self) -> &'static str;

    /// Its options.
    fn options(&self) -> &'static [Declared];

    /// Its weight in the objective; at 0 it is neither built nor computed.
    fn weight(&self, options: &Settings) -> f64;

    /// The head it needs, if it needs one; `actions` is the number of values of an action.
    fn head(&self, _options: &Settings, _actions: usize) -> Option<HeadConfig> {
        None
    }

    /// The option that says how many rows after a row it needs in the same window, where it needs any.
    fn steps(&self) -> Option<&'static Declared> {
        None
    }

    /// Whether these steps are those of the [rollout](crate::learners::rollout): ahead of a row without pictures.
    fn rolls(&self) -> bool {
        false
    }

    /// Whether its weight rises from 0 together with the dynamics term's. What asks the latents to be foreseen pulls them to one point as long as they
    /// hold nothing of the reward.
    fn waits(&self) -> bool {
        false
    }

    /// Its log-likelihood, nats a row, to be maximised: `[1]`
    ///
    /// # Errors
    /// The model has no head for it.
    fn value(&self, scene: &Scene<'_>, rng: &mut ChaCha8Rng) -> Result<Tensor<1>>;
}

/// The terms that these options ask for.
pub fn asked(options: &Settings) -> impl Iterator<Item = &'static dyn Auxiliary> + '_ {
    REGISTRY.into_iter().filter(|term| term.weight(options) > 0.0)
}

/// How far ahead each of the terms asked for looks without pictures, where it does.
pub fn reaches(options: &Settings) -> Vec<usize> {
    let steps = asked(options).filter(|term| term.rolls()).filter_map(Auxiliary::steps);
    steps.map(|steps| options.own.whole(steps) as usize).collect()
}

#[cfg(test)]
mod tests;
