//! On pictures whose brightness says which action is best, with no future: the optimum is known. And what must hold of every update.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::tensor::Device;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{ActionSpec, ImageSize, Spec, WindowBatch};
use vibes_model::actions::Choice;
use vibes_model::parameters::read_parameters;
use vibes_model::recurrent::{RecurrentAgent, RecurrentNetworks};

use super::options::{RecurrentOptions, SYSTEMS};
use super::update::RecurrentLearner;
use crate::learners::sac::augment::Augment;
use crate::learners::sac::options::Size;

const SIDE: u32 = 16;

fn options(system: &str) -> RecurrentOptions {
    let options = RecurrentOptions::system(system, Size::Small).unwrap();
    RecurrentOptions {
        augment: Augment::Shift,
        length: 5,
        depth: 4,
        memory: 32,
        latent: 16,
        head: 32,
        hidden: 32,
        discount: 0.0,
        lr: 2e-3,
        model_lr: 1e-3,
        temperature_lr: 1e-2,
        ..options
    }
}

fn learner(options: &RecurrentOptions) -> RecurrentLearner {
    let spec = Spec {
        task: "made-up".to_owned(),
        action: ActionSpec { min: vec![-2.0], max: vec![2.0] },
        pixels: Some(ImageSize { height: SIDE, width: SIDE }),
        observation: Vec::new(),
        qpos: 0,
        qvel: 0,
        materials: Vec::new(),
        control_timestep: 0.02,
        action_repeat: 1,
        quantities: Vec::new(),
    };
    let config = options.networks(&spec, [SIDE as usize; 2]);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    RecurrentLearner::new(RecurrentNetworks::init(config, &mut rng, &Device::flex()).unwrap(), &Device::flex())
}

/// The best action at a brightness, in the task's bounds −2..2.
fn best(level: u8) -> f32 {
    1.6 * (f32::from(level) / 127.5 - 1.0)
}

fn windows(options: &RecurrentOptions, rng: &mut impl Rng) -> WindowBatch {
    let (length, batch) = (options.length, options.windows);
    let mut made = WindowBatch {
        length,
        batch,
        pixels: Vec::new(),
        observations: Vec::new(),
        actions: Vec::new(),
        previous_actions: Vec::new(),
        rewards: Vec::new(),
        is_first: (0..length * batch).map(|row| row < batch).collect(),
        starts: vec![(0, 0); batch],
    };
    for row in 0..length * batch {
        let (level, action): (u8, f32) = (rng.random(), rng.random_range(-2.0..2.0));
        made.pixels.resize(made.pixels.len() + (SIDE * SIDE * 3) as usize, level);
        made.previous_actions.push(if row < batch { 0.0 } else { made.actions[row - batch] });
        made.actions.push(action);
        made.rewards.push(1.0 - (action - best(level)).powi(2));
    }
    made
}

/// Mean distance of the agent's action from the best one, at an episode's first picture.
fn distance(learner: &RecurrentLearner) -> f32 {
    let mut agent = RecurrentAgent::new(&learner.networks, &Device::flex());
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let levels: Vec<u8> = (0..=8).map(|step| step * 31).collect();
    let distances = levels.iter().map(|&level| {
        agent.begin();
        agent.observe(&[level; (SIDE * SIDE * 3) as usize], &[0.0]).unwrap();
        (agent.choose(Choice::Mode, &mut rng)[0] - best(level)).abs()
    });
    distances.sum::<f32>() / levels.len() as f32
}

#[test]
fn the_best_action_is_found_where_it_is_known() {
    for (system, _) in SYSTEMS {
        let options = options(system);
        let (mut learner, mut rng) = (learner(&options), ChaCha8Rng::seed_from_u64(6));
        let before = distance(&learner);
        for _ in 0..600 {
            let batch = windows(&options, &mut rng);
            (learner, _) = learner.update(&batch, &options, &mut rng).unwrap();
        }
        let after = distance(&learner);
        assert!(after < 0.35 && after < 0.5 * before, "{system}: {before} before, {after} after");
    }
}

#[test]
fn what_is_left_out_does_not_move_and_what_is_not_does() {
    let moved = |system: &str| {
        let options = options(system);
        let before = learner(&options);
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let batch = windows(&options, &mut rng);
        let (after, measures) = before.clone().update(&batch, &options, &mut rng).unwrap();
        assert_eq!(measures.auxiliary_loss.is_some(), options.has_model_losses(), "{system}");
        let [before, after] = [before, after].map(|learner| read_parameters(&learner.networks.world, "world"));
        move |part: &str| before.iter().any(|(name, tensor)| name.starts_with(part) && tensor != &after[name])
    };
    let (rsac, core) = (moved("rsac"), moved("core"));
    for part in ["world.encoder.observe", "world.encoder.gru", "world.dynamics.gru"] {
        assert!(rsac(part) && core(part), "{part} learns from the critics' loss");
    }
    for part in ["world.heads", "world.numbers", "world.dynamics.head"] {
        assert!(!rsac(part) && core(part), "{part} learns from the model's losses alone");
    }
}

#[test]
fn an_episode_acted_step_by_step_gives_the_latents_it_learns_from() {
    let options = RecurrentOptions { augment: Augment::None, ..options("core") };
    let learner = learner(&options);
    let batch = windows(&RecurrentOptions { windows: 1, ..options.clone() }, &mut ChaCha8Rng::seed_from_u64(9));
    let mut agent = RecurrentAgent::new(&learner.networks, &Device::flex());
    let whole = vibes_model::trained::ModelFreeAgent::Recurrent(Box::new(agent.clone()));
    let mut episode = vibes_model::trained::TrainedEncoder::ModelFree(&whole).episode(&Device::flex());
    let frames = vibes_model::encode::RawFrames::Pixels(&batch.pixels);
    let latents = episode.push(frames, &batch.previous_actions).unwrap();
    let width = latents.len() / options.length;
    for (row, picture) in batch.pixels.chunks_exact((SIDE * SIDE * 3) as usize).enumerate() {
        let latent = agent.observe(picture, &batch.previous_actions[row..=row]).unwrap();
        assert_eq!(latent, latents[row * width..(row + 1) * width]);
        assert!((latent.iter().map(|value| value * value).sum::<f32>() - 1.0).abs() < 1e-4);
    }
}
