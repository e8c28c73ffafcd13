//! One update of a recurrent agent. In: windows of a replay. Out: the networks after one step of encoder, dynamics and critics on one loss, and of actor, temperature and
//! slow copy.
//!
//! ```text
//! y_t = r_t + γ [ min(Q′₁, Q′₂)(z_{t+1}, a′) − α log π(a′|z_{t+1}) ],  z = (h, mean of s)        L = w_q Σ mean (Q − y)² + the model's losses
//! actor: mean [α log π − min(Q₁, Q₂)] on z without gradient      temperature: mean α (−log π − H̄),  H̄ = −|A|
//! ```

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;
use vibes_data::WindowBatch;
use vibes_model::ObservationKind;
use vibes_model::actions::noise;
use vibes_model::actor::features;
use vibes_model::recurrent::{RecurrentConfig, RecurrentNetworks};
use vibes_model::sac::cut::{Border, cut};
use vibes_model::slow::towards;

use super::model_losses::{self, Pairs};
use super::options::RecurrentOptions;
use crate::batch::Batch;
use crate::error::Result;
use crate::learners::losses::actor_critic::{actor_loss, critic_loss, soft_value, target, temperature_loss};
use crate::learners::number::{finite, scalar};
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::learners::sac::augment::Augment;
use crate::learners::sac::update::SacMeasures;

/// Largest norms of the gradients of model, critics, actor and temperature (apple/ml-core).
const CLIPS: [f32; 4] = [10.0, 100.0, 10.0, 1.0];

/// A recurrent agent in training.
#[derive(Debug, Clone)]
pub struct RecurrentLearner {
    /// The networks.
    pub networks: RecurrentNetworks,
    /// Adam for each of them.
    pub optimizers: Optimizers,
    device: Device,
}

/// One Adam for every group of parameters with a rate of its own.
#[derive(Debug, Clone)]
pub struct Optimizers {
    /// Encoder, dynamics and heads.
    pub model: Optimizer,
    /// The critics.
    pub critic: Optimizer,
    /// The actor.
    pub actor: Optimizer,
    /// The temperature.
    pub temperature: Optimizer,
}

impl RecurrentLearner {
    /// A learner before its first update; `device` is one without autodiff.
    pub fn new(networks: RecurrentNetworks, device: &Device) -> Self {
        let optimizer = || Optimizer::new(1e-8);
        let networks = RecurrentNetworks {
            world: networks.world.train(),
            critic: networks.critic.train(),
            actor: networks.actor.train(),
            temperature: networks.temperature.train(),
            ..networks
        };
        let optimizers =
            Optimizers { model: optimizer(), critic: optimizer(), actor: optimizer(), temperature: optimizer() };
        Self { networks, optimizers, device: device.clone() }
    }

    /// Makes one update; `rng` is for views, latents and actions.
    ///
    /// # Errors
    /// A loss or a gradient is no longer a number; the learner is gone then, and its last checkpoint is where to go on. Or the windows do not fit.
    pub fn update(
        mut self,
        windows: &WindowBatch,
        options: &RecurrentOptions,
        rng: &mut impl Rng,
    ) -> Result<(Self, SacMeasures)> {
        let seen = view(windows, &self.networks.config, options.augment, rng);
        let pairs = self.pairs(&seen, rng)?;
        let temperature = self.networks.temperature.log.val().exp().into_scalar::<f32>();
        let target = self.target(&pairs, temperature, options, rng);
        let mut measures =
            SacMeasures { temperature, target: target.clone().mean().into_scalar(), ..SacMeasures::default() };
        let values = self.networks.critic.values(pairs.before.clone(), pairs.actions.clone());
        let of_critics = critic_loss(values, &Tensor::from_inner(target));
        measures.critic_loss = finite("the critics' loss", scalar(&of_critics))?;
        let mut loss = of_critics * options.critic_weight as f32;
        if options.has_model_losses() {
            let std = self.networks.config.model.latent_std;
            let beside = model_losses::loss(&self.networks.world, std, &pairs, options)?;
            measures.auxiliary_loss = Some(finite("the model's losses", scalar(&beside))?);
            loss = loss + beside;
        }
        let states = pairs.before.clone().inner();
        drop(pairs);
        let mut gradients = loss.backward();
        let of_model = NamedGradients::take(&self.networks.world, &mut gradients);
        let of_critic = NamedGradients::take(&self.networks.critic, &mut gradients);
        finite("the model's gradient norm", of_model.norm(""))?;
        finite("the critics' gradient norm", of_critic.norm(""))?;
        let Optimizers { model, critic, .. } = &mut self.optimizers;
        self.networks.world = model.step(self.networks.world, of_model, options.model_lr, CLIPS[0]);
        self.networks.critic = critic.step(self.networks.critic, of_critic, options.lr, CLIPS[1]);
        self = self.actor_step(states, temperature, options, &mut measures, rng)?;
        let rate = options.slow_rate as f32;
        self.networks.slow = towards(self.networks.slow, &self.networks.critic, |_| rate);
        Ok((self, measures))
    }

