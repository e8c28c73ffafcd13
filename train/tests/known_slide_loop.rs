//! Learning through the whole loop where the best return is known: on `known-slide` in episodes of 20 agent steps and with a discount of 0.9, the best policy pushes with all
//! its might. Agents of every family come close to it within a short training; a random policy does not.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;

use std::path::Path;

use burn::tensor::Device;
use process::{lines, program, text};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_env::distractors::Axes;
use vibes_env::{Environment, EnvironmentOptions};
use vibes_train::fit::{End, Go};
use vibes_train::learners::model_free::AgentOptions;
use vibes_train::learners::recurrent::options::RecurrentOptions;
use vibes_train::learners::sac::options::{SacOptions, Size};
use vibes_train::online::model_free::folder::{FORMAT, Folder, ModelFreeOptions};
use vibes_train::online::model_free::model_free;
use vibes_train::online::prepare::{default_options, default_world};

const STEPS: u32 = 20;
const DISCOUNT: f64 = 0.9;

/// Mean return of a policy over many starts.
fn mean_return(mut policy: impl FnMut(&mut ChaCha8Rng) -> f64) -> f64 {
    let mut environment = Environment::new("known-slide", EnvironmentOptions::default()).unwrap();
    let (mut starts, mut choices) = (ChaCha8Rng::seed_from_u64(1), ChaCha8Rng::seed_from_u64(2));
    let episodes = 300;
    let mut sum = 0.0;
    for _ in 0..episodes {
        environment.reset(&mut starts).unwrap();
        sum += (0..STEPS).map(|_| environment.step(&[policy(&mut choices)]).unwrap()).sum::<f64>();
    }
    sum / f64::from(episodes)
}

/// How far a return lies on the way from a random policy's to the best one's.
fn share_of_the_way(reached: f64) -> f64 {
    let random = mean_return(|rng| rng.random_range(-1.0..1.0));
    let best = mean_return(|_| 1.0);
    // What dynamic programming on a grid of positions and velocities finds at most is 33.9, and a random policy's is 25.3.
    assert!((best - 33.8).abs() < 0.3 && (random - 25.3).abs() < 0.5, "{best}, {random}");
    (reached - random) / (best - random)
}

/// The mean return of the last evaluation.
fn reached(run: &Path) -> f64 {
    let last = lines(&run.join("evaluations.jsonl")).pop().unwrap();
    assert_eq!(last["is_final"], true);
    last["held_out"]["mean_return"].as_f64().unwrap()
}

#[test]
fn an_agent_that_imagines_comes_close_to_the_best_return() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let line = "online --task known-slide --no-pixels --distract none --preset tiny --steps 20 --control-steps 1200 --rows-per-step 64 --prefill 5 \
                --first-updates 100 --critic-first 0 --discount 0.9 --evaluate-every 0 --final-episodes 20 -o";
    let output = program().args(line.split_whitespace()).arg(&run).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let share = share_of_the_way(reached(&run));
    assert!(share > 0.8, "{share}");
}

/// Trains a system without a world model and judges it.
fn comes_close(system: &str) {
    let folder = tempfile::tempdir().unwrap();
    let mut world = default_world("known-slide").unwrap();
    world.distractors.axes = "none".parse::<Axes>().unwrap();
    (world.size, world.steps) = (Some(24), STEPS);
    let mut online = default_options(world, false);
    (online.prefill, online.control_steps) = (5, 1200);
    (online.evaluate_every, online.final_episodes) = (0, 20);
    let options = ModelFreeOptions {
        format: FORMAT.to_owned(),
        system: system.to_owned(),
        size: Size::Small,
        seed: 0,
        agent: match AgentOptions::system(system, Size::Small).unwrap() {
            AgentOptions::Stacks(options) => AgentOptions::Stacks(SacOptions {
                batch: 32,
                hidden: 64,
                discount: DISCOUNT,
                temperature_lr: 1e-2,
                ..options
            }),
            AgentOptions::Recurrent(options) => AgentOptions::Recurrent(RecurrentOptions {
                length: 8,
                depth: 4,
                memory: 32,
                latent: 16,
                head: 32,
                hidden: 64,
                discount: DISCOUNT,
                temperature_lr: 1e-2,
                ..options
            }),
        },
        updates_per_step: 0.8,
        save_every: 100,
        online,
    };
    let run = folder.path().join(system);
    let folder = Folder::create_or_open(&run, options).unwrap();
    assert_eq!(model_free(&folder, &Device::flex(), &mut |_| Go::On).unwrap(), End::Updates);
    let share = share_of_the_way(reached(&run));
    assert!(share > 0.8, "{system}: {share}");
}

#[test]
fn soft_actor_critic_comes_close_to_the_best_return() {
    comes_close("sac-drq");
}

#[test]
fn characteristic_functions_beside_soft_actor_critic_come_close_to_the_best_return() {
    comes_close("sar");
}

#[test]
fn a_search_over_critics_comes_close_to_the_best_return() {
    comes_close("qt-opt-drq");
}

#[test]
fn recurrent_soft_actor_critic_comes_close_to_the_best_return() {
    comes_close("rsac");
}

#[test]
fn contrast_beside_recurrent_soft_actor_critic_comes_close_to_the_best_return() {
    comes_close("core");
}
