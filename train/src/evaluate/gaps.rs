//! How far from a bisimulation: what a fresh critic that sees the whole history can still predict better than the model can from its latents. In: a trained model,
//! the recordings it was trained on, a held-out recording. Out: two gaps in nats a row, for the next latent and for the reward.
//!
//! The encoder and the model are held fixed. The critic is built like the adversary, with a second head for the reward `r_t` after it has seen
//! `o_≤t, s_≤t, a_≤t`, and both heads correct the model's own predictions: they begin with no correction, so that the gaps begin at 0 and every nat above it is
//! something the critic found. It learns on the training recordings and is judged on the held-out one. Both gaps would be 0 at a global optimum of the
//! objective. They are estimates from below: a critic that is fitted too briefly finds too little, one that does not carry over to new distractors loses some of it
//! again and can end below 0.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::Recording;
use vibes_model::Model;
use vibes_model::adversary::Adversary;
use vibes_model::gaussian::{Gaussian, unit_norm};
use vibes_model::init::normal;
use vibes_model::mlp::{Mlp, MlpConfig};

use crate::batch::Batch;
use crate::encode::check_fit;
use crate::error::Result;
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::options::Options;
use crate::windows::Windows;

/// How to fit the critic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GapOptions {
    /// Updates of the critic.
    pub updates: u64,
    /// Held-out batches to judge it on.
    pub batches: u64,
    /// Windows a batch.
    pub batch: usize,
    /// Rows a window.
    pub length: usize,
    /// First rows that carry no term, as in training.
    pub burn_in: usize,
    /// Adam's step size.
    pub lr: f64,
    /// Seed of its weights, windows and noise.
    pub seed: u64,
}

impl GapOptions {
    /// As the run's own adversary was trained, for so many updates.
    pub fn like(options: &Options, updates: u64) -> Self {
        Self {
            updates,
            batches: 50,
            batch: options.batch,
            length: options.length,
            burn_in: options.burn_in,
            lr: options.adversary_lr,
            seed: options.seed,
        }
    }
}

/// Held-out log-likelihoods, nats a row, and their differences.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Gaps {
    /// The next latent under the model's dynamics.
    pub dynamics: f64,
    /// The next latent under the critic.
    pub dynamics_of_critic: f64,
    /// Critic minus dynamics.
    pub dynamics_gap: f64,
    /// The reward under the model.
    pub reward: f64,
    /// The reward under the critic.
    pub reward_of_critic: f64,
    /// Critic minus model.
    pub reward_gap: f64,
}

/// Corrections of the model's predictions, from the whole history.
#[derive(Module, Debug)]
struct Critic {
    /// Its head corrects the dynamics.
    adversary: Adversary,
    /// Corrects the reward.
    reward: Mlp,
}

/// Fits a critic and measures both gaps.
///
/// # Errors
/// A recording does not fit the model or has no episode as long as a window.
pub fn gaps(
    model: &Model,
    training: &[Recording],
    held_out: &Recording,
    options: GapOptions,
    device: &Device,
) -> Result<Gaps> {
    for recording in training.iter().chain([held_out]) {
        check_fit(model, recording)?;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let fixed = Model { config: model.config.clone(), world: model.world.valid(), adversary: None };
    let critic = fit_critic(&fixed, training, options, device, &mut rng)?.valid();
    let windows = Windows::new(std::slice::from_ref(held_out), options.length, options.batch)?;
    let mut sums = Gaps::default();
    for _ in 0..options.batches {
        let batch = Batch::new(&windows.sample(&mut rng), &fixed.config, options.burn_in, device)?;
        let scene = Scene::new(&fixed, &batch, device, &mut rng)?;
        let (dynamics_of_critic, reward_of_critic) = scene.critic_log_likelihoods(&critic, &fixed)?;
        let (dynamics, reward) = scene.model_log_likelihoods(&fixed);
        let weight = 1.0 / options.batches as f64;
        sums.dynamics += weight * scalar(&dynamics);
        sums.dynamics_of_critic += weight * scalar(&dynamics_of_critic);
        sums.reward += weight * scalar(&reward);
        sums.reward_of_critic += weight * scalar(&reward_of_critic);
    }
    let (dynamics_gap, reward_gap) = (sums.dynamics_of_critic - sums.dynamics, sums.reward_of_critic - sums.reward);
    Ok(Gaps { dynamics_gap, reward_gap, ..sums })
}

fn fit_critic(
    model: &Model,
    training: &[Recording],
    options: GapOptions,
    device: &Device,
    rng: &mut ChaCha8Rng,
) -> Result<Critic> {
    let config = &model.config;
    let mut adversary = Adversary::init(config, rng, device)?;
    adversary.head = adversary.head.silenced();
    let reward = MlpConfig { input: config.hidden, hidden: config.head, output: 2 }.init(rng, device).silenced();
    let mut critic = Critic { adversary, reward }.train();
    let windows = Windows::new(training, options.length, options.batch)?;
    let mut optimizer = Optimizer::new(1e-8);
    for _ in 0..options.updates {
        let batch = Batch::new(&windows.sample(rng), config, options.burn_in, device)?;
        let scene = Scene::new(model, &batch, device, rng)?;
        let (dynamics, reward) = scene.critic_log_likelihoods(&critic, model)?;
        let gradients = NamedGradients::take(&critic, &mut (dynamics + reward).neg().backward());
        critic = optimizer.step(critic, gradients, options.lr, 100.0);
    }
    Ok(critic)
}

/// A batch with sampled latents.
struct Scene<'a> {
    batch: &'a Batch,
    latents: Tensor<3>,
}

