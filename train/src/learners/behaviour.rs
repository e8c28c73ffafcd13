//! One update of actor and critic in imagination. In: the world model and the rows its own update has just seen, detached. Out: actor, critic and slow critic after one
//! step each, and what was measured.
//!
//! Imagination starts from every counted row. The actor maximises the λ-returns of its actions, by the gradient that flows back through the frozen dynamics
//! and reward model or by REINFORCE; the critic predicts them. Neither's gradient reaches the world model. With a [`guard`], imagined rewards are lower where little was seen.

use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::Rng;
use vibes_model::World;
use vibes_model::behaviour::Behaviour;
use vibes_model::guard::Guard;
use vibes_model::imagine::{Imagination, ImaginationNoise, Learned, Starts, imagine};
use vibes_model::parameters::to_values;
use vibes_model::returns::{ReturnScale, lambda_returns};

use crate::error::Result;
use crate::learners::number::{finite, scalar};
use crate::learners::optimizer::{NamedGradients, Optimizer};

pub mod foresight;
pub mod guard;
pub mod options;

use guard::GuardLearner;
pub use options::{BehaviourOptions, Gradient};

/// Rows of windows as the world model's update leaves them: without autodiff, time-major.
#[derive(Debug, Clone)]
pub struct Replayed {
    /// Samples of the latents: `[length, batch, latent]`
    pub latents: Tensor<3>,
    /// The dynamics' state before each row's action is consumed, zeros at a window's first row: `[length, batch, hidden]`
    pub states: Tensor<3>,
    /// Scaled to −1..1: `[length, batch, A]`
    pub actions: Tensor<3>,
    /// `[length, batch]`
    pub rewards: Vec<f32>,
    /// Whether a row counts, or only warmed up the hidden states: `[length, batch]`
    pub counted: Vec<bool>,
    /// The number of each window's episode in its recording: `[batch]`
    pub episodes: Vec<u32>,
}

/// Actor and critic in training.
#[derive(Debug, Clone)]
pub struct BehaviourLearner {
    /// The networks.
    pub behaviour: Behaviour,
    /// Adam for the actor.
    pub actor_optimizer: Optimizer,
    /// Adam for the critic.
    pub critic_optimizer: Optimizer,
    /// What returns are divided by.
    pub scale: ReturnScale,
    /// Who guards against rewards that are imagined too high, where that is asked for.
    pub guard: Option<GuardLearner>,
    device: Device,
}

/// What one update measured.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BehaviourMeasures {
    /// Mean λ-return.
    pub imagined_return: f32,
    /// Mean imagined reward of a step, what a guard takes from it not taken.
    pub imagined_reward: f32,
    /// Mean disagreement of the guard's members over imagined rows and over recorded ones, in units of reward; none without a guard.
    pub disagreement: Option<[f32; 2]>,
    /// Mean value of the first rows.
    pub value: f32,
    /// What returns were divided by.
    pub return_scale: f32,
    /// Mean entropy of the actor, nats.
    pub entropy: f32,
    /// The critic's loss.
    pub critic_loss: f32,
    /// Norm of the actor's gradient before it was limited; none while only the critic learns.
    pub actor_gradient_norm: Option<f32>,
    /// Norm of the critic's gradient before it was limited.
    pub critic_gradient_norm: f32,
    /// Where the time went.
    pub phases: BehaviourPhases,
}

/// Milliseconds of the parts of an update of actor and critic.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BehaviourPhases {
    /// Starts, noise, imagination, values and returns, forward.
    pub imagine: f64,
    /// The actor's loss, its way back through imagination, Adam.
    pub actor: f64,
    /// The critic's loss, backward, Adam, the slow copy.
    pub critic: f64,
}

/// Imagined rows with what they are worth.
struct Judged {
    imagined: Imagination,
    entropy: Tensor<2>,
    /// Of the guard's members: `[horizon, rows]`
    disagreement: Option<Tensor<2>>,
    /// `[horizon + 1, rows]`
    values: Tensor<2>,
    /// `[horizon, rows]`
    returns: Tensor<2>,
}

