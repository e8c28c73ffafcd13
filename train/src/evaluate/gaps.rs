//! How far from a bisimulation: what a fresh critic that sees the whole history can still predict better than anyone could from the model's own state. In: a trained
//! model, the recordings it was trained on, a held-out recording. Out: two gaps in nats a row, for the next latent and for the reward, on the training
//! recordings and on the held-out one.
//!
//! The encoder and the model are held fixed. Two networks learn to correct the model's predictions, side by side on the same batches of the training recordings;
//! both begin with no correction. The *critic* is built like the adversary and sees `o_≤t, s_≤t, a_≤t`. The *refitted heads* see `(h_t, s_t, a_t)` alone,
//! what the model itself has: what they gain, the model could have known, so that its heads were merely fitted too briefly. A gap is the critic's
//! log-likelihood minus the refitted heads'.
//!
//! Both gaps would be 0 at a global optimum of the objective. They are estimates: a critic that is fitted too briefly finds too little (`half_way` says what it
//! had found after half of its updates), and one that does not carry over to new distractors loses some of it again on the held-out recording and can end
//! below 0, so that the training gap stands beside. Not every nat of a gap is something the latents have lost: the critic sees clean pictures where the model sees
//! noisy latents, so that even a perfect filter pays for its noise.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{Recording, WindowSampler};
use vibes_measure::intervals::{Interval, Trajectories};
use vibes_model::Model;
use vibes_model::adversary::Adversary;
use vibes_model::gaussian::Gaussian;
use vibes_model::init::normal;
use vibes_model::mlp::{Mlp, MlpConfig};
use vibes_model::parameters::to_values;

use super::rows::trajectories;
use crate::batch::Batch;
use crate::encode::check_fit;
use crate::error::{Result, TrainError};
use crate::learners::optimizer::{NamedGradients, Optimizer};
use crate::options::Options;
use crate::windows::Windows;

/// Updates of the critic that are made at a stretch.
const STRETCH: u64 = 10;

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

/// The gaps, nats a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gaps {
    /// Of the next latent, on the held-out recording.
    pub dynamics_gap: f64,
    /// Of the reward, on the held-out recording.
    pub reward_gap: f64,
    /// On the held-out recording.
    pub held_out: Judged,
    /// On the training recordings.
    pub training: Judged,
    /// On the held-out recording, after half of the updates.
    pub half_way: Judged,
}

/// Both quantities on one kind of recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Judged {
    /// The next latent.
    pub dynamics: Likelihoods,
    /// The reward.
    pub reward: Likelihoods,
}

/// Mean log-likelihoods of one quantity, nats a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Likelihoods {
    /// Under the model.
    pub model: f64,
    /// Under the model with heads refitted on `(h, s, a)`.
    pub refitted: f64,
    /// Under the critic.
    pub critic: f64,
    /// Critic minus refitted heads, with a 95% interval over state (and, on a grid, distractor) trajectories.
    pub gap: Interval,
}

/// Corrections of the model's predictions, from the whole history.
#[derive(Module, Debug)]
struct Critic {
    /// Its head corrects the dynamics.
    adversary: Adversary,
    /// Corrects the reward.
    reward: Mlp,
}

/// Corrections of the model's predictions, from its own state and the action.
#[derive(Module, Debug)]
struct Refitted {
    /// Corrects the dynamics.
    dynamics: Mlp,
    /// Corrects the reward.
    reward: Mlp,
}

/// The two correctors and their optimisers.
struct Correctors {
    critic: Critic,
    refitted: Refitted,
    optimizers: [Optimizer; 2],
}

/// That the gaps' critic can be fitted on these recordings, in windows of `length` rows, and judged on the held-out one: to be known before anything is computed.
///
/// # Errors
/// A recording does not fit the model, or has no episode as long as a window.
pub fn check_gaps(model: &Model, training: &[Recording], held_out: &Recording, length: usize) -> Result<()> {
    for recording in std::iter::once(held_out).chain(training) {
        check_fit(model.into(), recording)?;
        check_windows(recording, length)?;
    }
    Ok(())
}

