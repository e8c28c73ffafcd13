//! No index is off by one between the environment, a recording, imagination and returns: on `known-slide`, whose dynamics and rewards are formulas, what is imagined from a
//! recorded row with the recorded actions must be what was recorded, and its returns the sums that can be written down. Once from an episode as the environment gives it, and once
//! from the windows of an online run's replay, with the learner's own batches and starts.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;

use burn::tensor::{Device, Tensor, TensorData};
use process::{program, text};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Recording, WindowSampler};
use vibes_env::{Environment, EnvironmentOptions, KNOWN_SLIDE};
use vibes_model::actions::ActionSample;
use vibes_model::imagine::{LatentWorld, Starts, imagine_with};
use vibes_model::parameters::to_values;
use vibes_model::returns::lambda_returns;
use vibes_train::batch::Batch;
use vibes_train::learners::behaviour::Replayed;
use vibes_train::learners::behaviour::foresight::foresight_in;
use vibes_train::online::options::OnlineOptions;
use vibes_train::run::Run;

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

/// Acted, recorded, cut into windows, made a batch and turned into starts by the code that trains: from every counted row the slide goes on as it was recorded.
#[test]
fn every_counted_row_of_a_replays_windows_is_imagined_as_it_was_recorded() {
    const HORIZON: usize = 6;
    const LENGTH: usize = 12;
    const WINDOWS: usize = 30;
    const BURN_IN: usize = 3;
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("run");
    let line = "online --task known-slide --no-pixels --distract none --preset tiny --steps 20 --control-steps 240 --prefill 5 --first-updates 0 \
                --evaluate-every 0 --final-episodes 1 -o";
    let output = program().args(line.split_whitespace()).arg(&place).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let action_repeat = OnlineOptions::read(&place).unwrap().unwrap().world.action_repeat;
    let replay = Recording::open(&place.join("replay")).unwrap();
    let windows = WindowSampler::new(&replay, LENGTH).unwrap().sample(WINDOWS, &mut ChaCha8Rng::seed_from_u64(5));
    let model = Run::open(&place).unwrap().info().model.clone();
    let followed = device.clone().autodiff();
    let batch = Batch::new(&windows, &model, BURN_IN, &followed).unwrap();
    let [latents, rewards, counted] = [
        Tensor::from_data(TensorData::new(windows.observations.clone(), [LENGTH, WINDOWS, 2]), &followed),
        batch.rewards.clone(),
        batch.counted.clone(),
    ];
    let counted: Vec<bool> = to_values(counted).iter().map(|&value| value == 1.0).collect();
    // The dynamics' state after a row is the number of the window's actions that it has consumed.
    let after = (1..LENGTH).flat_map(|row| std::iter::repeat_n(row as f32, WINDOWS)).collect::<Vec<_>>();
    let after = Tensor::from_data(TensorData::new(after, [LENGTH - 1, WINDOWS, 1]), &followed);
    let rewards = to_values(rewards);
    let replayed =
        Replayed::detached(latents, after, batch.actions.clone(), rewards.clone(), (counted, vec![0; WINDOWS]));
    let mut places = replayed.chosen(1);
    places.retain(|&place| place as usize / WINDOWS + HORIZON <= LENGTH);
    assert!(windows.is_first.contains(&true) && places.len() > 2 * WINDOWS, "both kinds of window: {}", places.len());
    let actions = to_values(batch.actions);
    let act = |k: usize, features: Tensor<3>| {
        let states = to_values(features.narrow(2, 0, 1));
        let at = |(&place, state): (&i64, f32)| {
            assert_eq!(state as usize, place as usize / WINDOWS + k, "the state before the action");
            actions[place as usize + k * WINDOWS]
        };
        let chosen: Vec<f32> = places.iter().zip(states).map(at).collect();
        let action = Tensor::<3>::from_data(TensorData::new(chosen, [1, places.len(), 1]), &device);
        ActionSample { normal: action.clone(), action }
    };
    let noise = Tensor::zeros([HORIZON, places.len(), 2], &device);
    let imagined = imagine_with(&Slide { action_repeat }, act, replayed.starts(&places, &device), &noise);
    let found = to_values(imagined.rewards);
    for k in 0..HORIZON {
        for (row, &place) in places.iter().enumerate() {
            let (found, recorded) = (found[k * places.len() + row], rewards[place as usize + k * WINDOWS]);
            assert!((found - recorded).abs() < 1e-4, "{k} {place}: {found} {recorded}");
        }
    }
    // What the metrics show of it is the same.
    let from = LENGTH - HORIZON;
    let seen = foresight_in(&Slide { action_repeat }, &replayed, from, &mut ChaCha8Rng::seed_from_u64(6), &device);
    assert!((seen.imagined - seen.recorded).abs() < 1e-4, "{seen:?}");
    let mean = rewards[from * WINDOWS..].iter().map(|&reward| f64::from(reward)).sum::<f64>();
    assert!((seen.recorded - mean / (HORIZON * WINDOWS) as f64).abs() < 1e-4, "{seen:?}");
    assert!(seen.correlation.unwrap() > 0.9999, "{seen:?}");
    let previous = to_values(batch.previous_actions);
    let is_shifted = |place: usize| previous[place] == actions[place - WINDOWS];
    assert!((WINDOWS..LENGTH * WINDOWS).all(is_shifted), "the action before a row is the row's before");
}