impl BehaviourLearner {
    /// Before its first update; `device` is one without autodiff.
    pub fn new(behaviour: Behaviour, device: &Device) -> Self {
        let optimizer = || Optimizer::new(1e-8);
        Self {
            behaviour: behaviour.train(),
            actor_optimizer: optimizer(),
            critic_optimizer: optimizer(),
            scale: ReturnScale::default(),
            guard: None,
            device: device.clone().inner(),
        }
    }

    /// The same, guarded.
    #[must_use]
    pub fn guarded(self, guard: Option<Guard>) -> Self {
        Self { guard: guard.map(GuardLearner::new), ..self }
    }

    /// Makes one update. With `actor_learns` false only the critic steps: before the actor moves, its values should mean something.
    ///
    /// # Errors
    /// A quantity is no longer a number; the learner is gone then, and its last checkpoint is where to go on.
    pub fn update(
        mut self,
        world: &World,
        rows: &Replayed,
        options: &BehaviourOptions,
        actor_learns: bool,
        rng: &mut impl Rng,
    ) -> Result<(Self, BehaviourMeasures)> {
        let begun = Instant::now();
        let (dynamics, reward) = (world.dynamics.valid(), world.reward.valid());
        let chosen = rows.chosen(options.every_start);
        let starts = rows.starts(&chosen, &self.device);
        let sizes = [self.behaviour.actor.mlp.last.bias.dims()[0] / 2, starts.latents.dims()[1]];
        let noise = ImaginationNoise::draw([options.horizon, chosen.len()], sizes, rng, &self.device);
        let learned = Learned { dynamics: &dynamics, reward: &reward };
        let recorded = self.guard.as_mut().map(|guard| guard.step(rows, options, &self.device)).transpose()?;
        let judged = self.judge(&learned, starts, &noise, options, actor_learns);
        let returns = judged.returns.clone().inner();
        let numbers = to_values(returns.clone());
        self.scale = self.scale.after(&numbers);
        let divisor = if options.normalize_returns { self.scale.divisor() } else { 1.0 };
        let mut measures = BehaviourMeasures {
            imagined_return: mean(&numbers),
            imagined_reward: scalar(&judged.imagined.rewards.clone().inner().mean()),
            disagreement: judged
                .disagreement
                .clone()
                .zip(recorded)
                .map(|(apart, recorded)| [scalar(&apart.inner().mean()), recorded]),
            value: scalar(&judged.values.clone().inner().narrow(0, 0, 1).mean()),
            return_scale: self.scale.divisor() as f32,
            entropy: scalar(&judged.entropy.clone().inner().mean()),
            ..BehaviourMeasures::default()
        };
        finite("the mean imagined return", measures.imagined_return)?;
        let features = judged.imagined.features.clone().inner();
        measures.phases.imagine = ms(begun);
        let begun = Instant::now();
        if actor_learns {
            let loss = self.actor_loss(judged, &noise, divisor, options);
            measures.actor_gradient_norm = Some(self.actor_step(&loss, options)?);
        }
        measures.phases.actor = ms(begun);
        let begun = Instant::now();
        let replayed =
            if options.replay_value > 0.0 { self.replay_targets(rows, &chosen, &numbers, options) } else { None };
        let loss = self.critic_loss(features, returns, replayed, divisor, options);
        measures.critic_loss = finite("the critic's loss", scalar(&loss.clone().inner()))?;
        measures.critic_gradient_norm = self.critic_step(&loss, options)?;
        measures.phases.critic = ms(begun);
        Ok((self, measures))
    }

