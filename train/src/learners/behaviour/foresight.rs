//! How well imagination foresees rewards: the rewards imagined along *recorded* actions beside those recorded. In: the rows of an update. Out: both means and
//! their correlation. Here an index that is off by one, or a model that is exploited, shows first.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};
use vibes_model::World;
use vibes_model::actions::{ActionSample, noise};
use vibes_model::imagine::{LatentWorld, Learned, imagine_with};
use vibes_model::parameters::to_values;

use super::Replayed;

/// Imagined against recorded rewards of the same actions, summed over the rest of each window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Foresight {
    /// Mean imagined reward of a step.
    pub imagined: f64,
    /// Mean recorded reward of a step.
    pub recorded: f64,
    /// Correlation of the sums over windows; none where either does not vary.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub correlation: Option<f64>,
}

/// Imagines from row `from` of every window to its end with the recorded actions.
pub fn foresight(world: &World, rows: &Replayed, from: usize, rng: &mut impl Rng, device: &Device) -> Foresight {
    let (dynamics, reward) = (world.dynamics.valid(), world.reward.valid());
    foresight_in(&Learned { dynamics: &dynamics, reward: &reward }, rows, from, rng, device)
}

/// The same in any world.
pub fn foresight_in(
    world: &impl LatentWorld,
    rows: &Replayed,
    from: usize,
    rng: &mut impl Rng,
    device: &Device,
) -> Foresight {
    let [length, batch, latent] = rows.latents.dims();
    let from = from.min(length - 1);
    let horizon = length - from;
    let places: Vec<i64> = (0..batch).map(|window| (from * batch + window) as i64).collect();
    let act = |k: usize, _: Tensor<3>| {
        let action = rows.actions.clone().narrow(0, from + k, 1);
        ActionSample { normal: action.clone(), action }
    };
    let imagined =
        imagine_with(world, act, rows.starts(&places, device), &noise([horizon, batch, latent], rng, device));
    let sums = |rewards: &[f32]| -> Vec<f64> {
        (0..batch)
            .map(|window| rewards.iter().skip(window).step_by(batch).map(|&reward| f64::from(reward)).sum())
            .collect()
    };
    let (imagined, recorded) = (sums(&to_values(imagined.rewards)), sums(&rows.rewards[from * batch..]));
    let per_step = |sums: &[f64]| sums.iter().sum::<f64>() / (batch * horizon) as f64;
    Foresight {
        imagined: per_step(&imagined),
        recorded: per_step(&recorded),
        correlation: correlation(&imagined, &recorded),
    }
}

fn correlation(left: &[f64], right: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (a, b) = (mean(left), mean(right));
    let product: f64 = left.iter().zip(right).map(|(x, y)| (x - a) * (y - b)).sum();
    let spread = |values: &[f64], mean: f64| values.iter().map(|x| (x - mean).powi(2)).sum::<f64>().sqrt();
    let spreads = spread(left, a) * spread(right, b);
    (spreads > 1e-12).then_some(product / spreads)
}
