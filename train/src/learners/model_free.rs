//! The learners without a world model's imagination, as the loop sees them. In: a system's name, windows of a replay. Out: a learner after its update, an agent that acts with
//! its weights. The one place that tells their families apart.

use std::path::Path;

use burn::tensor::Device;
use rand::Rng;
use serde::{Deserialize, Serialize};
use vibes_data::{Spec, WindowBatch};
use vibes_model::cnn::CnnConfig;
use vibes_model::recurrent::networks::FILE as RECURRENT;
use vibes_model::recurrent::{RecurrentAgent, RecurrentNetworks};
use vibes_model::sac::features::Convolutions;
use vibes_model::sac::{SacAgent, SacConfig, SacNetworks};
use vibes_model::trained::ModelFreeAgent;

use super::recurrent::options::{RecurrentOptions, SYSTEMS as RECURRENT_SYSTEMS};
use super::recurrent::update::RecurrentLearner;
use super::sac::options::{SYSTEMS, SacOptions, Size};
use super::sac::transitions::{Transitions, window_length};
use super::sac::update::{SacLearner, SacMeasures};
use crate::error::{Result, TrainError};

/// The options of an agent of either family.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum AgentOptions {
    /// Stacks of pictures.
    Stacks(SacOptions),
    /// A GRU.
    Recurrent(RecurrentOptions),
}

/// The names of all systems.
pub fn system_names() -> Vec<&'static str> {
    let stacks = SYSTEMS.iter().map(|(name, _)| *name);
    stacks.chain(RECURRENT_SYSTEMS.iter().map(|(name, _)| *name)).collect()
}

impl AgentOptions {
    /// The options of a system at a size.
    ///
    /// # Errors
    /// An unknown name; the message lists what there is.
    pub fn system(name: &str, size: Size) -> Result<Self> {
        if let Some(options) = RecurrentOptions::system(name, size) {
            return Ok(Self::Recurrent(options));
        }
        match SacOptions::system(name, size) {
            Ok(options) => Ok(Self::Stacks(options)),
            Err(_unknown) => {
                let names = system_names().join(", ");
                Err(TrainError::Options(format!("no system `{name}`; there are {names}")))
            }
        }
    }

    /// These for a run that was begun with `found`, whose numbers that no option says stay, of systems that look at stacks.
    #[must_use]
    pub fn going_on(self, found: &Self) -> Self {
        match (self, found) {
            (Self::Stacks(asked), Self::Stacks(found)) => Self::Stacks(asked.going_on(found)),
            (asked, _) => asked,
        }
    }

    /// Whether there is an actor; without one the best action is searched for.
    pub fn has_actor(&self) -> bool {
        match self {
            Self::Stacks(options) => options.actor,
            Self::Recurrent(_) => true,
        }
    }

    /// Rows of a window, and windows of a batch.
    pub fn windows(&self) -> [usize; 2] {
        match self {
            Self::Stacks(options) => [window_length(options.stack, options.auxiliary.sequence()), options.batch],
            Self::Recurrent(options) => [options.length, options.windows],
        }
    }

    /// Discount of an agent step.
    pub fn discount(&self) -> f64 {
        match self {
            Self::Stacks(options) => options.discount,
            Self::Recurrent(options) => options.discount,
        }
    }

    /// That the networks can look at a task's pictures: to be known before anything is begun.
    ///
    /// # Errors
    /// The task is seen through vectors, or its pictures are too small.
    pub fn check_pictures(&self, spec: &Spec) -> Result<()> {
        let picture = picture(spec)?;
        match self {
            Self::Stacks(options) => {
                Convolutions::width(&of_stacks(options, spec, picture))?;
            }
            Self::Recurrent(options) => {
                let [height, width] = options.augment.size(picture);
                CnnConfig { height, width, depth: options.depth, output: options.memory }.maps()?;
            }
        }
        Ok(())
    }