    /// Imagines, and judges what was imagined. Gradients flow to the actor only when it learns by them.
    fn judge(
        &self,
        world: &Learned<'_>,
        starts: Starts,
        noise: &ImaginationNoise,
        options: &BehaviourOptions,
        actor_learns: bool,
    ) -> Judged {
        let by_dynamics = actor_learns && options.gradient == Gradient::Dynamics;
        let (imagined, entropy) = if by_dynamics {
            imagine(world, &self.behaviour.actor, starts, noise)
        } else {
            imagine(world, &self.behaviour.actor.valid(), starts, noise)
        };
        let judge = if options.slow_target { self.behaviour.slow.clone() } else { self.behaviour.critic.valid() };
        let [rows, count, width] = imagined.features.dims();
        let values = judge.values(imagined.features.clone().reshape([rows * count, width])).reshape([rows, count]);
        let disagreement = self.guard.as_ref().map(|guard| guard.disagreement(&imagined));
        let rewards = match disagreement.clone() {
            Some(disagreement) => imagined.rewards.clone() - disagreement * options.guard,
            None => imagined.rewards.clone(),
        };
        let returns = lambda_returns(rewards, values.clone(), options.discount, options.lambda);
        Judged { imagined, entropy, disagreement, values, returns }
    }

    /// To be minimised: minus the mean weighted return in units of the scale, minus the entropy by its weight.
    fn actor_loss(
        &self,
        judged: Judged,
        noise: &ImaginationNoise,
        divisor: f64,
        options: &BehaviourOptions,
    ) -> Tensor<1> {
        let [horizon, rows] = judged.returns.dims();
        let weights = options.weights(horizon, rows, &self.device);
        let (gain, entropy) = match options.gradient {
            Gradient::Dynamics => (judged.returns / divisor, judged.entropy),
            Gradient::Reinforce => {
                let seen = judged.imagined.features.narrow(0, 0, horizon);
                let actions = self.behaviour.actor.forward(seen);
                let advantage = (judged.returns - judged.values.narrow(0, 0, horizon)) / divisor;
                let log_prob: Tensor<2> = actions.log_prob(judged.imagined.actions.normal).squeeze_dim(2);
                let entropy = actions.entropy(&actions.sample(noise.actions.clone()));
                (log_prob * advantage, entropy.squeeze_dim(2))
            }
        };
        ((gain + entropy * options.entropy) * weights).mean().neg()
    }

    fn actor_step(&mut self, loss: &Tensor<1>, options: &BehaviourOptions) -> Result<f32> {
        let gradients = NamedGradients::take(&self.behaviour.actor, &mut loss.backward());
        let norm = finite("the actor's gradient norm", gradients.norm(""))?;
        let actor = self.behaviour.actor.clone();
        self.behaviour.actor =
            self.actor_optimizer.step(actor, gradients, options.actor_lr, options.gradient_clip as f32);
        Ok(norm)
    }

    /// λ-returns of recorded rewards, ended by the imagined return of the window's last row, for every counted row but a window's last: the rows' places in
    /// `[length·batch]` and their targets.
    fn replay_targets(
        &self,
        rows: &Replayed,
        chosen: &[i64],
        imagined: &[f32],
        options: &BehaviourOptions,
    ) -> Option<(Tensor<2>, Tensor<1>)> {
        let [length, batch, _] = rows.latents.dims();
        let mut first = vec![f32::NAN; length * batch];
        // The first `chosen.len()` imagined returns are those of the starts themselves.
        for (place, value) in chosen.iter().zip(imagined) {
            first[*place as usize] = *value;
        }
        let (discount, lambda) = (options.discount as f32, options.lambda as f32);
        let (mut places, mut targets) = (Vec::new(), Vec::new());
        for window in 0..batch {
            let mut target = first[(length - 1) * batch + window];
            for step in (0..length - 1).rev() {
                let (here, next) = (step * batch + window, (step + 1) * batch + window);
                target = rows.rewards[here] + discount * ((1.0 - lambda) * first[next] + lambda * target);
                if rows.counted[here] && target.is_finite() {
                    places.push(here as i64);
                    targets.push(target);
                }
            }
        }
        if places.is_empty() {
            return None;
        }
        let count = places.len();
        let starts = rows.starts(&places, &self.device);
        let targets = Tensor::from_data(TensorData::new(targets, [count]), &self.device);
        Some((vibes_model::actor::features(starts.states, starts.latents), targets))
    }