/// That a recording has windows of `length` rows, without which there are no gaps; everything else can be measured all the same.
///
/// # Errors
/// No episode is as long.
pub fn check_windows(recording: &Recording, length: usize) -> Result<()> {
    WindowSampler::check_length(recording, length).map_err(|error| match error {
        vibes_data::Error::WindowTooLong { length, longest, path } => TrainError::OtherRecording {
            found: format!("no episode of more than {longest} steps"),
            wanted: format!("one of {length} for the gaps to a bisimulation, which --gap-updates 0 leaves out"),
            path,
        },
        other => other.into(),
    })
}

/// Fits a critic and refits the heads, and measures both gaps.
///
/// # Errors
/// A recording does not fit the model, or has no episode as long as a window.
pub fn gaps(
    model: &Model,
    training: &[Recording],
    held_out: &Recording,
    options: GapOptions,
    device: &Device,
) -> Result<Gaps> {
    gaps_while(model, training, held_out, options, device, &mut || Ok(()))
}

/// The same where `go_on` is asked after every few updates of the critic and before it is judged, and ends it with the error that it gives.
///
/// # Errors
/// As [`gaps`], or what `go_on` says.
pub fn gaps_while(
    model: &Model,
    training: &[Recording],
    held_out: &Recording,
    options: GapOptions,
    device: &Device,
    go_on: &mut dyn FnMut() -> Result<()>,
) -> Result<Gaps> {
    check_gaps(model, training, held_out, options.length)?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let fixed = Model { config: model.config.clone(), world: model.world.valid(), adversary: None };
    let mut correctors = Correctors::new(&fixed, device, &mut rng)?;
    let windows = Windows::new(training, options.length, options.batch)?;
    let held_out = std::slice::from_ref(held_out);
    let half = options.updates / 2;
    for updates in stretches(half) {
        correctors.fit(&fixed, &windows, options, updates, device, &mut rng)?;
        go_on()?;
    }
    // Judged on the same windows and noise each time.
    let judge = |correctors: &Correctors, recordings: &[Recording]| {
        correctors.judge(&fixed, recordings, options, device, &mut ChaCha8Rng::seed_from_u64(options.seed ^ 1))
    };
    let half_way = judge(&correctors, held_out)?;
    for updates in stretches(options.updates - half) {
        correctors.fit(&fixed, &windows, options, updates, device, &mut rng)?;
        go_on()?;
    }
    let held_out = judge(&correctors, held_out)?;
    go_on()?;
    let training = judge(&correctors, training)?;
    let (dynamics_gap, reward_gap) = (held_out.dynamics.gap.estimate, held_out.reward.gap.estimate);
    Ok(Gaps { dynamics_gap, reward_gap, held_out, training, half_way })
}

/// So many updates in stretches.
fn stretches(updates: u64) -> impl Iterator<Item = u64> {
    (0..updates).step_by(STRETCH as usize).map(move |made| STRETCH.min(updates - made))
}

impl Correctors {
    fn new(model: &Model, device: &Device, rng: &mut ChaCha8Rng) -> Result<Self> {
        let config = &model.config;
        let mut adversary = Adversary::init(config, rng, device)?;
        adversary.head = adversary.head.last_zeroed();
        let mut head = |input, output| MlpConfig { input, hidden: config.head, output }.init(rng, device).last_zeroed();
        let reward = head(config.hidden, 2);
        let own = config.hidden + config.latent + config.actions();
        let refitted = Refitted { dynamics: head(own, config.latent + 1), reward: head(own, 2) };
        let optimizers = [Optimizer::new(1e-8), Optimizer::new(1e-8)];
        Ok(Self { critic: Critic { adversary, reward }.train(), refitted: refitted.train(), optimizers })
    }