    /// New networks for a task's pictures and actions.
    ///
    /// # Errors
    /// The task is seen through vectors, or its pictures are too small.
    pub fn learner(&self, spec: &Spec, rng: &mut impl Rng, device: &Device) -> Result<ModelFreeLearner> {
        let picture = picture(spec)?;
        Ok(match self {
            Self::Stacks(options) => {
                let networks = SacNetworks::init(of_stacks(options, spec, picture), rng, device)?;
                ModelFreeLearner::Stacks(Box::new(SacLearner::new(networks, device)))
            }
            Self::Recurrent(options) => {
                let networks = RecurrentNetworks::init(options.networks(spec, picture), rng, device)?;
                ModelFreeLearner::Recurrent(Box::new(RecurrentLearner::new(networks, device)))
            }
        })
    }

    /// What its latents are, in words, and how many numbers.
    pub fn latents(&self) -> String {
        match self {
            Self::Stacks(options) => format!("features of the critics, {}", options.feature),
            Self::Recurrent(options) => format!("means of the encoder, {} (unit norm)", options.latent),
        }
    }
}

/// The networks that look at stacks of a task's pictures.
fn of_stacks(options: &SacOptions, spec: &Spec, picture: [usize; 2]) -> SacConfig {
    let bound = |bounds: &[f64]| bounds.iter().map(|&bound| bound as f32).collect();
    options.networks(&spec.task, picture, (bound(&spec.action.min), bound(&spec.action.max)))
}

/// Rows and columns of a task's pictures.
///
/// # Errors
/// It is seen through vectors.
pub fn picture(spec: &Spec) -> Result<[usize; 2]> {
    let size = spec.pixels.map(|size| [size.height as usize, size.width as usize]);
    size.ok_or_else(|| TrainError::Options("these agents see pictures; leave out --no-pixels".to_owned()))
}

/// A learner of either family.
#[derive(Debug, Clone)]
pub enum ModelFreeLearner {
    /// Stacks of pictures.
    Stacks(Box<SacLearner>),
    /// A GRU.
    Recurrent(Box<RecurrentLearner>),
}

impl ModelFreeLearner {
    /// Makes one update, after `made` others.
    ///
    /// # Errors
    /// A loss is no longer a number; the learner is gone then, and its last checkpoint is where to go on. Or the options are of the other family.
    pub fn update(
        self,
        windows: &WindowBatch,
        options: &AgentOptions,
        made: u64,
        rng: &mut impl Rng,
    ) -> Result<(Self, SacMeasures)> {
        match (self, options) {
            (Self::Stacks(learner), AgentOptions::Stacks(options)) => {
                let batch = Transitions::of_windows(windows, &learner.networks.config, rng)?;
                let (learner, measures) = learner.update(&batch, options, made, rng)?;
                Ok((Self::Stacks(Box::new(learner)), measures))
            }
            (Self::Recurrent(learner), AgentOptions::Recurrent(options)) => {
                let (learner, measures) = learner.update(windows, options, rng)?;
                Ok((Self::Recurrent(Box::new(learner)), measures))
            }
            _ => Err(TrainError::Options("the checkpoint is of another family of agents than the options".to_owned())),
        }
    }

    /// Who acts with these weights, which it copies.
    pub fn agent(&self, device: &Device) -> ModelFreeAgent {
        match self {
            Self::Stacks(learner) => ModelFreeAgent::Stacks(Box::new(SacAgent::new(&learner.networks, device))),
            Self::Recurrent(learner) => {
                ModelFreeAgent::Recurrent(Box::new(RecurrentAgent::new(&learner.networks, device)))
            }
        }
    }

    /// Writes everything that is needed to go on into a folder.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&self, folder: &Path) -> Result<()> {
        match self {
            Self::Stacks(learner) => learner.save(folder),
            Self::Recurrent(learner) => learner.save(folder),
        }
    }

    /// The learner that was saved there.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        Ok(if folder.join(RECURRENT).is_file() {
            Self::Recurrent(Box::new(RecurrentLearner::load(folder, device)?))
        } else {
            Self::Stacks(Box::new(SacLearner::load(folder, device)?))
        })
    }
}
