//! One update of Algorithm 1. In: a batch of windows. Out: the model after one step of the adversary and one of the world model, and what was measured on
//! the way.
//!
//! The adversary steps first, on detached latents and at its own rate. Then the world model steps: ψ is held fixed, but gradients pass through
//! the latents into the adversary's log-likelihood. One pass of the adversary's observation network serves both: its features do not depend on the latents,
//! so the second step uses those of the first as constants.

use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use vibes_model::adversary::Adversary;
use vibes_model::gaussian::Gaussian;
use vibes_model::init::normal;
use vibes_model::observe::Frames;
use vibes_model::parameters::to_values;
use vibes_model::{Model, World};

use crate::batch::Batch;
use crate::error::{Result, TrainError};
use crate::learners::objective::{Predictions, Value, adversary_objective, hear, no_adversary, reconstruction, vibes};
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::options::{Options, Schedule};

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
    /// Latents under the adversary, after its step.
    pub adversary: Option<f32>,
    /// Share of (step, dimension) pairs whose log-ratio was cut.
    pub clipped: Option<f32>,
    /// Rewards.
    pub reward: f32,
    /// Observations, up to a constant.
    pub reconstruction: Option<f32>,
    /// How much of the dynamics term's gradient the encoder heard.
    pub dynamics_weight: f32,
    /// Norm of the world model's gradient before it was limited.
    pub gradient_norm: f32,
    /// The encoder's part of it.
    pub encoder_gradient_norm: f32,
    /// Norm of the adversary's gradient before it was limited.
    pub adversary_gradient_norm: Option<f32>,
    /// Means of the latents: `[rows, latent]`, row-major.
    pub latent_means: Vec<f32>,
    /// Where the time went.
    pub phases: Phases,
}

/// Milliseconds of the parts of an update, as seen by the thread that makes it (a GPU may still be at work on the part before).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Phases {
    /// The encoder's forward pass.
    pub encode: f64,
    /// All of the adversary's step, and its prediction for the world model's.
    pub adversary: f64,
    /// Dynamics, reward and objective.
    pub predict: f64,
    /// The backward pass.
    pub backward: f64,
    /// Gradient norms and Adam.
    pub step: f64,
}

impl Learner {
    /// A learner before its first update; `device` is one without autodiff.
    pub fn new(model: Model, options: &Options, device: &Device) -> Self {
        let optimizer = || Optimizer::new(options.adam_epsilon as f32);
        let Model { config, world, adversary } = model;
        let model = Model { config, world: world.train(), adversary: adversary.map(Module::train) };
        Self { model, optimizer: optimizer(), adversary_optimizer: optimizer(), device: device.clone() }
    }

    /// Makes one update; `rng` is for the noise of the latents.
    ///
    /// # Errors
    /// The batch does not fit the model, or a quantity is no longer a number; the learner is gone then, and its last checkpoint is where to go on.
    pub fn update(
        mut self,
        batch: &Batch,
        schedule: Schedule,
        options: &Options,
        rng: &mut impl Rng,
    ) -> Result<(Self, Measures)> {
        let mut watch = Stopwatch::start();
        let means = self.model.world.encoder.forward(batch.frames.clone(), batch.previous_actions.clone(), None)?.means;
        let noise = Tensor::<3>::from_data(
            TensorData::new(normal(means.shape().num_elements(), rng), means.dims()),
            &self.device,
        );
        let latents = means.clone() + noise * self.model.config.latent_std;
        let heard = hear(&latents, schedule.dynamics_weight);
        let encode = watch.lap();
        let before_last = Span { length: batch.length - 1 };
        let adversary = match self.model.adversary.take() {
            Some(adversary) => {
                Some(self.adversary_step(adversary, batch, &heard, before_last, schedule.adversary_lr, options)?)
            }
            None => None,
        };
        let adversary_ms = watch.lap();
        let predictions = predict(&self.model.world, batch, &latents, heard, before_last);
        let value = evaluate(&self.model, batch, &latents, &predictions, adversary.as_ref(), schedule.reward_weight)?;
        let mut measures = measure(&predictions, &value, adversary.as_ref());
        measures.latent_means = to_values(means.inner());
        measures.dynamics_weight = schedule.dynamics_weight;
        drop(predictions);
        measures.phases = Phases { encode, adversary: adversary_ms, predict: watch.lap(), ..Phases::default() };
        let learner = self.world_step(value, &mut measures, schedule.lr, options.gradient_clip as f32)?;
        Ok((learner, measures))
    }