    /// To be minimised: the critic's loss on imagined rows (with the slow copy's values as a second target, by its weight) and on recorded ones.
    fn critic_loss(
        &self,
        features: Tensor<3>,
        returns: Tensor<2>,
        replayed: Option<(Tensor<2>, Tensor<1>)>,
        divisor: f64,
        options: &BehaviourOptions,
    ) -> Tensor<1> {
        let Behaviour { critic, slow, .. } = &self.behaviour;
        let (distribution, [horizon, rows]) = (critic.distribution(), returns.dims());
        // Gaussian losses grow with the square of the returns; in units of their scale the step size means the same for every task.
        let unit = if options.normalize_returns { distribution.loss_unit(divisor) } else { 1.0 };
        let width = features.dims()[2];
        let seen = features.narrow(0, 0, horizon).reshape([horizon * rows, width]);
        let output = critic.mlp.forward(seen.clone());
        let mut loss = distribution.loss(output.clone(), returns.reshape([horizon * rows]));
        if options.slow_weight > 0.0 {
            loss = loss + distribution.loss(output, slow.values(seen)) * options.slow_weight;
        }
        let weights = options.weights(horizon, rows, &self.device).reshape([horizon * rows]);
        let mut total = (loss * weights).mean();
        if let Some((seen, targets)) = replayed {
            let output = critic.mlp.forward(seen.clone());
            let mut loss = distribution.loss(output.clone(), targets);
            if options.slow_weight > 0.0 {
                loss = loss + distribution.loss(output, slow.values(seen)) * options.slow_weight;
            }
            total = total + loss.mean() * options.replay_value;
        }
        total / unit
    }

    fn critic_step(&mut self, loss: &Tensor<1>, options: &BehaviourOptions) -> Result<f32> {
        let gradients = NamedGradients::take(&self.behaviour.critic, &mut loss.backward());
        let norm = finite("the critic's gradient norm", gradients.norm(""))?;
        let critic = self.behaviour.critic.clone();
        self.behaviour.critic =
            self.critic_optimizer.step(critic, gradients, options.critic_lr, options.gradient_clip as f32);
        self.behaviour.slow = self.behaviour.slow.clone().towards(&self.behaviour.critic, options.slow_rate as f32);
        Ok(norm)
    }
}

impl Replayed {
    /// The counted rows at every `every`th step of their window, by their place in `[length·batch]`; windows side by side begin at other steps, so that none is left out.
    pub fn chosen(&self, every: usize) -> Vec<i64> {
        let [_, batch, _] = self.latents.dims();
        let is_chosen = |place: usize| (place / batch + place % batch).is_multiple_of(every.max(1));
        let counted = self.counted.iter().enumerate().filter(|(place, counted)| **counted && is_chosen(*place));
        counted.map(|(place, _)| place as i64).collect()
    }

    /// These rows as starts.
    pub fn starts(&self, places: &[i64], device: &Device) -> Starts {
        let places = Tensor::<1, Int>::from_data(TensorData::new(places.to_vec(), [places.len()]), device);
        let of = |rows: &Tensor<3>| {
            let [length, batch, width] = rows.dims();
            rows.clone().reshape([length * batch, width]).select(0, places.clone())
        };
        Starts { states: of(&self.states), latents: of(&self.latents) }
    }

    /// From an update's tensors, which may be followed by autodiff: `states_after` are the dynamics' states after each row
    /// but the last: `[length − 1, batch, hidden]`.
    pub fn detached(
        latents: Tensor<3>,
        states_after: Tensor<3>,
        actions: Tensor<3>,
        rewards: Vec<f32>,
        (counted, episodes): (Vec<bool>, Vec<u32>),
    ) -> Self {
        let after = states_after.inner();
        let [_, batch, width] = after.dims();
        let first = Tensor::<3>::zeros([1, batch, width], &after.device());
        let states = Tensor::cat(vec![first, after], 0);
        Self { latents: latents.inner(), states, actions: actions.inner(), rewards, counted, episodes }
    }
}

fn mean(values: &[f32]) -> f32 {
    (values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len().max(1) as f64) as f32
}

fn ms(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests;
