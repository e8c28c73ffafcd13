//! No index is off by one between the environment, a recording, imagination and returns: on `known-slide`, whose dynamics and rewards are formulas, what is imagined from a
//! recorded row with the recorded actions must be what was recorded, and its returns the sums that can be written down.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_env::{Environment, EnvironmentOptions, KNOWN_SLIDE};
use vibes_model::actions::ActionSample;
use vibes_model::imagine::{LatentWorld, Starts, imagine_with};
use vibes_model::parameters::to_values;
use vibes_model::returns::lambda_returns;

/// The slide's own equations: the latent is (position, velocity), the state counts the actions consumed.
struct Slide {
    action_repeat: u32,
}

const TIMESTEP: f32 = 0.02;
const FORCE: f32 = 4.0;

fn column(x: &Tensor<3>, column: usize) -> Tensor<3> {
    x.clone().narrow(2, column, 1)
}

impl Slide {
    /// Rewards of the action repeat, and where it ends.
    fn moved(&self, latents: &Tensor<3>, actions: &Tensor<3>) -> (Tensor<3>, Tensor<3>) {
        let (mut position, mut velocity) = (column(latents, 0), column(latents, 1));
        let mut sum = position.zeros_like();
        for _ in 0..self.action_repeat {
            velocity = velocity + actions.clone() * (TIMESTEP * FORCE);
            position = position + velocity.clone() * TIMESTEP;
            sum = sum + (position.clone().square() + 1.0).recip() * 0.5 + (actions.clone() + 1.0) * 0.25;
        }
        (sum, Tensor::cat(vec![position, velocity], 2))
    }
}

impl LatentWorld for Slide {
    fn reward(&self, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3> {
        self.moved(&latents, &actions).0
    }

    fn step(&self, states: Tensor<3>, latents: Tensor<3>, actions: Tensor<3>, _: Tensor<3>) -> (Tensor<3>, Tensor<3>) {
        (states + 1.0, self.moved(&latents, &actions).1)
    }
}

/// Observations, actions and rewards of an episode that really happened.
fn lived(steps: usize) -> (Vec<[f32; 2]>, Vec<f32>, Vec<f32>, u32) {
    let mut environment = Environment::new(KNOWN_SLIDE, EnvironmentOptions::default()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    environment.reset(&mut rng).unwrap();
    let (mut seen, mut actions, mut rewards) = (Vec::new(), Vec::new(), Vec::new());
    let mut observation = Vec::new();
    for _ in 0..steps {
        environment.observe(&mut observation);
        seen.push([observation[0] as f32, observation[1] as f32]);
        let action: f32 = rng.random_range(-1.0..1.0);
        rewards.push(environment.step(&[f64::from(action)]).unwrap() as f32);
        actions.push(action);
    }
    (seen, actions, rewards, environment.action_repeat())
}

#[test]
fn imagined_rewards_and_returns_of_recorded_actions_are_the_recorded_ones() {
    const HORIZON: usize = 15;
    let device = Device::flex();
    let (seen, actions, rewards, action_repeat) = lived(40);
    let (first, rows) = (5, 10);
    let starts = Starts {
        states: Tensor::zeros([rows, 1], &device),
        latents: Tensor::from_data(TensorData::new(seen[first..first + rows].concat(), [rows, 2]), &device),
    };
    let act = |k: usize, features: Tensor<3>| {
        // The state has consumed exactly the k actions before this one.
        assert!(to_values(features.narrow(2, 0, 1)).iter().all(|&count| count == k as f32));
        let action = actions[first + k..first + k + rows].to_vec();
        let action = Tensor::<3>::from_data(TensorData::new(action, [1, rows, 1]), &device);
        ActionSample { normal: action.clone(), action }
    };
    let imagined = imagine_with(&Slide { action_repeat }, act, starts, &Tensor::zeros([HORIZON, rows, 2], &device));
    let found = to_values(imagined.rewards.clone());
    for k in 0..HORIZON {
        for row in 0..rows {
            let (found, recorded) = (found[k * rows + row], rewards[first + row + k]);
            assert!((found - recorded).abs() < 1e-4, "{k} {row}: {found} {recorded}");
        }
    }
    // A shift by one would not pass: neighbouring rewards differ.
    assert!((0..HORIZON).any(|k| (found[k * rows] - rewards[first + k + 1]).abs() > 1e-2));
    let discount = 0.97_f64;
    let values = Tensor::<2>::zeros([HORIZON + 1, rows], &device);
    let returns = to_values(lambda_returns(imagined.rewards, values, discount, 1.0));
    for row in 0..rows {
        let wanted: f64 = (0..HORIZON).map(|k| discount.powi(k as i32) * f64::from(rewards[first + row + k])).sum();
        assert!((f64::from(returns[row]) - wanted).abs() < 1e-3, "{row}: {} {wanted}", returns[row]);
    }
}
