//! The guard in training, and what it costs. In: the rows that the world model's update has just seen, detached; imagined rows. Out: the guard after one step, and imagined
//! rewards less the disagreement of its members by a weight.
//!
//! ```text
//! r̂(s, a) = r(s, a) − W · std over the members of r_m(s, a)
//! ```
//!
//! The form of Offline `DreamerV2` (conglu1997/v-d4rl: offlinedv2/dreamerv2/agent.py, `penalized_reward`), whose members predict the next latent and whose penalty is the mean
//! norm of their distances. Members predict the reward here, because it is the reward model that an actor exploits, and so W is a number of standard deviations. The gradient
//! of the penalty flows back through the dynamics as that of the reward does; the encoder never feels the guard.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use vibes_model::guard::Guard;
use vibes_model::imagine::Imagination;

use super::{BehaviourOptions, Replayed};
use crate::error::Result;
use crate::learners::number::{finite, scalar};
use crate::learners::optimizer::{NamedGradients, Optimizer};

/// A guard and its optimizer.
#[derive(Debug, Clone)]
pub struct GuardLearner {
    /// The reward heads.
    pub guard: Guard,
    /// Adam for them.
    pub optimizer: Optimizer,
}

impl GuardLearner {
    /// Before its first update.
    pub fn new(mut guard: Guard) -> Self {
        guard.members = guard.members.train();
        Self { guard, optimizer: Optimizer::new(1e-8) }
    }

    /// Every member makes a step towards the recorded rewards of the counted rows of its own episodes, by half the squared error, at the critic's step size. Returns
    /// the mean disagreement over the counted rows before the step.
    ///
    /// # Errors
    /// The loss is no longer a number.
    pub(super) fn step(&mut self, rows: &Replayed, options: &BehaviourOptions, device: &Device) -> Result<f32> {
        let [length, batch, _] = rows.latents.dims();
        let members = &self.guard.members;
        let targets: Vec<f32> = rows.rewards.iter().map(|reward| reward / members.scale()).collect();
        let targets = Tensor::<3>::from_data(TensorData::new(targets, [length, batch, 1]), device);
        let expected = members.expected(rows.latents.clone(), rows.actions.clone());
        let counted: Vec<f32> = rows.counted.iter().map(|&counted| f32::from(u8::from(counted))).collect();
        let counted = Tensor::<3>::from_data(TensorData::new(counted, [length, batch, 1]), device);
        let taught = self.taught(rows, device) * counted.clone();
        // Each member's mean is over the rows it learns from, however many those are.
        let count = taught.clone().sum_dim(0).sum_dim(1).clamp_min(1.0);
        let loss = ((expected.clone() - targets).square() * taught / count).sum() * 0.5;
        finite("the guard's loss", scalar(&loss.clone().inner()))?;
        let apart = members.disagreement(expected.inner()) * counted.clone().squeeze_dim(2);
        let disagreement = scalar(&(apart.sum() / counted.sum().clamp_min(1.0)));
        let gradients = NamedGradients::take(members, &mut loss.backward());
        let members = members.clone();
        self.guard.members = self.optimizer.step(members, gradients, options.critic_lr, options.gradient_clip as f32);
        Ok(disagreement)
    }

    /// 1 where a member learns from a window's episode: `[1, batch, members]`
    fn taught(&self, rows: &Replayed, device: &Device) -> Tensor<3> {
        let members = self.guard.config.members;
        let shares = rows.episodes.iter().flat_map(|&episode| self.guard.learns_from(episode));
        let taught: Vec<f32> = shares.map(|learns| f32::from(u8::from(learns))).collect();
        Tensor::from_data(TensorData::new(taught, [1, rows.episodes.len(), members]), device)
    }

    /// How far the members disagree on imagined rewards, in units of reward: `[horizon, rows]`.
    pub(super) fn disagreement(&self, imagined: &Imagination) -> Tensor<2> {
        let members = self.guard.members.valid();
        let action = imagined.actions.action.clone();
        let ([horizon, rows, _], latent) = (action.dims(), self.latent(&action));
        let width = imagined.features.dims()[2];
        let latents = imagined.features.clone().slice([0..horizon, 0..rows, width - latent..width]);
        members.disagreement(members.expected(latents, action))
    }

    /// Numbers of a latent: what of a head's input is no action.
    fn latent(&self, actions: &Tensor<3>) -> usize {
        self.guard.members.heads[0].first.weight.dims()[0] - actions.dims()[2]
    }
}
