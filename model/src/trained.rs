//! Whatever was trained, in one shape for everyone who only uses it: an agent that acts, and something that makes latents. In: a checkpoint's folder, observations as
//! plain slices. Out: actions, latents. The one place that tells the kinds of checkpoints apart.

use std::path::Path;

use burn::tensor::Device;
use rand::Rng;

use crate::actions::Choice;
use crate::agent::Agent;
use crate::config::ObservationKind;
use crate::encode::{EpisodeEncoder, RawFrames};
use crate::error::ModelError;
use crate::model::Model;
use crate::recurrent::RecurrentAgent;
use crate::sac::SacAgent;

/// An agent without a world model.
#[derive(Debug, Clone)]
pub enum ModelFreeAgent {
    /// It looks at the last few pictures side by side.
    Stacks(Box<SacAgent>),
    /// It remembers by a GRU.
    Recurrent(Box<RecurrentAgent>),
}

impl ModelFreeAgent {
    /// The files that checkpoints of such agents have, one each.
    const FILES: [&'static str; 2] = [crate::sac::networks::FILE, crate::recurrent::networks::FILE];

    /// The agent of a checkpoint's folder.
    ///
    /// # Errors
    /// The folder holds no such networks, or a damaged file.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        if checkpoint.join(crate::recurrent::networks::FILE).is_file() {
            return Ok(Self::Recurrent(Box::new(RecurrentAgent::load(checkpoint, device)?)));
        }
        Ok(Self::Stacks(Box::new(SacAgent::load(checkpoint, device)?)))
    }

    /// The task it was made for.
    pub fn task(&self) -> &str {
        match self {
            Self::Stacks(agent) => &agent.config().task,
            Self::Recurrent(agent) => &agent.config().model.task,
        }
    }

    /// What it looks at.
    pub fn observation(&self) -> ObservationKind {
        let [height, width] = match self {
            Self::Stacks(agent) => agent.config().picture,
            Self::Recurrent(agent) => agent.config().picture,
        };
        ObservationKind::Pixels { height, width }
    }

    /// Lower and upper bounds of its actions.
    pub fn bounds(&self) -> [&[f32]; 2] {
        match self {
            Self::Stacks(agent) => [&agent.config().action_min, &agent.config().action_max],
            Self::Recurrent(agent) => [&agent.config().model.action_min, &agent.config().model.action_max],
        }
    }

    /// Number of values of a latent.
    pub fn latent(&self) -> usize {
        match self {
            Self::Stacks(agent) => agent.config().feature,
            Self::Recurrent(agent) => agent.config().model.latent,
        }
    }

    /// What its latents are, in words.
    pub fn latents(&self) -> &'static str {
        match self {
            Self::Stacks(_) => "features of the critics",
            Self::Recurrent(_) => "means of the encoder",
        }
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        match self {
            Self::Stacks(agent) => agent.begin(),
            Self::Recurrent(agent) => agent.begin(),
        }
    }

    /// Takes in one observation and the action that was executed before it, and returns the latent: `[latent]`.
    ///
    /// # Errors
    /// The observation is of another kind or size than the agent's.
    pub fn observe(&mut self, frame: RawFrames<'_>, previous_action: &[f32]) -> Result<Vec<f32>, ModelError> {
        let RawFrames::Pixels(pixels) = frame else {
            let (wanted, found) = (self.observation().to_string(), "vectors".to_owned());
            return Err(ModelError::Mismatch { wanted, found });
        };
        match self {
            Self::Stacks(agent) => agent.observe(pixels),
            Self::Recurrent(agent) => agent.observe(pixels, previous_action),
        }
    }

    /// Chooses the action of the observation taken in last, in the task's bounds: `[A]`.
    pub fn choose(&self, choice: Choice, rng: &mut impl Rng) -> Vec<f32> {
        match self {
            Self::Stacks(agent) => agent.choose(choice, rng),
            Self::Recurrent(agent) => agent.choose(choice, rng),
        }
    }
}