    /// What the networks make of windows: each row but the first with the row before it.
    fn pairs(&self, windows: &WindowBatch, rng: &mut impl Rng) -> Result<Pairs> {
        let device = self.device.clone().autodiff();
        let (world, config) = (&self.networks.world, &self.networks.config.model);
        let batch = Batch::new(windows, config, 0, &device)?;
        let encoding = world.encoder.forward(batch.frames, batch.previous_actions, None)?;
        let [length, count, latent] = encoding.means.dims();
        let spread = noise([length * count, latent], rng, &self.device).reshape([length, count, latent]);
        let latents = encoding.means.clone() + Tensor::from_inner(spread) * config.latent_std;
        let (pairs, rows) = (length - 1, (length - 1) * count);
        let first = |x: &Tensor<3>| x.clone().narrow(0, 0, pairs);
        let last = |x: &Tensor<3>| x.clone().narrow(0, 1, pairs);
        let flat = |x: Tensor<3>| {
            let width = x.dims()[2];
            x.reshape([rows, width])
        };
        let (prior, after) = world.dynamics.forward(first(&latents), first(&batch.actions), None);
        let hidden = after.dims()[2];
        let states = Tensor::cat(vec![Tensor::zeros([1, count, hidden], &device), after], 0);
        let states = features(states, encoding.means.clone());
        Ok(Pairs {
            before: flat(first(&states)),
            after: flat(last(&states)),
            actions: flat(first(&batch.actions)),
            rewards: flat(first(&batch.rewards)).squeeze_dim(1),
            features: flat(last(&encoding.features)),
            means: flat(last(&encoding.means)),
            prior,
        })
    }

    /// What the critics should say: `[rows]`, without autodiff.
    fn target(&self, pairs: &Pairs, temperature: f32, options: &RecurrentOptions, rng: &mut impl Rng) -> Tensor<1> {
        let next = pairs.after.clone().inner();
        let [rows, width] = [next.dims()[0], self.networks.config.model.actions()];
        let actions = self.networks.actor.valid().forward(next.clone());
        let sample = actions.sample(noise([rows, width], rng, &self.device));
        let log_prob = actions.log_prob(sample.normal).squeeze_dim(1);
        let value = soft_value(self.networks.slow.values(next, sample.action), log_prob, temperature);
        target(pairs.rewards.clone().inner(), value, options.discount as f32)
    }

    fn actor_step(
        mut self,
        states: Tensor<2>,
        temperature: f32,
        options: &RecurrentOptions,
        measures: &mut SacMeasures,
        rng: &mut impl Rng,
    ) -> Result<Self> {
        let [rows, width] = [states.dims()[0], self.networks.config.model.actions()];
        let states: Tensor<2> = Tensor::from_inner(states);
        let actor = self.networks.actor;
        let actions = actor.forward(states.clone());
        let sample = actions.sample(Tensor::from_inner(noise([rows, width], rng, &self.device)));
        let log_prob = actions.log_prob(sample.normal).squeeze_dim::<1>(1);
        let values = self.networks.critic.valid().values(states, sample.action);
        let loss = actor_loss(values, log_prob.clone(), temperature);
        measures.actor_loss = Some(finite("the actor's loss", scalar(&loss))?);
        measures.entropy = Some(-log_prob.clone().mean().into_scalar::<f32>());
        let gradients = NamedGradients::take(&actor, &mut loss.backward());
        finite("the actor's gradient norm", gradients.norm(""))?;
        self.networks.actor = self.optimizers.actor.step(actor, gradients, options.lr, CLIPS[2]);
        let loss = temperature_loss(self.networks.temperature.log.val(), log_prob, -(width as f32));
        let gradients = NamedGradients::take(&self.networks.temperature, &mut loss.backward());
        finite("the temperature's gradient norm", gradients.norm(""))?;
        let Self { networks, optimizers, .. } = &mut self;
        let module = networks.temperature.clone();
        networks.temperature = optimizers.temperature.step(module, gradients, options.temperature_lr, CLIPS[3]);
        Ok(self)
    }
}

/// The windows with their pictures cut, each window at a place of its own that all its pictures share.
fn view(windows: &WindowBatch, config: &RecurrentConfig, augment: Augment, rng: &mut impl Rng) -> WindowBatch {
    let [height, width] = config.picture;
    let size = match config.model.observation {
        ObservationKind::Pixels { height, width } => [height, width],
        ObservationKind::Vector { .. } => config.picture,
    };
    let places: Vec<[i32; 2]> = (0..windows.batch).map(|_| augment.draw(config.picture, rng)).collect();
    let mut pixels = Vec::with_capacity(windows.length * windows.batch * 3 * size[0] * size[1]);
    for (row, picture) in windows.pixels.chunks_exact((3 * height * width).max(1)).enumerate() {
        let place = places[row % windows.batch.max(1)];
        cut(picture, [height, width, 3], place, size, Border::Repeated, &mut pixels);
    }
    WindowBatch { pixels, ..windows.clone() }
}
