//! The steps of a window that count, one under the other, for losses that look at single steps or at pairs of them. In: a scene. Out: the latents before and after
//! each step, its action and its reward; and the models fitted to latents that none of their gradient reaches.

use burn::tensor::{Int, Tensor, TensorData};
use vibes_model::parameters::to_values;

use super::{Value, Weights, no_adversary};
use crate::learners::scene::{Predictions, Scene, predict};

/// Steps `t → t + 1` of all windows whose row t counts.
#[derive(Debug)]
pub struct Steps {
    /// Means of the latents before: `[steps, latent]`
    pub now: Tensor<2>,
    /// Means of the latents after: `[steps, latent]`
    pub next: Tensor<2>,
    /// `[steps, A]`
    pub actions: Tensor<2>,
    /// `[steps]`
    pub rewards: Tensor<1>,
    /// Which of the rows `t·batch + window`, t below the window's last, they are: `[steps]`
    pub chosen: Tensor<1, Int>,
}

impl Steps {
    /// Those of a scene.
    pub fn of(scene: &Scene<'_>) -> Self {
        let (pairs, batch) = (scene.batch.length - 1, scene.batch.batch);
        let counted = to_values(scene.batch.counted.clone().narrow(0, 0, pairs));
        let chosen: Vec<i32> = (0..).zip(&counted).filter(|(_, counted)| **counted > 0.0).map(|(row, _)| row).collect();
        let count = chosen.len();
        let chosen = Tensor::<1, Int>::from_data(TensorData::new(chosen, [count]), &scene.means.device());
        let rows = |x: &Tensor<3>, from: usize| flat(x.clone().narrow(0, from, pairs), pairs * batch, &chosen);
        Self {
            now: rows(&scene.means, 0),
            next: rows(&scene.means, 1),
            actions: rows(&scene.batch.actions, 0),
            rewards: rows(&scene.batch.rewards, 0).squeeze_dim(1),
            chosen,
        }
    }

    /// The same steps of something else that has a row for each t below the window's last: `[length − 1, batch, dims]` to `[steps, dims]`.
    pub fn choose(&self, x: Tensor<3>) -> Tensor<2> {
        let [pairs, batch, _] = x.dims();
        flat(x, pairs * batch, &self.chosen)
    }
}

fn flat(x: Tensor<3>, rows: usize, chosen: &Tensor<1, Int>) -> Tensor<2> {
    let width = x.dims()[2];
    x.reshape([rows, width]).select(0, chosen.clone())
}

/// The dynamics' and the reward model's log-likelihoods of latents that they do not move: for objectives that shape the latents by something else, and keep both
/// models beside them.
pub fn models_apart(scene: &Scene<'_>) -> Value {
    let fixed = scene.latents.clone().detach();
    let (predictions, _) = predict(scene.world, scene.batch, &fixed, fixed.clone());
    no_adversary::value(&predictions, Weights::of(scene))
}

/// The same, except that the reward model does shape the latents.
pub fn dynamics_apart(scene: &Scene<'_>) -> Value {
    let fixed = scene.latents.clone().detach();
    let (apart, _) = predict(scene.world, scene.batch, &fixed, fixed.clone());
    let predictions = Predictions { reward: scene.predictions.reward.clone(), ..apart };
    no_adversary::value(&predictions, Weights::of(scene))
}

impl Value {
    /// This value with another loss taken from the objective, and stated under its name.
    pub fn less(mut self, name: &'static str, loss: Tensor<1>) -> Self {
        self.stated.push((name, loss.clone()));
        Self { objective: self.objective - loss, ..self }
    }
}
