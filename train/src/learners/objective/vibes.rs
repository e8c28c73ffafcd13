//! The objective of the paper: the dynamics must predict the next latent as well as an adversary that sees the whole history.
//!
//! ```text
//! L = 1/(T B) Σ_t [ Σ_i min( Σ_b log p_θ(s_t,b^i | h_t−1, s_t−1, a_t−1) − log p_ψ(s_t,b^i | s_<t, o_<t, a_<t), 0 ) + Σ_b log p_θ(r_t,b | s_t,b, a_t,b) ]
//! J = 1/(T B) Σ_t Σ_i Σ_b log p_ψ(s_t,b^i | s_<t, o_<t, a_<t)
//! ```
//!
//! The adversary steps first, on detached latents and at its own rate (Algorithm 1, line 17). Then ψ is held fixed, but gradients pass through the latents
//! into its log-likelihood. One pass of its observation network serves both: its features do not depend on the latents, so the second pass uses those of before its
//! step as constants.
//!
//! Where the log-ratio is cut is an option. Over the batch, per step and dimension, is the paper's (line 14). At small batches that rectifies noise: with 8
//! windows the sum's spread is larger than its mean, and the encoder is pressed up to four times as hard as the mean alone would press it. The paper lacks the other two.

use burn::module::Module;
use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use vibes_model::World;
use vibes_model::adversary::Adversary;
use vibes_model::gaussian::Gaussian;
use vibes_model::observe::Frames;

use super::action_baseline::ActionBaseline;
use super::{Condition, Definition, Networks, Pictures, Rival, Value, Weights};
use crate::error::{Result, TrainError};
use crate::learners::number::{finite, scalar};
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::learners::scene::{Predictions, Scene};
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The paper's objective.
#[derive(Debug)]
pub struct Vibes;

/// Over what the log-ratio is summed before it is cut to at most 0.
pub const CLIP: Declared = Declared {
    flag: "clip",
    kind: Kind::Choice { default: "batch", among: &["batch", "batch-time", "none"] },
    help: "Over what the log-ratio of dynamics and adversary is summed, for each dimension, before it is cut at 0; the paper has batch alone (only with --objective vibes)",
};

/// See [`CLIP`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clip {
    /// Over the batch, step by step: the paper's.
    Batch,
    /// Over batch and time.
    BatchTime,
    /// Never cut.
    None,
}

impl Clip {
    /// The option's value.
    pub fn of(options: &Settings) -> Self {
        match options.own.text(&CLIP) {
            "batch-time" => Self::BatchTime,
            "none" => Self::None,
            _ => Self::Batch,
        }
    }
}

impl Definition for Vibes {
    fn name(&self) -> &'static str {
        "vibes"
    }

    fn about(&self) -> &'static str {
        "the next latent is predicted against an adversary that sees the whole history, and the reward: the paper's equation 1"
    }

    fn options(&self) -> &'static [Declared] {
        &[CLIP]
    }

    fn dynamics_shape_latents(&self) -> bool {
        true
    }

    fn networks(&self, options: &Settings, actions: usize) -> Networks {
        let baseline = self.gate(options).filter(|condition| condition.gain > 0.0);
        let heads = baseline.map(|_| ActionBaseline::head(actions)).into_iter().collect();
        Networks { adversary: true, heads, ..Networks::default() }
    }

    fn gate(&self, options: &Settings) -> Option<Condition> {
        Some(Condition { start: options.dynamics_start, gain: options.dynamics_after })
    }

    fn calibrated(&self, world: World, rewards: &[f32]) -> World {
        ActionBaseline::calibrated(world, rewards)
    }

    fn takes_recipe(&self) -> bool {
        true
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: 2 * length - 1, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let step = adversary_step(scene, rival)?;
        let made = value(&scene.predictions, &step.prediction, Clip::of(scene.options), Weights::of(scene));
        let after = scene.predictions.latent_log_prob(&step.prediction).sum().detach() / scene.predictions.count;
        let mut stated = made.stated;
        stated.push(("adversary_minus_dynamics", after.clone() - made.dynamics.clone().detach()));
        stated.push(("adversary_log_likelihood", after));
        stated.push(("adversary_log_likelihood_before", step.before));
        stated.push(("adversary_gradient_norm", Tensor::from_data([step.gradient_norm], &made.dynamics.device())));
        let value = Value { stated, ..made };
        match self.gate(scene.options).filter(|condition| condition.gain > 0.0) {
            Some(_) => ActionBaseline::add(scene, value),
            None => Ok(value),
        }
    }
}

