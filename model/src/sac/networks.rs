//! All networks of a model-free agent in one place, and their file. In: sizes, or a checkpoint. Out: what a learner trains and an agent acts with.

use std::path::Path;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::{Rng, SeedableRng};

use super::actor::{LOG_STD_MAX, SoftActor};
use super::characteristic::Characteristic;
use super::config::{FILTERS, LAYERS, SacConfig};
use super::critic::TwinCritic;
use super::features::{orthogonal_linear, orthogonal_mlp};
use crate::checkpoint::{load_described, save_described};
use crate::described::{Described, Matrix, bounds, must, perceptron, product, sum, view};
use crate::error::ModelError;
use crate::init::constant;
use crate::kernels::{Instructions, conv3_size};
use crate::linear::Linear;
use crate::mlp::Mlp;
use crate::parameters::{HostTensors, read_parameters, write_parameters};

/// Their file in a checkpoint.
pub const FILE: &str = "sac.safetensors";
/// First temperature.
pub(crate) const TEMPERATURE: f32 = 0.1;

/// The weight of entropy, as its logarithm.
#[derive(Module, Debug)]
pub struct Temperature {
    /// `[1]`
    pub log: Param<Tensor<1>>,
}

/// A Gaussian model of the next features, and a model of the reward (`facebookresearch/deep_bisim4control`).
#[derive(Module, Debug)]
pub struct Transition {
    /// (features, action) to mean and spread of the next features.
    pub next: Mlp,
    /// Predicted next features to the reward.
    pub reward: Mlp,
}

/// What only some systems have beside critics and actor.
#[derive(Module, Debug)]
pub struct Further {
    /// CURL's bilinear form: `[feature, feature]`
    pub bilinear: Option<Linear>,
    /// Model of features and rewards.
    pub transition: Option<Transition>,
    /// SAR's head.
    pub characteristic: Option<Characteristic>,
}

/// A model-free agent's networks.
#[derive(Debug, Clone)]
pub struct SacNetworks {
    /// Sizes and constants.
    pub config: SacConfig,
    /// Convolutions and critics.
    pub critic: TwinCritic,
    /// Their slow copy, which targets and keys come from.
    pub slow: TwinCritic,
    /// None where the best action is searched for.
    pub actor: Option<SoftActor>,
    /// Weight of the actor's entropy.
    pub temperature: Temperature,
    /// The rest.
    pub further: Further,
}

impl SacNetworks {
    /// New networks with first values drawn from `rng`; the slow copy begins as the critics themselves.
    ///
    /// # Errors
    /// The pictures are too small, or the environment asks for instructions that there are not.
    pub fn init(config: SacConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        Instructions::asked()?;
        let critic = TwinCritic::init(&config, rng, device)?;
        let actor = config.search.is_none().then(|| SoftActor::init(&config, rng, device)).transpose()?;
        let (feature, hidden) = (config.feature, config.hidden);
        let bilinear = config.bilinear.then(|| orthogonal_linear([feature, feature], rng, device));
        let transition = config.transition.then(|| Transition {
            next: orthogonal_mlp([feature + config.actions(), hidden, 2 * feature], rng, device),
            reward: orthogonal_mlp([feature, hidden, 1], rng, device),
        });
        let steps = config.sequence;
        let characteristic = (steps > 0).then(|| Characteristic::init(&config, steps, rng, device));
        Ok(Self {
            slow: critic.clone(),
            critic,
            actor,
            temperature: Temperature { log: constant([1], TEMPERATURE.ln(), device) },
            further: Further { bilinear, transition, characteristic },
            config,
        })
    }

    /// All weights, the slow ones too, by the names they have in a file.
    pub fn parameters(&self) -> HostTensors {
        let mut tensors = read_parameters(&self.critic, "critic");
        tensors.extend(read_parameters(&self.slow, "slow"));
        tensors.extend(read_parameters(&self.temperature, "temperature"));
        tensors.extend(read_parameters(&self.further, "further"));
        if let Some(actor) = &self.actor {
            tensors.extend(read_parameters(actor, "actor"));
        }
        tensors
    }

    /// Writes them to a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        save_described(path, &self.parameters(), ("sac", &self.config))
    }

    /// Builds the networks a file describes and reads their weights.
    ///
    /// # Errors
    /// The file is missing, is not such a checkpoint, or its tensors do not fit its own description.
    pub fn load(path: &Path, device: &Device) -> Result<Self, ModelError> {
        let (tensors, config): (_, SacConfig) = load_described(path, "sac")?;
        // The first values are overwritten, so any generator does.
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
        let new = Self::init(config, &mut rng, device)?;
        Ok(Self {
            critic: write_parameters(new.critic, "critic", &tensors)?,
            slow: write_parameters(new.slow, "slow", &tensors)?,
            actor: new.actor.map(|actor| write_parameters(actor, "actor", &tensors)).transpose()?,
            temperature: write_parameters(new.temperature, "temperature", &tensors)?,
            further: write_parameters(new.further, "further", &tensors)?,
            config: new.config,
        })
    }
}

impl Described for SacConfig {
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_> {
        let (feature, steps) = (self.feature, self.sequence);
        // Pictures that are too small are refused when the networks are built.
        let maps = conv3_size(self.view, LAYERS).map_or(0, |[height, width]| product(&[height, width, FILTERS]));
        let mut all = vec![
            ("critic.convolutions.layers.0.weight".to_owned(), vec![FILTERS, product(&[3, self.stack]), 3, 3]),
            ("critic.trunk.linear.weight".to_owned(), vec![maps, feature]),
        ];
        all.extend(perceptron("critic.first", [sum(&[feature, self.actions()]), self.hidden, 1]));
        if self.bilinear {
            all.push(("further.bilinear.weight".to_owned(), vec![feature; 2]));
        }
        if steps > 0 {
            all.push(("further.characteristic.rewards.weight".to_owned(), vec![steps; 2]));
            all.push((
                "further.characteristic.actions.weight".to_owned(),
                vec![product(&[steps, self.actions()]), steps],
            ));
        }
        Box::new(all.into_iter())
    }

    fn check_constants(&self) -> Result<(), String> {
        bounds(&self.action_min, &self.action_max)?;
        view(self.view, self.picture)?;
        must((0.0..=1.0).contains(&self.random_share), "random_share", self.random_share, "lie within 0..1")?;
        let spread = self.log_std_min;
        must(spread.is_finite() && spread < LOG_STD_MAX, "log_std_min", spread, "be a finite number below 2")?;
        self.search.map_or(Ok(()), |search| search.check())
    }
}
