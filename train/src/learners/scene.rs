//! What every objective and every auxiliary term of one update computes from. In: the world model, a batch, the noise of its latents. Out: sampled latents and the
//! predictions of the next latent and of the reward, made once and shared.

use std::cell::OnceCell;

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use vibes_model::gaussian::Gaussian;
use vibes_model::init::normal;
use vibes_model::{ModelConfig, World};

use super::rollout::{Rollout, roll};
use crate::batch::Batch;
use crate::error::Result;
use crate::settings::{Schedule, Settings};

/// One update's latents and predictions.
#[derive(Debug)]
pub struct Scene<'a> {
    /// The world model, before its step.
    pub world: &'a World,
    /// Its sizes.
    pub config: &'a ModelConfig,
    /// The run's options.
    pub options: &'a Settings,
    /// The options that change with the updates.
    pub schedule: Schedule,
    /// The windows.
    pub batch: &'a Batch,
    /// Means of the latents: `[length, batch, latent]`
    pub means: Tensor<3>,
    /// Features of the observations by themselves: `[length, batch, hidden]`
    pub features: Tensor<3>,
    /// Sampled latents; the whole gradient passes through them to the encoder: `[length, batch, latent]`
    pub latents: Tensor<3>,
    /// The paper's predictions, made from [`gated`] latents.
    pub predictions: Predictions,
    /// The dynamics' hidden states after each row but the last, from [`gated`] latents: `[length − 1, batch, hidden]`
    pub states_after: Tensor<3>,
    states: OnceCell<Tensor<3>>,
    rollout: OnceCell<Rollout>,
}

/// A window as the paper's two terms see it.
#[derive(Debug, Clone)]
pub struct Predictions {
    /// Sampled latents, [`gated`]: `[length, batch, latent]`
    pub latents: Tensor<3>,
    /// The dynamics' prediction of the latents `1..length`: `[length − 1, batch, …]`
    pub dynamics: Gaussian,
    /// The prediction of the rewards: `[length, batch, 1]`
    pub reward: Gaussian,
    /// `[length, batch, 1]`
    pub rewards: Tensor<3>,
    /// 1 where a row counts, 0 where it only warms up the hidden states: `[length, batch, 1]`
    pub counted: Tensor<3>,
    /// Number of rows that count, the paper's `T·B`.
    pub count: f32,
}

/// The same latents, through which only a share of the gradient passes to the encoder. The dynamics term is computed on these, so that the dynamics
/// model learns at its full rate from the first update on while the encoder gives way to it as much as `weight` says (the idea of KL balancing).
pub fn gated(latents: &Tensor<3>, weight: f32) -> Tensor<3> {
    if weight == 1.0 {
        return latents.clone();
    }
    latents.clone() * weight + latents.clone().detach() * (1.0 - weight)
}

impl<'a> Scene<'a> {
    /// Encodes a batch, draws its latents with noise from `rng`, and predicts what follows them.
    ///
    /// # Errors
    /// The batch's observations are of another kind than the model's.
    pub fn new(
        (world, config): (&'a World, &'a ModelConfig),
        batch: &'a Batch,
        (options, schedule): (&'a Settings, Schedule),
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<Self> {
        let encoding = world.encoder.forward(batch.frames.clone(), batch.previous_actions.clone(), None)?;
        let means = encoding.means;
        let noise =
            Tensor::<3>::from_data(TensorData::new(normal(means.shape().num_elements(), rng), means.dims()), device);
        let latents = means.clone() + noise * config.latent_std;
        let (predictions, states_after) = predict(world, batch, &latents, gated(&latents, schedule.dynamics_weight));
        Ok(Self {
            world,
            config,
            options,
            schedule,
            batch,
            features: encoding.features,
            means,
            latents,
            predictions,
            states_after,
            states: OnceCell::new(),
            rollout: OnceCell::new(),
        })
    }

    /// The dynamics' hidden states *before* each row's action is consumed, zeros at the first, as a policy would see them beside the latents; gradients
    /// pass whole: `[length, batch, hidden]`
    pub fn states(&self) -> &Tensor<3> {
        self.states.get_or_init(|| {
            let pairs = self.batch.length - 1;
            let before_last = |x: &Tensor<3>| x.clone().narrow(0, 0, pairs);
            let inputs = Tensor::cat(vec![before_last(&self.latents), before_last(&self.batch.actions)], 2);
            let after = self.world.dynamics.gru.forward(inputs, None);
            let [_, batch, hidden] = after.dims();
            Tensor::cat(vec![Tensor::zeros([1, batch, hidden], &after.device()), after], 0)
        })
    }

    /// The dynamics run ahead without pictures under the recorded actions, as far as each of `reaches` asks for. It is made once: the first call decides, so that an objective that looks
    /// ahead names the reaches of the auxiliary terms beside its own.
    pub fn rollout(&self, reaches: &[usize]) -> &Rollout {
        self.rollout.get_or_init(|| roll(&self.world.dynamics, self.batch, (&self.latents, self.states()), reaches))
    }
}

/// The dynamics term on latents as `gated`, the reward on all of them.
pub fn predict(world: &World, batch: &Batch, latents: &Tensor<3>, gated: Tensor<3>) -> (Predictions, Tensor<3>) {
    let before_last = |x: &Tensor<3>| x.clone().narrow(0, 0, batch.length - 1);
    let (dynamics, states) = world.dynamics.forward(before_last(&gated), before_last(&batch.actions), None);
    let predictions = Predictions {
        dynamics,
        reward: world.reward.forward(latents.clone(), batch.actions.clone()),
        latents: gated,
        rewards: batch.rewards.clone(),
        counted: batch.counted.clone(),
        count: batch.count,
    };
    (predictions, states)
}

impl Predictions {
    /// Log-density of the latents `1..length`, zero in rows that do not count.
    ///
    /// # Shapes
    /// - output: `[length − 1, batch, latent]`
    pub fn latent_log_prob(&self, prediction: &Gaussian) -> Tensor<3> {
        let length = self.latents.dims()[0];
        let next = self.latents.clone().narrow(0, 1, length - 1);
        prediction.log_prob(next) * self.counted.clone().narrow(0, 1, length - 1)
    }

    /// Sum over the rows that count of `log p(r_t | s_t, a_t)`: `[1]`
    pub fn reward_log_prob(&self) -> Tensor<1> {
        self.log_prob_of_rewards(&self.reward)
    }

    /// The same under another prediction of the rewards: `[1]`
    pub fn log_prob_of_rewards(&self, prediction: &Gaussian) -> Tensor<1> {
        (prediction.log_prob(self.rewards.clone()) * self.counted.clone()).sum()
    }
}
