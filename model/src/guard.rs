//! A guard against a reward model that is believed where it has seen little: several small reward heads on the same input, each taught by a share of the episodes.
//! In: latents and actions. Out: how far the heads disagree. Where all have seen much they agree; where few have, each goes on in its own way. It keeps
//! its own file beside a model's, `guard.safetensors`, with the [`GuardConfig`] as JSON in its metadata.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::checkpoint::{load_described, save_described};
use crate::config::ModelConfig;
use crate::described::{Described, Matrix, must};
use crate::error::ModelError;
use crate::mlp::{Mlp, MlpConfig};
use crate::parameters::{read_parameters, write_parameters};

/// Width of the hidden layers of a member: an eighth or so of the reward model's, since there are several.
const WIDTH: usize = 64;
/// One head alone disagrees with none.
const LEAST_MEMBERS: usize = 2;
/// Below this, in units of the reward model's output, a disagreement is none: the root has a slope there.
const LEAST: f32 = 1e-4;

/// What a guard is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GuardConfig {
    /// Reward heads.
    pub members: usize,
    /// Seed of who learns from which episode.
    pub shares: u64,
}

/// The reward heads.
#[derive(Module, Debug)]
pub struct Members {
    /// (latent, action) to the mean reward, in units of the reward model's output.
    pub heads: Vec<Mlp>,
    #[module(skip)]
    scale: f32,
}

/// Reward heads, and which episodes each learns from.
#[derive(Debug, Clone)]
pub struct Guard {
    /// What it is made of.
    pub config: GuardConfig,
    /// The heads.
    pub members: Members,
}

impl Guard {
    /// He-initialised heads, and shares of the episodes, both drawn from `rng`. The last layers are not zeroed: heads that begin apart stay apart where nothing teaches them.
    pub fn init(model: &ModelConfig, members: usize, rng: &mut impl Rng, device: &Device) -> Self {
        let sizes = MlpConfig { input: model.latent + model.actions(), hidden: WIDTH, output: 1 };
        let heads = (0..members).map(|_| sizes.init(rng, device)).collect();
        let config = GuardConfig { members, shares: rng.random() };
        Self { config, members: Members { heads, scale: model.reward_scale } }
    }

    /// Whether each member learns from this episode: half of the members do, drawn anew for every episode and the same whenever it is replayed. Whole episodes, since the
    /// rows of one episode say nearly the same.
    pub fn learns_from(&self, episode: u32) -> Vec<bool> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.config.shares);
        rng.set_stream(u64::from(episode));
        (0..self.config.members).map(|_| rng.random()).collect()
    }

    /// The first weight that is no finite number, if there is one.
    pub fn first_not_finite(&self) -> Option<f32> {
        let tensors = read_parameters(&self.members, "guard");
        tensors.values().flat_map(|tensor| &tensor.values).copied().find(|weight| !weight.is_finite())
    }

    /// Writes it to a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        save_described(path, &read_parameters(&self.members, "guard"), ("config", &self.config))
    }

    /// Reads the file of a model's guard.
    ///
    /// # Errors
    /// The file is missing or damaged, or belongs to a model of other sizes.
    pub fn load(path: &Path, model: &ModelConfig, device: &Device) -> Result<Self, ModelError> {
        let (tensors, config): (_, GuardConfig) = load_described(path, "config")?;
        // The first values are overwritten, so any generator does.
        let first = Self::init(model, config.members, &mut ChaCha8Rng::seed_from_u64(0), device);
        Ok(Self { config, members: write_parameters(first.members, "guard", &tensors)? })
    }
}

impl Members {
    /// What each member expects, in units of the reward model's output.
    ///
    /// # Shapes
    /// - `latents`: `[length, batch, latent]`, `actions`: `[length, batch, A]`
    /// - output: `[length, batch, members]`
    pub fn expected(&self, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3> {
        let seen = Tensor::cat(vec![latents, actions], 2);
        Tensor::cat(self.heads.iter().map(|head| head.forward(seen.clone())).collect(), 2)
    }

    /// Standard deviation over the members of what they expect, in units of reward; gradients flow to latents and actions.
    ///
    /// # Shapes
    /// - `expected`: `[length, batch, members]`, see [`Members::expected`]
    /// - output: `[length, batch]`
    pub fn disagreement(&self, expected: Tensor<3>) -> Tensor<2> {
        let apart = expected.clone() - expected.mean_dim(2);
        let variance = apart.square().mean_dim(2).squeeze_dim::<2>(2);
        ((variance + LEAST * LEAST).sqrt() - LEAST) * self.scale
    }

    /// One unit of what [`Members::expected`] gives, in units of reward.
    pub fn scale(&self) -> f32 {
        self.scale
    }
}

impl Described for GuardConfig {
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_> {
        Box::new((0..self.members).map(|at| (format!("guard.heads.{at}.second.weight"), vec![WIDTH; 2])))
    }

    fn check_constants(&self) -> Result<(), String> {
        must(self.members >= LEAST_MEMBERS, "members", self.members, "be 2 or more")
    }
}

#[cfg(test)]
mod tests;