impl<'a> Scene<'a> {
    fn new(model: &Model, batch: &'a Batch, device: &Device, rng: &mut impl Rng) -> Result<Self> {
        let means = model.world.encoder.forward(batch.frames.clone(), batch.previous_actions.clone(), None)?.means;
        let noise = TensorData::new(normal(means.shape().num_elements(), rng), means.dims());
        let latents = means + Tensor::<3>::from_data(noise, device) * model.config.latent_std;
        Ok(Self { batch, latents })
    }

    /// Of the next latent and of the reward.
    fn predictions(&self, model: &Model) -> (Gaussian, Gaussian) {
        let (dynamics, _) = model.world.dynamics.forward(self.latents.clone(), self.batch.actions.clone(), None);
        (dynamics, model.world.reward.forward(self.latents.clone(), self.batch.actions.clone()))
    }

    fn model_log_likelihoods(&self, model: &Model) -> (Tensor<1>, Tensor<1>) {
        let (dynamics, reward) = self.predictions(model);
        (self.of_next_latents(&dynamics), self.of_rewards(&reward))
    }

    fn critic_log_likelihoods(&self, critic: &Critic, model: &Model) -> Result<(Tensor<1>, Tensor<1>)> {
        let features = critic.adversary.observe.forward(self.batch.frames.clone(), self.batch.length)?;
        let states = critic.adversary.states(features, self.latents.clone(), self.batch.actions.clone());
        let (dynamics, reward) = self.predictions(model);
        let dynamics =
            corrected(&dynamics, critic.adversary.head.forward(states.clone()), model.config.prediction_floor);
        let dynamics = Gaussian { mean: unit_norm(dynamics.mean), ..dynamics };
        let reward = corrected(&reward, critic.reward.forward(states), model.config.reward_floor);
        Ok((self.of_next_latents(&dynamics), self.of_rewards(&reward)))
    }

    /// Mean over the rows that count and have a successor in the window.
    fn of_next_latents(&self, prediction: &Gaussian) -> Tensor<1> {
        let pairs = self.batch.length - 1;
        let before = |x: Tensor<3>| x.narrow(0, 0, pairs);
        let prediction = Gaussian { mean: before(prediction.mean.clone()), std: before(prediction.std.clone()) };
        let counted = self.batch.counted.clone().narrow(0, 1, pairs);
        let log_prob = prediction.log_prob(self.latents.clone().narrow(0, 1, pairs)) * counted.clone();
        log_prob.sum() / counted.sum()
    }

    fn of_rewards(&self, prediction: &Gaussian) -> Tensor<1> {
        (prediction.log_prob(self.batch.rewards.clone()) * self.batch.counted.clone()).sum() / self.batch.count
    }
}

/// A prediction with its mean moved by the first columns of `correction`, in units of its own standard deviation, and what its standard deviation has above
/// `floor` scaled by the exponential of the last.
fn corrected(prediction: &Gaussian, correction: Tensor<3>, floor: f32) -> Gaussian {
    let dims = correction.dims()[2] - 1;
    let above = (prediction.std.clone() - floor) * correction.clone().narrow(2, dims, 1).exp();
    let mean = prediction.mean.clone() + correction.narrow(2, 0, dims) * prediction.std.clone();
    Gaussian { mean, std: above + floor }
}

fn scalar(value: &Tensor<1>) -> f64 {
    f64::from(value.clone().into_scalar::<f32>())
}
