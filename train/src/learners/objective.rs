//! The objective `L` that the world model is trained to maximise (equation 1, Algorithm 1 lines 11–15). In: a scene of latents, predictions and rewards.
//! Out: one number to maximise, and the log-likelihoods it is made of.
//!
//! # To add an objective
//! One file beside `vibes.rs`, with a unit struct that implements [`Definition`], and one line in [`REGISTRY`]. The definition says everything
//! about itself: its name and the line of help that is shown for it, options of its own (they become flags, entries of `config.toml` and defaults without another
//! line elsewhere), the networks it needs beside encoder, dynamics and reward, whether the encoder waits for the reward before the dynamics term reaches it,
//! how many pictures it puts through convolutions (for `vibes-train bench`), and its value. Nothing elsewhere asks which objective is trained. A network
//! with a step of its own (as the adversary) takes that step inside [`Definition::value`], with what [`Rival`] hands it.
//!
//! The tests of the training loop run over the registry: a new objective is tested for learning, for going on byte for byte and for diverging cleanly
//! without a new test.

use std::fmt;
use std::str::FromStr;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use vibes_model::adversary::Adversary;
use vibes_model::gaussian::LatentForm;
use vibes_model::numbers::NumberConfig;
use vibes_model::{HeadConfig, World};

use super::optimizer::Optimizer;
use super::scene::Scene;
use crate::error::{Result, TrainError};
use crate::settings::Settings;
use crate::settings::own::Declared;

pub mod action_baseline;
pub mod contrastive;
pub mod dbc;
pub mod deepmdp;
pub mod kl_constraint;
pub mod mico;
pub mod multi_step_inverse;
pub mod no_adversary;
pub mod reconstruction;
pub mod self_prediction;
pub mod simsr;
pub mod steps;
pub mod vibes;

/// Every objective; the first is the default.
pub const REGISTRY: [&dyn Definition; 11] = [
    &vibes::Vibes,
    &no_adversary::NoAdversary,
    &reconstruction::Reconstruction,
    &deepmdp::DeepMdp,
    &kl_constraint::KlConstraint,
    &multi_step_inverse::MultiStepInverse,
    &self_prediction::SelfPrediction,
    &contrastive::Contrastive,
    &dbc::Dbc,
    &mico::Mico,
    &simsr::SimSr,
];

/// What an objective says about itself.
pub trait Definition: fmt::Debug + Sync {
    /// Its name on the command line and in files.
    fn name(&self) -> &'static str;

    /// What it is, in a line of help.
    fn about(&self) -> &'static str;

    /// Options that nothing else has.
    fn options(&self) -> &'static [Declared] {
        &[]
    }

    /// Options that it looks at: its own, and those that it shares with another.
    fn reads(&self) -> &'static [Declared] {
        self.options()
    }

    /// The option that says how many rows after a row it needs in the same window, where it needs any.
    fn steps(&self) -> Option<&'static Declared> {
        None
    }

    /// Whether the gradient of the dynamics term reaches the latents, as much of it as `--dynamics-weight` says. Where the dynamics are fitted on latents that they do not move, or shape
    /// them by a term of their own, that option has no effect.
    fn dynamics_shape_latents(&self) -> bool {
        false
    }

    /// The networks it needs beside encoder, dynamics and reward; `actions` is the number of values of an action.
    fn networks(&self, options: &Settings, actions: usize) -> Networks;

    /// What must have been learned before the dynamics term's gradient reaches the encoder; without a condition it does from the first update on.
    fn gate(&self, _options: &Settings) -> Option<Condition> {
        None
    }

    /// Whether the preset `small` adds its recipe: for the paper's objective, with and without the adversary; what reconstructs pictures holds
    /// all of the state as it is.
    fn takes_recipe(&self) -> bool {
        false
    }

    /// The world model with the first scale of this objective's own heads set by data; `rewards` are those of some windows.
    fn calibrated(&self, world: World, _rewards: &[f32]) -> World {
        world
    }

    /// Pictures that go through convolutions for one window of `length` rows.
    fn pictures(&self, length: usize) -> Pictures;

    /// The value, after whatever step comes before the world model's; `rng` is for what it draws.
    ///
    /// # Errors
    /// The batch does not fit the networks, or a quantity is no longer a number.
    fn value(&self, scene: &Scene<'_>, rival: Rival<'_>, rng: &mut ChaCha8Rng) -> Result<Value>;

    /// Whether the rewards' gradient reaches the latents.
    fn rewards_shape_latents(&self) -> bool {
        true
    }
}