/// The value of the objective; `adversary` predicts the same latents as the dynamics, with ψ held fixed by the caller but the latents not
/// detached, so that gradients reach the encoder through them.
pub fn value(predictions: &Predictions, adversary: &Gaussian, clip: Clip, weights: Weights) -> Value {
    let dynamics = predictions.latent_log_prob(&predictions.dynamics);
    let ratio = log_ratio(dynamics.clone(), predictions.latent_log_prob(adversary));
    // Steps in which some row counts; the others have no ratio to cut.
    let pairs = ratio.dims()[0];
    let steps =
        predictions.counted.clone().narrow(0, 1, pairs).sum_dim(1).greater_scalar(0.0).float().reshape([pairs, 1]);
    let (term, share) = match clip {
        Clip::Batch => {
            let above = ratio.clone().greater_scalar(0.0).float() * steps.clone();
            let dims = ratio.dims()[1] as f32;
            (ratio.clamp_max(0.0).sum(), above.sum() / (steps.sum() * dims))
        }
        Clip::BatchTime => {
            let whole = ratio.sum_dim(0);
            let share = whole.clone().greater_scalar(0.0).float().mean();
            (whole.clamp_max(0.0).sum(), share)
        }
        Clip::None => (ratio.sum(), steps.sum() * 0.0),
    };
    let mut value = Value::of(term, dynamics.sum(), predictions.reward_log_prob(), &weights);
    value.stated.push(("clipped_share", share));
    value
}

/// The log-ratio per step and dimension, summed over the batch before it is clipped (Algorithm 1, line 13).
///
/// # Shapes
/// - `dynamics`, `adversary`: log-densities `[steps, batch, latent]`
/// - output: `[steps, latent]`
pub fn log_ratio(dynamics: Tensor<3>, adversary: Tensor<3>) -> Tensor<2> {
    (dynamics - adversary).sum_dim(1).squeeze_dim(1)
}

/// The adversary's objective `J_ψ`: the mean log-likelihood of the latents under its prediction, nats a row (Algorithm 1, line 17).
pub fn adversary_objective(log_prob: Tensor<3>, count: f32) -> Tensor<1> {
    log_prob.sum() / count
}

struct AdversaryStep {
    /// After its step, with ψ fixed.
    prediction: Gaussian,
    /// Its log-likelihood before its step.
    before: Tensor<1>,
    gradient_norm: f32,
}

/// The adversary's step, and its prediction for the world model's step.
fn adversary_step(scene: &Scene<'_>, rival: Rival<'_>) -> Result<AdversaryStep> {
    let Some(adversary) = rival.adversary.take() else {
        return Err(TrainError::Options("this model was made without the adversary that `vibes` needs".to_owned()));
    };
    let (batch, pairs) = (scene.batch, scene.batch.length - 1);
    let before_last = |x: &Tensor<3>| x.clone().narrow(0, 0, pairs);
    let fixed = scene.predictions.latents.clone().detach();
    let actions = before_last(&batch.actions);
    let features = adversary.observe.forward(all_but_last(&batch.frames, pairs * batch.batch), pairs)?;
    let prediction = adversary.forward(features.clone(), before_last(&fixed), actions.clone());
    let counted = batch.counted.clone().narrow(0, 1, pairs);
    let objective = adversary_objective(prediction.log_prob(fixed.narrow(0, 1, pairs)) * counted, batch.count);
    finite("the adversary's log-likelihood", scalar(&objective))?;
    let before = objective.clone().detach();
    let (adversary, gradient_norm) = step(adversary, objective, rival.optimizer, scene)?;
    let prediction = adversary.valid().forward(features.inner(), before_last(&scene.predictions.latents), actions);
    *rival.adversary = Some(adversary);
    Ok(AdversaryStep { prediction, before, gradient_norm })
}

fn step(
    adversary: Adversary,
    objective: Tensor<1>,
    optimizer: &mut Optimizer,
    scene: &Scene<'_>,
) -> Result<(Adversary, f32)> {
    let gradients = NamedGradients::take(&adversary, &mut objective.neg().backward());
    let norm = finite("the adversary's gradient norm", gradients.norm(""))?;
    let limit = scene.options.gradient_clip as f32;
    Ok((optimizer.step(adversary, gradients, scene.schedule.adversary_lr, limit), norm))
}

/// All rows of the windows but the last, which nothing is predicted from.
fn all_but_last(frames: &Frames, rows: usize) -> Frames {
    match frames {
        Frames::Pixels(pixels) => Frames::Pixels(pixels.clone().narrow(0, 0, rows)),
        Frames::Vectors(vectors) => Frames::Vectors(vectors.clone().narrow(0, 0, rows)),
    }
}
