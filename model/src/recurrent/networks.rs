//! All networks of a recurrent agent in one place, and their file. In: sizes, or a checkpoint. Out: what a learner trains and an agent acts with.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::sigmoid};
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::actions::{ActionDistribution, Actions};
use crate::checkpoint::{load_described, save_described};
use crate::config::{ModelConfig, ObservationKind};
use crate::described::{Described, Matrix, perceptron, sum, view};
use crate::error::ModelError;
use crate::init::constant;
use crate::mlp::Mlp;
use crate::model::{Model, World};
use crate::parameters::{HostTensors, read_parameters, write_parameters};
use crate::sac::critic::twin_values;
use crate::sac::features::{orthogonal_mlp, relu_forward};
use crate::sac::networks::{TEMPERATURE, Temperature};

/// Their file in a checkpoint.
pub const FILE: &str = "recurrent.safetensors";
/// Bounds of the standard deviation's logarithm (apple/ml-core).
const LOG_STD: [f32; 2] = [-10.0, 2.0];
/// Means of the normal lie within these bounds, so that tanh does not lose their gradient.
const MEAN: f32 = 5.0;

/// Sizes and constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecurrentConfig {
    /// The world model whose encoder and dynamics it has; what it looks at is a view of a picture.
    pub model: ModelConfig,
    /// Rows and columns of a recorded picture; the view is cut from the middle where nothing is varied.
    pub picture: [usize; 2],
    /// Width of the hidden layers of actor and critics.
    pub hidden: usize,
}

impl RecurrentConfig {
    /// Width of what actor and critics see.
    pub fn state(&self) -> usize {
        self.model.hidden + self.model.latent
    }
}

/// Two critics over (hidden state, latent, action).
#[derive(Module, Debug)]
pub struct StateCritic {
    /// One.
    pub first: Mlp,
    /// The other.
    pub second: Mlp,
}

impl StateCritic {
    /// Both values: `[rows, state]`, `[rows, A]` to `[rows]` each.
    pub fn values(&self, states: Tensor<2>, actions: Tensor<2>) -> [Tensor<1>; 2] {
        twin_values([&self.first, &self.second], states, actions)
    }
}

/// A perceptron from (hidden state, latent) to a tanh-squashed normal distribution of actions.
#[derive(Module, Debug)]
pub struct StateActor {
    /// `[state]` to `[2A]`
    pub mlp: Mlp,
}

impl StateActor {
    /// The distribution of actions: `[rows, state]` to `[rows, A]`, with mean `5 tanh(m/5)` and the standard deviation's logarithm by a sigmoid within its bounds.
    pub fn forward(&self, states: Tensor<2>) -> Actions<2> {
        let output = relu_forward(&self.mlp, states);
        let width = output.dims()[1] / 2;
        let [low, high] = LOG_STD;
        let mean = (output.clone().narrow(1, 0, width) / MEAN).tanh() * MEAN;
        let log_std = sigmoid(output.narrow(1, width, width)) * (high - low) + low;
        Actions::new(ActionDistribution::TanhNormal, mean, log_std.exp())
    }
}

/// A recurrent agent's networks.
#[derive(Debug, Clone)]
pub struct RecurrentNetworks {
    /// Sizes and constants.
    pub config: RecurrentConfig,
    /// Encoder, dynamics, and the heads of the losses beside the critics'.
    pub world: World,
    /// The critics.
    pub critic: StateCritic,
    /// Their slow copy, which targets come from.
    pub slow: StateCritic,
    /// The actor.
    pub actor: StateActor,
    /// Weight of the actor's entropy.
    pub temperature: Temperature,
}

impl RecurrentNetworks {
    /// New networks with first values drawn from `rng`; the slow copy begins as the critics themselves.
    ///
    /// # Errors
    /// The pictures are too small.
    pub fn init(config: RecurrentConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        let world = Model::init(config.model.clone(), rng, device)?.world;
        let (state, actions, hidden) = (config.state(), config.model.actions(), config.hidden);
        let mut value = || orthogonal_mlp([state + actions, hidden, 1], rng, device);
        let critic = StateCritic { first: value(), second: value() };
        let actor = StateActor { mlp: orthogonal_mlp([state, hidden, 2 * actions], rng, device) };
        let temperature = Temperature { log: constant([1], TEMPERATURE.ln(), device) };
        Ok(Self { world, slow: critic.clone(), critic, actor, temperature, config })
    }

    /// All weights, the slow ones too, by the names they have in a file.
    pub fn parameters(&self) -> HostTensors {
        let mut tensors = read_parameters(&self.world, "world");
        tensors.extend(read_parameters(&self.critic, "critic"));
        tensors.extend(read_parameters(&self.slow, "slow"));
        tensors.extend(read_parameters(&self.actor, "actor"));
        tensors.extend(read_parameters(&self.temperature, "temperature"));
        tensors
    }

    /// Writes them to a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        save_described(path, &self.parameters(), ("recurrent", &self.config))
    }

    /// Builds the networks a file describes and reads their weights.
    ///
    /// # Errors
    /// The file is missing, is not such a checkpoint, or its tensors do not fit its own description.
    pub fn load(path: &Path, device: &Device) -> Result<Self, ModelError> {
        let (tensors, config): (_, RecurrentConfig) = load_described(path, "recurrent")?;
        // The first values are overwritten, so any generator does.
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
        let new = Self::init(config, &mut rng, device)?;
        Ok(Self {
            world: write_parameters(new.world, "world", &tensors)?,
            critic: write_parameters(new.critic, "critic", &tensors)?,
            slow: write_parameters(new.slow, "slow", &tensors)?,
            actor: write_parameters(new.actor, "actor", &tensors)?,
            temperature: write_parameters(new.temperature, "temperature", &tensors)?,
            config: new.config,
        })
    }
}

impl Described for RecurrentConfig {
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_> {
        let input = sum(&[self.model.hidden, self.model.latent, self.model.actions()]);
        Box::new(self.model.matrices().chain(perceptron("critic.first", [input, self.hidden, 1])))
    }

    fn check_constants(&self) -> Result<(), String> {
        self.model.check_constants()?;
        match self.model.observation {
            ObservationKind::Pixels { height, width } => view([height, width], self.picture),
            ObservationKind::Vector { .. } => view(self.picture, self.picture),
        }
    }
}