/// Networks beside encoder, dynamics and reward.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Networks {
    /// The adversary, with an optimiser of its own.
    pub adversary: bool,
    /// The decoder of observations.
    pub decoder: bool,
    /// Perceptrons of the world model, found by name with `World::head`.
    pub heads: Vec<HeadConfig>,
    /// Numbers of the world model, found by name with `World::number`.
    pub numbers: Vec<NumberConfig>,
    /// Whether latents have unit norm.
    pub latents: LatentForm,
    /// Whether the encoder sees no actions.
    pub blind_to_actions: bool,
}

/// When the dynamics term begins to reach the encoder (see [`gate`](crate::gate)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// The first update at which it may.
    pub start: u64,
    /// Nats by which the reward must be predicted better than the objective's [baseline](Value::reward_baseline) predicts it; 0 or less for no such condition.
    pub gain: f64,
}

/// Pictures through convolutions, forward and backward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pictures {
    /// Through picture networks like the encoder's.
    pub encoded: usize,
    /// Through the decoder.
    pub decoded: usize,
}

/// A network that learns beside the world model, and what it takes its step with.
#[derive(Debug)]
pub struct Rival<'a> {
    /// The adversary, where [`Networks::adversary`] asked for one.
    pub adversary: &'a mut Option<Adversary>,
    /// Its Adam.
    pub optimizer: &'a mut Optimizer,
}

/// The value of an objective and what it is made of. Log-likelihoods are nats a row that counts.
#[derive(Debug, Clone)]
pub struct Value {
    /// To be maximised: `[1]`
    pub objective: Tensor<1>,
    /// Log-likelihood of the latents under the dynamics: `[1]`
    pub dynamics: Tensor<1>,
    /// Log-likelihood of the rewards: `[1]`
    pub reward: Tensor<1>,
    /// Log-likelihood of the rewards under what the [gate](Definition::gate) compares with: `[1]`
    pub reward_baseline: Option<Tensor<1>>,
    /// Further numbers for the metrics, by the names they have there: `[1]`
    pub stated: Vec<(&'static str, Tensor<1>)>,
}

impl Value {
    /// The terms that all objectives share: reward by its weight and dynamics, sums over rows, divided by `count`.
    pub fn of(dynamics_term: Tensor<1>, dynamics: Tensor<1>, reward: Tensor<1>, scene: &Weights) -> Self {
        Self {
            objective: (dynamics_term + reward.clone() * scene.reward) / scene.count,
            dynamics: dynamics / scene.count,
            reward: reward / scene.count,
            reward_baseline: None,
            stated: Vec::new(),
        }
    }
}

/// What sums over rows are weighted and divided by.
#[derive(Debug, Clone, Copy)]
pub struct Weights {
    /// Weight of the reward term.
    pub reward: f32,
    /// Rows that count.
    pub count: f32,
}

impl Weights {
    /// Those of a scene.
    pub fn of(scene: &Scene<'_>) -> Self {
        Self { reward: scene.schedule.reward_weight, count: scene.predictions.count }
    }
}

/// A chosen objective: its definition, written and read by name.
#[derive(Debug, Clone, Copy)]
pub struct Objective(&'static dyn Definition);

impl Objective {
    /// Every objective.
    pub fn all() -> impl Iterator<Item = Self> {
        REGISTRY.into_iter().map(Self)
    }
}

impl Default for Objective {
    fn default() -> Self {
        Self(REGISTRY[0])
    }
}

impl std::ops::Deref for Objective {
    type Target = dyn Definition;

    fn deref(&self) -> &Self::Target {
        self.0
    }
}

impl PartialEq for Objective {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Objective {
    type Err = TrainError;

    fn from_str(text: &str) -> Result<Self> {
        Self::all().find(|objective| objective.name() == text).ok_or_else(|| {
            let names: Vec<&str> = REGISTRY.iter().map(|definition| definition.name()).collect();
            TrainError::Options(format!("no objective `{text}`; there are {}", names.join(", ")))
        })
    }
}

impl Serialize for Objective {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Objective {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests;
