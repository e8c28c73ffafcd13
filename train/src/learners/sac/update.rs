//! One update of a model-free agent. In: a batch of transitions. Out: the networks after one step of the critics (and of what stands beside them) and, every so often, of
//! the actor, the temperature and the slow copy.
//!
//! ```text
//! y = r + γ mean_K [ min(Q′₁, Q′₂)(o′, a′) − α log π(a′|o′) ],  a′ ~ π(·|o′)        critics: Σ_M mean [(Q₁ − y)² + (Q₂ − y)²] + w · auxiliary
//! actor: mean [α log π − min(Q₁, Q₂)]      temperature: mean α (−log π − H̄),  H̄ = −|A|
//! ```
//!
//! Without an actor (QT-Opt) a′ is the best action the slow critics know, found by the cross-entropy method, there is no entropy, and errors are Huber's. The actor
//! looks through the critics' convolutions, whose maps are constants to it.

use burn::module::Module;
use burn::tensor::{Device, Gradients, Int, Tensor};
use rand::Rng;
use vibes_model::actions::noise;
use vibes_model::sac::SacNetworks;
use vibes_model::slow::towards;

use super::auxiliary::{Moment, auxiliary_loss};
use super::options::SacOptions;
use super::transitions::Transitions;
use crate::error::Result;
use crate::learners::losses::actor_critic::{
    actor_loss, critic_loss, huber_critic_loss, over_views, soft_value, target, temperature_loss,
};
use crate::learners::number::{finite, scalar};
use crate::learners::optimizer::{NamedGradients, Optimizer};

/// Gradients are not limited.
const NO_CLIP: f32 = f32::INFINITY;

/// A model-free agent in training.
#[derive(Debug, Clone)]
pub struct SacLearner {
    /// The networks.
    pub networks: SacNetworks,
    /// Adam for each of them.
    pub optimizers: Optimizers,
    device: Device,
}

/// One Adam for every group of parameters with a loss or a rate of its own.
#[derive(Debug, Clone)]
pub struct Optimizers {
    /// Critics and convolutions.
    pub critic: Optimizer,
    /// What stands beside them.
    pub further: Optimizer,
    /// The actor.
    pub actor: Optimizer,
    /// The temperature.
    pub temperature: Optimizer,
}

/// What one update measured.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SacMeasures {
    /// The critics' loss, added up over views.
    pub critic_loss: f32,
    /// What stands beside it, before its weight.
    pub auxiliary_loss: Option<f32>,
    /// Mean of the targets.
    pub target: f32,
    /// The actor's loss, where it made a step.
    pub actor_loss: Option<f32>,
    /// Mean of −log π, where the actor made a step.
    pub entropy: Option<f32>,
    /// The weight of entropy.
    pub temperature: f32,
}

impl SacLearner {
    /// A learner before its first update; `device` is one without autodiff.
    pub fn new(networks: SacNetworks, device: &Device) -> Self {
        let optimizer = || Optimizer::new(1e-8);
        let networks = SacNetworks {
            critic: networks.critic.train(),
            actor: networks.actor.map(Module::train),
            temperature: networks.temperature.train(),
            further: networks.further.train(),
            ..networks
        };
        let optimizers =
            Optimizers { critic: optimizer(), further: optimizer(), actor: optimizer(), temperature: optimizer() };
        Self { networks, optimizers, device: device.clone() }
    }

    /// Makes one update, after `made` others; `rng` is for views, actions and partners.
    ///
    /// # Errors
    /// A loss or a gradient is no longer a number; the learner is gone then, and its last checkpoint is where to go on.
    pub fn update(
        mut self,
        batch: &Transitions,
        options: &SacOptions,
        made: u64,
        rng: &mut impl Rng,
    ) -> Result<(Self, SacMeasures)> {
        let temperature = self.networks.temperature.log.val().exp().into_scalar::<f32>();
        let target = self.target(batch, options, temperature, rng);
        let mut measures =
            SacMeasures { temperature, target: target.clone().mean().into_scalar(), ..SacMeasures::default() };
        let views: Vec<Tensor<4, Int>> =
            (0..options.views.max(1)).map(|_| batch.view(options.augment, rng, &self.device)).collect();
        self = self.critic_step(batch, &views, &Tensor::from_inner(target), options, &mut measures, rng)?;
        if made.is_multiple_of(options.actor_every.max(1)) {
            self = self.actor_step(views[0].clone(), temperature, options, &mut measures, rng)?;
            self = self.follow(options);
        }
        Ok((self, measures))
    }

    /// What the critics should say, over views of the next stacks: `[rows]`, without autodiff.
    fn target(&self, batch: &Transitions, options: &SacOptions, temperature: f32, rng: &mut impl Rng) -> Tensor<1> {
        let critic = self.networks.critic.valid();
        let actor = self.networks.actor.as_ref().map(Module::valid);
        let slow = &self.networks.slow;
        let width = self.networks.config.actions();
        let values = (0..options.next_views.max(1)).map(|_| {
            let pixels = batch.next_view(options.augment, rng, &self.device);
            let features = slow.features(pixels.clone());
            match &actor {
                Some(actor) => {
                    let actions = actor.forward(critic.convolutions.forward(pixels));
                    let sample = actions.sample(noise([batch.rows, width], rng, &self.device));
                    let log_prob = actions.log_prob(sample.normal).squeeze_dim(1);
                    soft_value(slow.values(features, sample.action), log_prob, temperature)
                }
                None => {
                    let search = self.networks.config.search.unwrap_or_default();
                    let action = slow.best_action(features.clone(), search, [batch.rows, width], rng);
                    soft_value(slow.values(features, action), Tensor::zeros([batch.rows], &self.device), 0.0)
                }
            }
        });
        let value = over_views(values.collect());
        target(batch.rewards(&self.device), value, options.discount as f32)
    }