/// An agent that acts, of either kind.
#[derive(Debug, Clone)]
pub enum TrainedAgent {
    /// Through a world model's latents.
    World(Box<Agent>),
    /// Without a world model.
    ModelFree(ModelFreeAgent),
}

impl TrainedAgent {
    /// The agent of a checkpoint's folder.
    ///
    /// # Errors
    /// Nothing there acts, or a file is damaged.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        if is_model_free(checkpoint) {
            return Ok(Self::ModelFree(ModelFreeAgent::load(checkpoint, device)?));
        }
        Ok(Self::World(Box::new(Agent::load(checkpoint, device)?)))
    }

    /// The task it was made for.
    pub fn task(&self) -> &str {
        match self {
            Self::World(agent) => &agent.config().task,
            Self::ModelFree(agent) => agent.task(),
        }
    }

    /// What it looks at.
    pub fn observation(&self) -> ObservationKind {
        match self {
            Self::World(agent) => agent.config().observation,
            Self::ModelFree(agent) => agent.observation(),
        }
    }

    /// Lower and upper bounds of its actions.
    pub fn bounds(&self) -> [&[f32]; 2] {
        match self {
            Self::World(agent) => [&agent.config().action_min, &agent.config().action_max],
            Self::ModelFree(agent) => agent.bounds(),
        }
    }

    /// What it looks at of a frame that has both.
    pub fn look<'a>(&self, pixels: &'a [u8], observation: &'a [f32]) -> RawFrames<'a> {
        match self.observation() {
            ObservationKind::Pixels { .. } => RawFrames::Pixels(pixels),
            ObservationKind::Vector { .. } => RawFrames::Vectors(observation),
        }
    }

    /// Forgets everything of the episode before.
    pub fn begin(&mut self) {
        match self {
            Self::World(agent) => agent.begin(),
            Self::ModelFree(agent) => agent.begin(),
        }
    }

    /// Takes in one observation and the action that was executed before it (in the task's bounds; not used at an episode's first observation), and chooses the next
    /// action: `[A]`.
    ///
    /// # Errors
    /// The observation or the action is of another kind or size than the agent's.
    pub fn act(
        &mut self,
        frame: RawFrames<'_>,
        previous_action: &[f32],
        choice: Choice,
        rng: &mut impl Rng,
    ) -> Result<Vec<f32>, ModelError> {
        match self {
            Self::World(agent) => agent.act(frame, previous_action, choice, rng),
            Self::ModelFree(agent) => {
                agent.observe(frame, previous_action)?;
                Ok(agent.choose(choice, rng))
            }
        }
    }
}

/// What makes latents of observations, of either kind.
#[derive(Debug, Clone, Copy)]
pub enum TrainedEncoder<'a> {
    /// Posterior means of a world model.
    World(&'a Model),
    /// What an agent without a world model chooses its actions by.
    ModelFree(&'a ModelFreeAgent),
}

impl<'a> TrainedEncoder<'a> {
    /// The task it was made for.
    pub fn task(self) -> &'a str {
        match self {
            Self::World(model) => &model.config.task,
            Self::ModelFree(agent) => agent.task(),
        }
    }

    /// What it looks at.
    pub fn observation(self) -> ObservationKind {
        match self {
            Self::World(model) => model.config.observation,
            Self::ModelFree(agent) => agent.observation(),
        }
    }

    /// Number of values of an action.
    pub fn actions(self) -> usize {
        match self {
            Self::World(model) => model.config.actions(),
            Self::ModelFree(agent) => agent.bounds()[0].len(),
        }
    }

    /// Number of values of a latent.
    pub fn latent(self) -> usize {
        match self {
            Self::World(model) => model.config.latent,
            Self::ModelFree(agent) => agent.latent(),
        }
    }

    /// Follows an episode from its start.
    pub fn episode(self, device: &Device) -> EpisodeLatents<'a> {
        match self {
            Self::World(model) => EpisodeLatents::World(Box::new(EpisodeEncoder::new(model, device))),
            Self::ModelFree(agent) => {
                let mut agent = agent.clone();
                agent.begin();
                EpisodeLatents::ModelFree(Box::new(agent))
            }
        }
    }
}

