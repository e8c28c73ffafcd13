//! One update of Algorithm 1. In: a batch of windows. Out: the model after one step of the adversary and one of the world model, and what was measured on
//! the way.
//!
//! Encode, predict, ask the objective for its value (it takes whatever step of its own comes first), add the auxiliary terms that were asked for, step.

use std::collections::BTreeMap;
use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::WindowBatch;
use vibes_model::Model;
use vibes_model::parameters::to_values;

use crate::batch::Batch;
use crate::error::Result;
use crate::learners::auxiliary::{self, Auxiliary};
use crate::learners::behaviour::Replayed;
use crate::learners::number::{finite, scalar};
use crate::learners::objective::{Objective, Rival, Value};
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::learners::scene::Scene;
use crate::settings::{Schedule, Settings};

/// A model in training.
#[derive(Debug, Clone)]
pub struct Learner {
    /// The model.
    pub model: Model,
    /// Adam for the world model.
    pub optimizer: Optimizer,
    /// Adam for the adversary.
    pub adversary_optimizer: Optimizer,
    device: Device,
}

/// What one update measured. Log-likelihoods are nats a row that counts.
#[derive(Debug, Clone, Default)]
pub struct Measures {
    /// The objective, maximised.
    pub objective: f32,
    /// Latents under the dynamics.
    pub dynamics: f32,
    /// Rewards.
    pub reward: f32,
    /// Rewards under what the objective's gate compares with.
    pub reward_baseline: Option<f32>,
    /// What the objective and the auxiliary terms state, by their names in the metrics.
    pub stated: BTreeMap<&'static str, f32>,
    /// Share of the dynamics term's gradient that reached the encoder.
    pub dynamics_weight: f32,
    /// Norm of the world model's gradient before it was limited.
    pub gradient_norm: f32,
    /// The encoder's part of it.
    pub encoder_gradient_norm: f32,
    /// Means of the latents: `[rows, latent]`, row-major.
    pub latent_means: Vec<f32>,
    /// Samples of the latents, and the dynamics' states after each row but the last, both without autodiff; taken by whoever learns from them next.
    pub reached: Option<(Tensor<3>, Tensor<3>)>,
    /// Where the time went.
    pub phases: Phases,
}

/// Milliseconds of the parts of an update, as seen by the thread that makes it (a GPU may still be at work on the part before).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Phases {
    /// Encoder, dynamics and reward, forward.
    pub predict: f64,
    /// The objective, the adversary's whole step with it.
    pub objective: f64,
    /// The auxiliary terms.
    pub auxiliary: f64,
    /// The backward pass.
    pub backward: f64,
    /// Gradient norms and Adam.
    pub step: f64,
}

impl Measures {
    /// The rows of the update's batch, which was made of these windows, for an actor and a critic to start from.
    ///
    /// # Panics
    /// They were taken before.
    pub fn take_replayed(&mut self, batch: &Batch, windows: &WindowBatch) -> Replayed {
        let (latents, states_after) = self.reached.take().expect("taken once");
        let counted = to_values(batch.counted.clone()).into_iter().map(|counted| counted > 0.0).collect();
        let episodes = windows.starts.iter().map(|(episode, _)| *episode).collect();
        Replayed::detached(latents, states_after, batch.actions.clone(), windows.rewards.clone(), (counted, episodes))
    }
}

impl Learner {
    /// A learner before its first update; `device` is one without autodiff.
    pub fn new(model: Model, settings: &Settings, device: &Device) -> Self {
        let optimizer = || Optimizer::new(settings.adam_epsilon as f32);
        let Model { config, world, adversary } = model;
        let model = Model { config, world: world.train(), adversary: adversary.map(Module::train) };
        Self { model, optimizer: optimizer(), adversary_optimizer: optimizer(), device: device.clone() }
    }

    /// Makes one update; `rng` is for the noise of the latents and for what auxiliary terms draw.
    ///
    /// # Errors
    /// The batch does not fit the model, or a quantity is no longer a number; the learner is gone then, and its last checkpoint is where to go on.
    pub fn update(
        mut self,
        batch: &Batch,
        schedule: Schedule,
        (objective, settings): (Objective, &Settings),
        rng: &mut impl Rng,
    ) -> Result<(Self, Measures)> {
        let mut watch = Stopwatch::start();
        let Model { config, world, adversary } = &mut self.model;
        let scene = Scene::new((world, config), batch, (settings, schedule), rng, &self.device)?;
        let mut phases = Phases { predict: watch.lap(), ..Phases::default() };
        let mut drawn = ChaCha8Rng::seed_from_u64(rng.random());
        let rival = Rival { adversary, optimizer: &mut self.adversary_optimizer };
        let value = objective.value(&scene, rival, &mut drawn)?;
        phases.objective = watch.lap();
        let value = with_auxiliaries(&scene, value, &mut drawn)?;
        phases.auxiliary = watch.lap();
        let means = scene.means.clone().inner();
        let reached = (scene.latents.clone().inner(), scene.states_after.clone().inner());
        drop(scene);
        let mut measures = Measures {
            latent_means: to_values(means),
            // Other objectives do not weigh their dynamics.
            dynamics_weight: if objective.dynamics_shape_latents() { schedule.dynamics_weight } else { 0.0 },
            reached: Some(reached),
            phases,
            ..measure(&value)
        };
        let learner = self.world_step(value, &mut measures, schedule.lr, settings.gradient_clip as f32)?;
        Ok((learner, measures))
    }

    fn world_step(mut self, value: Value, measures: &mut Measures, lr: f64, clip: f32) -> Result<Self> {
        finite("the objective", measures.objective)?;
        let mut watch = Stopwatch::start();
        let gradients = NamedGradients::take(&self.model.world, &mut value.objective.neg().backward());
        measures.phases.backward = watch.lap();
        measures.gradient_norm = finite("the gradient norm", gradients.norm(""))?;
        measures.encoder_gradient_norm = gradients.norm("encoder.");
        self.model.world = self.optimizer.step(self.model.world, gradients, lr, clip);
        measures.phases.step = watch.lap();
        Ok(self)
    }
}

/// The share of a term's weight that holds at this update.
fn risen(term: &dyn Auxiliary, scene: &Scene<'_>) -> f32 {
    if term.waits() { scene.schedule.risen } else { 1.0 }
}

/// The value with every auxiliary term that the options ask for.
fn with_auxiliaries(scene: &Scene<'_>, mut value: Value, rng: &mut ChaCha8Rng) -> Result<Value> {
    for term in auxiliary::asked(scene.options) {
        let log_likelihood = term.value(scene, rng)?;
        value.objective =
            value.objective + log_likelihood.clone() * (term.weight(scene.options) as f32 * risen(term, scene));
        value.stated.push((term.metric(), log_likelihood));
    }
    Ok(value)
}

struct Stopwatch {
    begun: Instant,
}

impl Stopwatch {
    fn start() -> Self {
        Self { begun: Instant::now() }
    }

    /// Milliseconds since the start or the lap before.
    fn lap(&mut self) -> f64 {
        let elapsed = self.begun.elapsed().as_secs_f64() * 1e3;
        self.begun = Instant::now();
        elapsed
    }
}

fn measure(value: &Value) -> Measures {
    Measures {
        objective: scalar(&value.objective),
        dynamics: scalar(&value.dynamics),
        reward: scalar(&value.reward),
        reward_baseline: value.reward_baseline.as_ref().map(scalar),
        stated: value.stated.iter().map(|(name, number)| (*name, scalar(number))).collect(),
        ..Measures::default()
    }
}

#[cfg(test)]
mod tests;