    fn critic_step(
        mut self,
        batch: &Transitions,
        views: &[Tensor<4, Int>],
        target: &Tensor<1>,
        options: &SacOptions,
        measures: &mut SacMeasures,
        rng: &mut impl Rng,
    ) -> Result<Self> {
        let device = self.device.clone().autodiff();
        let actions = batch.actions(&device);
        let maps: Vec<Tensor<2>> =
            views.iter().map(|pixels| self.networks.critic.convolutions.forward(pixels.clone())).collect();
        let features: Vec<Tensor<2>> =
            maps.iter().map(|maps| self.networks.critic.trunk.forward(maps.clone())).collect();
        let of_view = |features: &Tensor<2>| {
            let values = self.networks.critic.values(features.clone(), actions.clone());
            if self.networks.config.search.is_none() {
                critic_loss(values, target)
            } else {
                huber_critic_loss(values, target)
            }
        };
        let mut loss = of_view(&features[0]);
        for features in &features[1..] {
            loss = loss + of_view(features);
        }
        measures.critic_loss = finite("the critics' loss", scalar(&loss))?;
        let moment = Moment { features: features[0].clone(), maps, actions, batch, options };
        if let Some(auxiliary) = auxiliary_loss(&self.networks, &moment, &self.device, rng)? {
            measures.auxiliary_loss = Some(finite("the auxiliary loss", scalar(&auxiliary))?);
            loss = loss + auxiliary * options.auxiliary_weight as f32;
        }
        drop((moment, features));
        let mut gradients = loss.backward();
        let of_critic = NamedGradients::take(&self.networks.critic, &mut gradients);
        let of_further = NamedGradients::take(&self.networks.further, &mut gradients);
        finite("the critics' gradient norm", of_critic.norm(""))?;
        finite("the auxiliary loss's gradient norm", of_further.norm(""))?;
        self.networks.critic = self.optimizers.critic.step(self.networks.critic, of_critic, options.lr, NO_CLIP);
        self.networks.further = self.optimizers.further.step(self.networks.further, of_further, options.lr, NO_CLIP);
        if options.auxiliary.sequence() > 0 {
            self = self.trunk_step(&mut gradients, options)?;
        }
        Ok(self)
    }

    /// What stands beside the critics' loss looks through the actor's trunk, which learns from it by the actor's Adam.
    fn trunk_step(mut self, gradients: &mut Gradients, options: &SacOptions) -> Result<Self> {
        let Some(actor) = self.networks.actor.take() else { return Ok(self) };
        let of_trunk = NamedGradients::take(&actor, gradients);
        finite("the trunk's gradient norm", of_trunk.norm(""))?;
        self.networks.actor = Some(self.optimizers.actor.step(actor, of_trunk, options.lr, NO_CLIP));
        Ok(self)
    }

    fn actor_step(
        mut self,
        pixels: Tensor<4, Int>,
        temperature: f32,
        options: &SacOptions,
        measures: &mut SacMeasures,
        rng: &mut impl Rng,
    ) -> Result<Self> {
        let Some(actor) = self.networks.actor.take() else { return Ok(self) };
        let (rows, width) = (pixels.dims()[0], self.networks.config.actions());
        let critic = self.networks.critic.valid();
        let maps = critic.convolutions.forward(pixels);
        let features: Tensor<2> = Tensor::from_inner(critic.trunk.forward(maps.clone()));
        let actions = actor.forward(Tensor::from_inner(maps));
        let sample = actions.sample(Tensor::from_inner(noise([rows, width], rng, &self.device)));
        let log_prob = actions.log_prob(sample.normal).squeeze_dim::<1>(1);
        let loss = actor_loss(critic.values(features, sample.action), log_prob.clone(), temperature);
        measures.actor_loss = Some(finite("the actor's loss", scalar(&loss))?);
        measures.entropy = Some(-log_prob.clone().mean().into_scalar::<f32>());
        let gradients = NamedGradients::take(&actor, &mut loss.backward());
        finite("the actor's gradient norm", gradients.norm(""))?;
        self.networks.actor = Some(self.optimizers.actor.step(actor, gradients, options.lr, NO_CLIP));
        let loss = temperature_loss(self.networks.temperature.log.val(), log_prob, -(width as f32));
        let gradients = NamedGradients::take(&self.networks.temperature, &mut loss.backward());
        finite("the temperature's gradient norm", gradients.norm(""))?;
        let module = self.networks.temperature;
        self.networks.temperature =
            self.optimizers.temperature.step(module, gradients, options.temperature_lr, NO_CLIP);
        Ok(self)
    }

    /// The slow copy goes its share of the way.
    fn follow(mut self, options: &SacOptions) -> Self {
        let rate = |name: &str| {
            let is_encoder = name.starts_with("convolutions") || name.starts_with("trunk");
            (if is_encoder { options.encoder_rate } else { options.critic_rate }) as f32
        };
        self.networks.slow = towards(self.networks.slow, &self.networks.critic, rate);
        self
    }
}
