//! What past actions alone say about the reward: a head that sees the last eight of them and no latent. In: a scene. Out: its log-likelihood, which a
//! [gate](super::Definition::gate) compares the reward model with. Rewards of many tasks depend on the action, and a planner's actions tell how well things stand; a
//! reward model that is only as good as this has not looked at the picture yet.
//!
//! The head learns with the world model, in a term that reaches nothing else.

use burn::tensor::Tensor;
use vibes_model::{HeadConfig, World};

use super::Value;
use crate::error::Result;
use crate::learners::scene::Scene;

/// Actions it sees: the one taken at the row, and those before it in the window.
const ACTIONS: usize = 8;

/// The head.
#[derive(Debug)]
pub struct ActionBaseline;

impl ActionBaseline {
    const NAME: &str = "reward of actions";

    /// Name and sizes of the head, for actions of so many values.
    pub fn head(actions: usize) -> HeadConfig {
        HeadConfig { name: Self::NAME.to_owned(), input: ACTIONS * actions, output: 2 }
    }

    /// The world model whose baseline begins with the rewards' own mean and standard deviation; otherwise the gate would open on what it has yet to learn.
    pub fn calibrated(world: World, rewards: &[f32]) -> World {
        world.with_head(Self::NAME, |reward, head| reward.calibrated_head(head, rewards))
    }

    /// The value with the baseline beside it, and its term added.
    ///
    /// # Errors
    /// The model has no such head.
    pub fn add(scene: &Scene<'_>, value: Value) -> Result<Value> {
        let head = scene.world.head(Self::NAME)?;
        let prediction = scene.world.reward.gaussian(head.forward(recent(&scene.batch.actions)));
        let baseline = scene.predictions.log_prob_of_rewards(&prediction) / scene.predictions.count;
        let mut stated = value.stated;
        stated.push(("reward_of_actions_log_likelihood", baseline.clone()));
        Ok(Value { objective: value.objective + baseline.clone(), reward_baseline: Some(baseline), stated, ..value })
    }
}

/// The actions of each row and of those before it, zeros before the window: `[length, batch, ACTIONS · A]`.
fn recent(actions: &Tensor<3>) -> Tensor<3> {
    let [length, batch, width] = actions.dims();
    let shifted = (0..ACTIONS).map(|back| match back.min(length) {
        0 => actions.clone(),
        back if back == length => actions.zeros_like(),
        back => {
            let before = Tensor::zeros([back, batch, width], &actions.device());
            Tensor::cat(vec![before, actions.clone().narrow(0, 0, length - back)], 0)
        }
    });
    Tensor::cat(shifted.collect(), 2)
}