/// Follows one episode from its start, chunk by chunk.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time, for an episode")]
pub enum EpisodeLatents<'a> {
    /// By a world model's encoder.
    World(Box<EpisodeEncoder<'a>>),
    /// Row by row, as an agent follows an environment.
    ModelFree(Box<ModelFreeAgent>),
}

impl EpisodeLatents<'_> {
    /// Starts another episode.
    pub fn reset(&mut self) {
        match self {
            Self::World(encoder) => encoder.reset(),
            Self::ModelFree(agent) => agent.begin(),
        }
    }

    /// Latents of the next rows of the episode.
    ///
    /// # Shapes
    /// - `frames`: the observations of `length` rows
    /// - `previous_actions`: `[length, A]`, the action before each row in the task's bounds; at the episode's start its values are not used
    /// - output: `[length, latent]`
    ///
    /// # Errors
    /// The observations are of another kind or size than the encoder's.
    pub fn push(&mut self, frames: RawFrames<'_>, previous_actions: &[f32]) -> Result<Vec<f32>, ModelError> {
        let agent = match self {
            Self::World(encoder) => return encoder.push(frames, previous_actions),
            Self::ModelFree(agent) => agent,
        };
        let width = agent.bounds()[0].len().max(1);
        let rows = previous_actions.len() / width;
        let mut latents = Vec::with_capacity(rows * agent.latent());
        for (row, action) in previous_actions.chunks_exact(width).enumerate() {
            let frame = match frames {
                RawFrames::Pixels(bytes) => RawFrames::Pixels(part(bytes, row, rows)),
                RawFrames::Vectors(values) => RawFrames::Vectors(part(values, row, rows)),
            };
            latents.extend(agent.observe(frame, action)?);
        }
        Ok(latents)
    }
}

/// One of so many equal parts.
fn part<T>(values: &[T], number: usize, parts: usize) -> &[T] {
    let width = values.len() / parts.max(1);
    &values[number * width..(number + 1) * width]
}

impl<'a> From<&'a Model> for TrainedEncoder<'a> {
    fn from(model: &'a Model) -> Self {
        Self::World(model)
    }
}

/// The weights of a checkpoint, of either kind.
#[derive(Debug, Clone)]
pub enum Trained {
    /// A world model.
    World(Box<Model>),
    /// An agent without one.
    ModelFree(ModelFreeAgent),
}

impl Trained {
    /// The weights of a checkpoint's folder.
    ///
    /// # Errors
    /// The folder holds none, or a damaged file.
    pub fn load(checkpoint: &Path, device: &Device) -> Result<Self, ModelError> {
        if is_model_free(checkpoint) {
            return Ok(Self::ModelFree(ModelFreeAgent::load(checkpoint, device)?));
        }
        Ok(Self::World(Box::new(Model::load(&checkpoint.join(MODEL), device)?)))
    }

    /// What makes its latents.
    pub fn encoder(&self) -> TrainedEncoder<'_> {
        match self {
            Self::World(model) => TrainedEncoder::World(model),
            Self::ModelFree(agent) => TrainedEncoder::ModelFree(agent),
        }
    }
}

/// A world model's file in a checkpoint.
const MODEL: &str = "model.safetensors";
/// The file of actor and critic of a world model.
const BEHAVIOUR: &str = "behaviour.safetensors";

fn is_model_free(checkpoint: &Path) -> bool {
    ModelFreeAgent::FILES.iter().any(|file| checkpoint.join(file).is_file())
}

/// The file in a checkpoint's folder that makes latents; none if there is none.
pub fn encoder_file(checkpoint: &Path) -> Option<&'static str> {
    let files = ModelFreeAgent::FILES.into_iter().chain([MODEL]);
    files.into_iter().find(|file| checkpoint.join(file).is_file())
}

/// The file in a checkpoint's folder whose weights choose actions; none if nothing there acts.
pub fn actor_file(checkpoint: &Path) -> Option<&'static str> {
    let files = ModelFreeAgent::FILES.into_iter().chain([BEHAVIOUR]);
    files.into_iter().find(|file| checkpoint.join(file).is_file())
}