    /// Makes some updates of both.
    fn fit(
        &mut self,
        model: &Model,
        windows: &Windows,
        options: GapOptions,
        updates: u64,
        device: &Device,
        rng: &mut ChaCha8Rng,
    ) -> Result<()> {
        let [critic_optimizer, refitted_optimizer] = &mut self.optimizers;
        for _ in 0..updates {
            let batch = Batch::new(&windows.sample(rng), &model.config, options.burn_in, device)?;
            let scene = Scene::new(model, &batch, device, rng)?;
            let objective = scene.mean(&scene.critic(&self.critic, model)?);
            let gradients = NamedGradients::take(&self.critic, &mut objective.neg().backward());
            self.critic = critic_optimizer.step(self.critic.clone(), gradients, options.lr, 100.0);
            let objective = scene.mean(&scene.refitted(&self.refitted, model));
            let gradients = NamedGradients::take(&self.refitted, &mut objective.neg().backward());
            self.refitted = refitted_optimizer.step(self.refitted.clone(), gradients, options.lr, 100.0);
        }
        Ok(())
    }

    /// Mean log-likelihoods over drawn windows of some recordings, each of which gives a share of the batches.
    fn judge(
        &self,
        model: &Model,
        recordings: &[Recording],
        options: GapOptions,
        device: &Device,
        rng: &mut ChaCha8Rng,
    ) -> Result<Judged> {
        let (critic, refitted) = (self.critic.valid(), self.refitted.valid());
        let (mut sums, mut labels) = (Vec::new(), Vec::new());
        let trajectories = trajectories(recordings)?;
        let all: usize = recordings.iter().map(|recording| recording.episodes().len()).sum();
        for (at, recording) in recordings.iter().enumerate() {
            let windows = Windows::new(std::slice::from_ref(recording), options.length, options.batch)?;
            let share = recording.episodes().len() as f64 / all.max(1) as f64;
            for _ in 0..((options.batches as f64 * share).round() as u64).max(1) {
                let drawn = windows.sample(rng);
                let batch = Batch::new(&drawn, &model.config, options.burn_in, device)?;
                let scene = Scene::new(model, &batch, device, rng)?;
                let of = [scene.model(model), scene.refitted(&refitted, model), scene.critic(&critic, model)?];
                sums.extend(scene.by_window(&of));
                labels.extend(drawn.starts.iter().map(|start| trajectories[&(at, start.0)]));
            }
        }
        let trajectories = Trajectories::new(&labels);
        let of = |quantity: usize, rng: &mut ChaCha8Rng| likelihoods(&trajectories, &sums, quantity, rng);
        Ok(Judged { dynamics: of(0, rng), reward: of(1, rng) })
    }
}

/// Sums over the counted rows of one window, for the next latent and the reward.
#[derive(Debug, Clone, Copy)]
struct WindowSums {
    /// Under the model, the refitted heads and the critic: `[quantity][predictor]`.
    log_likelihood: [[f64; 3]; 2],
    /// Counted rows.
    rows: [f64; 2],
}