    /// The adversary's step, and its prediction for the world model's step.
    fn adversary_step(
        &mut self,
        adversary: Adversary,
        batch: &Batch,
        heard: &Tensor<3>,
        span: Span,
        lr: f64,
        options: &Options,
    ) -> Result<AdversaryStep> {
        let fixed = heard.clone().detach();
        let actions = span.of(batch.actions.clone());
        let features = adversary.observe.forward(span.frames(&batch.frames, batch.batch), span.length)?;
        let prediction = adversary.forward(features.clone(), span.of(fixed.clone()), actions.clone());
        let next = fixed.narrow(0, 1, span.length);
        let counted = batch.counted.clone().narrow(0, 1, span.length);
        let objective = adversary_objective(prediction.log_prob(next) * counted, batch.count);
        finite("the adversary's log-likelihood", scalar(&objective))?;
        let gradients = NamedGradients::take(&adversary, &mut objective.neg().backward());
        let gradient_norm = finite("the adversary's gradient norm", gradients.norm(""))?;
        let adversary = self.adversary_optimizer.step(adversary, gradients, lr, options.gradient_clip as f32);
        let prediction = adversary.valid().forward(features.inner(), span.of(heard.clone()), actions);
        self.model.adversary = Some(adversary);
        Ok(AdversaryStep { prediction, gradient_norm })
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

struct AdversaryStep {
    prediction: Gaussian,
    gradient_norm: f32,
}

/// All rows of a window but the last, which nothing is predicted from.
#[derive(Clone, Copy)]
struct Span {
    length: usize,
}

impl Span {
    fn of(self, x: Tensor<3>) -> Tensor<3> {
        x.narrow(0, 0, self.length)
    }

    fn frames(self, frames: &Frames, batch: usize) -> Frames {
        match frames {
            Frames::Pixels(pixels) => Frames::Pixels(pixels.clone().narrow(0, 0, self.length * batch)),
            Frames::Vectors(vectors) => Frames::Vectors(vectors.clone().narrow(0, 0, self.length * batch)),
        }
    }
}

/// The dynamics term on the latents as `heard`, the reward on all of them.
fn predict(world: &World, batch: &Batch, latents: &Tensor<3>, heard: Tensor<3>, span: Span) -> Predictions {
    let (dynamics, _) = world.dynamics.forward(span.of(heard.clone()), span.of(batch.actions.clone()), None);
    Predictions {
        dynamics,
        reward: world.reward.forward(latents.clone(), batch.actions.clone()),
        latents: heard,
        rewards: batch.rewards.clone(),
        counted: batch.counted.clone(),
        count: batch.count,
    }
}

fn evaluate(
    model: &Model,
    batch: &Batch,
    latents: &Tensor<3>,
    predictions: &Predictions,
    adversary: Option<&AdversaryStep>,
    reward_weight: f32,
) -> Result<Value> {
    Ok(match (adversary, &model.world.decoder) {
        (Some(step), _) => vibes::value(predictions, &step.prediction, reward_weight),
        (None, Some(decoder)) => {
            let observations = decoder.log_prob(batch.frames.clone(), latents.clone())?;
            reconstruction::value(predictions, observations, reward_weight)
        }
        (None, None) => no_adversary::value(predictions, reward_weight),
    })
}

fn scalar(value: &Tensor<1>) -> f32 {
    value.clone().into_scalar()
}

fn measure(predictions: &Predictions, value: &Value, adversary: Option<&AdversaryStep>) -> Measures {
    let log_likelihood =
        |step: &AdversaryStep| scalar(&predictions.latent_log_prob(&step.prediction).sum()) / predictions.count;
    Measures {
        objective: scalar(&value.objective),
        dynamics: scalar(&value.dynamics),
        adversary: adversary.map(log_likelihood),
        clipped: value.clipped.as_ref().map(scalar),
        reward: scalar(&value.reward),
        reconstruction: value.reconstruction.as_ref().map(scalar),
        adversary_gradient_norm: adversary.map(|step| step.gradient_norm),
        ..Measures::default()
    }
}

fn finite(what: &'static str, value: f32) -> Result<f32> {
    if value.is_finite() { Ok(value) } else { Err(TrainError::NotFinite { what, value }) }
}

#[cfg(test)]
mod tests;