fn likelihoods(trajectories: &Trajectories, sums: &[WindowSums], quantity: usize, rng: &mut impl Rng) -> Likelihoods {
    let all = sums.iter().map(|window| window.rows[quantity]).sum::<f64>();
    let mean = |who: usize| sums.iter().map(|window| window.log_likelihood[quantity][who]).sum::<f64>() / all;
    let windows: Vec<usize> = (0..sums.len()).collect();
    let above: Vec<f64> = sums
        .iter()
        .map(|window| window.log_likelihood[quantity])
        .map(|[_, refitted, critic]| critic - refitted)
        .collect();
    let rows: Vec<f64> = sums.iter().map(|window| window.rows[quantity]).collect();
    let gap = trajectories.ratio(&windows, &above, &rows, rng);
    Likelihoods { model: mean(0), refitted: mean(1), critic: mean(2), gap }
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

    fn model(&self, model: &Model) -> Terms {
        let (dynamics, reward) = self.predictions(model);
        self.terms(&dynamics, &reward)
    }

    fn critic(&self, critic: &Critic, model: &Model) -> Result<Terms> {
        let features = critic.adversary.observe.forward(self.batch.frames.clone(), self.batch.length)?;
        let states = critic.adversary.states(features, self.latents.clone(), self.batch.actions.clone());
        Ok(self.corrected(model, critic.adversary.head.forward(states.clone()), critic.reward.forward(states)))
    }

    fn refitted(&self, refitted: &Refitted, model: &Model) -> Terms {
        let own = self.own_state(model);
        self.corrected(model, refitted.dynamics.forward(own.clone()), refitted.reward.forward(own))
    }

    /// `(h_t, s_t, a_t)` of every row, `h_t` before the action is consumed: zeros at the window's first row.
    fn own_state(&self, model: &Model) -> Tensor<3> {
        let (_, after) = model.world.dynamics.forward(self.latents.clone(), self.batch.actions.clone(), None);
        let first = after.clone().narrow(0, 0, 1).zeros_like();
        let before = Tensor::cat(vec![first, after.narrow(0, 0, self.batch.length - 1)], 0);
        Tensor::cat(vec![before, self.latents.clone(), self.batch.actions.clone()], 2)
    }

    /// The model's predictions, corrected.
    fn corrected(&self, model: &Model, dynamics_by: Tensor<3>, reward_by: Tensor<3>) -> Terms {
        let (dynamics, reward) = self.predictions(model);
        let dynamics = corrected(&dynamics, dynamics_by, model.config.prediction_floor);
        let dynamics = Gaussian { mean: model.config.latents.mean(dynamics.mean), ..dynamics };
        self.terms(&dynamics, &corrected(&reward, reward_by, model.config.reward_floor))
    }

    /// Log-likelihoods of the rows that count (of the next latent: those that have a successor in the window), 0 in the others.
    fn terms(&self, dynamics: &Gaussian, reward: &Gaussian) -> Terms {
        let pairs = self.batch.length - 1;
        let before = |x: Tensor<3>| x.narrow(0, 0, pairs);
        let dynamics = Gaussian { mean: before(dynamics.mean.clone()), std: before(dynamics.std.clone()) };
        let [counted_pairs, counted] = self.counted();
        let next = dynamics.log_prob(self.latents.clone().narrow(0, 1, pairs)) * counted_pairs;
        [next.sum_dim(2), reward.log_prob(self.batch.rewards.clone()) * counted]
    }

    /// 1 where a row counts, for the next latent `[length - 1, batch, 1]` and the reward `[length, batch, 1]`.
    fn counted(&self) -> [Tensor<3>; 2] {
        let counted = self.batch.counted.clone();
        [counted.clone().narrow(0, 1, self.batch.length - 1), counted]
    }

    /// The sum of both quantities' means over the rows that count.
    fn mean(&self, terms: &Terms) -> Tensor<1> {
        let [latent, reward] = terms.clone();
        let [pairs, rows] = self.counted();
        latent.sum() / pairs.sum() + reward.sum() / rows.sum()
    }

    /// Sums over each window.
    fn by_window(&self, of: &[Terms; 3]) -> Vec<WindowSums> {
        let sums = |x: &Tensor<3>| to_values(x.clone().sum_dim(0));
        let values = of.each_ref().map(|terms| terms.each_ref().map(sums));
        let rows = self.counted().each_ref().map(sums);
        let window = |at: usize| WindowSums {
            log_likelihood: [0, 1].map(|quantity| [0, 1, 2].map(|who: usize| f64::from(values[who][quantity][at]))),
            rows: [0, 1].map(|quantity: usize| f64::from(rows[quantity][at])),
        };
        (0..self.batch.batch).map(window).collect()
    }
}

/// Log-likelihoods of the next latent `[length - 1, batch, 1]` and of the reward `[length, batch, 1]`.
type Terms = [Tensor<3>; 2];

/// A prediction with its mean moved by the first columns of `correction`, in units of its own standard deviation, and what its standard deviation has above
/// `floor` scaled by the exponential of the last.
fn corrected(prediction: &Gaussian, correction: Tensor<3>, floor: f32) -> Gaussian {
    let dims = correction.dims()[2] - 1;
    let above = (prediction.std.clone() - floor) * correction.clone().narrow(2, dims, 1).exp();
    let mean = prediction.mean.clone() + correction.narrow(2, 0, dims) * prediction.std.clone();
    Gaussian { mean, std: above + floor }
}
