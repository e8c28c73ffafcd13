//! On pictures whose brightness says which action is best, with no future: the optimum is known. And what must hold of every update.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::module::Module;
use burn::tensor::Device;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_model::actions::Choice;
use vibes_model::parameters::{read_parameters, write_parameters};
use vibes_model::sac::{SacAgent, SacNetworks};

use super::augment::Augment;
use super::options::{Auxiliary, SYSTEMS, SacOptions, Size};
use super::transitions::{Ahead, Transitions};
use super::update::SacLearner;

const SIDE: usize = 16;

fn options(system: &str) -> SacOptions {
    let options = SacOptions::system(system, Size::Small).unwrap();
    // A crop of so small a picture would leave less than the convolutions need.
    let augment = if options.augment == Augment::Crop { Augment::Shift } else { options.augment };
    let frequencies = options.frequencies.map(|_| 8);
    SacOptions { batch: 32, hidden: 32, feature: 16, samples: 16, actor_every: 1, augment, frequencies, ..options }
}

fn learner(options: &SacOptions) -> SacLearner {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let config = options.networks("made-up", [SIDE, SIDE], (vec![-2.0], vec![2.0]));
    SacLearner::new(SacNetworks::init(config, &mut rng, &Device::flex()).unwrap(), &Device::flex())
}

/// The learner after one update on some batch, made after `made` others.
fn updated(before: &SacLearner, options: &SacOptions, made: u64) -> SacLearner {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let batch = transitions(options, &mut rng);
    before.clone().update(&batch, options, made, &mut rng).unwrap().0
}

/// The best action at a brightness, in the task's bounds −2..2.
fn best(level: u8) -> f32 {
    1.6 * (f32::from(level) / 127.5 - 1.0)
}

fn transitions(options: &SacOptions, rng: &mut impl Rng) -> Transitions {
    let stack = SIDE * SIDE * 3 * options.stack;
    let mut made = Transitions {
        rows: options.batch,
        shape: [SIDE, SIDE, 3 * options.stack],
        stacks: Vec::new(),
        next_stacks: Vec::new(),
        actions: Vec::new(),
        rewards: Vec::new(),
        ahead: None,
    };
    for _ in 0..options.batch {
        let level: u8 = rng.random();
        let action: f32 = rng.random_range(-1.0..1.0);
        made.stacks.resize(made.stacks.len() + stack, level);
        made.next_stacks.resize(made.next_stacks.len() + stack, rng.random());
        made.actions.push(action);
        made.rewards.push(1.0 - (2.0 * action - best(level)).powi(2));
    }
    let steps = options.auxiliary.sequence();
    // Every step ahead looks like the next one and earns what this one does.
    let rewards = |reward: &f32| vec![*reward; steps];
    made.ahead = (steps > 0).then(|| Ahead {
        steps,
        stacks: [made.stacks.clone(), made.next_stacks.repeat(steps - 1)].concat(),
        rewards: made.rewards.iter().flat_map(rewards).collect(),
    });
    made
}

/// Mean distance of the agent's action from the best one.
fn distance(learner: &SacLearner) -> f32 {
    let mut agent = SacAgent::new(&learner.networks, &Device::flex());
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let levels: Vec<u8> = (0..=8).map(|step| step * 31).collect();
    let distances = levels.iter().map(|&level| {
        agent.begin();
        agent.observe(&[level; SIDE * SIDE * 3]).unwrap();
        (agent.choose(Choice::Mode, &mut rng)[0] - best(level)).abs()
    });
    distances.sum::<f32>() / levels.len() as f32
}

#[test]
fn the_best_action_is_found_where_it_is_known() {
    for system in ["sac-drq", "qt-opt-drq", "curl", "sar"] {
        let options = SacOptions { discount: 0.0, lr: 2e-3, temperature_lr: 1e-2, ..options(system) };
        let mut learner = learner(&options);
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let before = distance(&learner);
        for made in 0..400 {
            let batch = transitions(&options, &mut rng);
            (learner, _) = learner.update(&batch, &options, made, &mut rng).unwrap();
        }
        let after = distance(&learner);
        assert!(after < 0.3 && after < 0.5 * before, "{system}: {before} to {after}");
    }
}

/// Laid over any system, an auxiliary loss weighs what it weighs in the system that it was published with.
#[test]
fn an_auxiliary_loss_brings_its_weight() {
    for size in [Size::Small, Size::Paper] {
        for (home, _) in SYSTEMS {
            let home = SacOptions::system(home, size).unwrap();
            for (system, _) in SYSTEMS {
                let laid = SacOptions::system(system, size).unwrap().with(home.auxiliary, size);
                let found = (laid.auxiliary, laid.auxiliary_weight, laid.frequencies);
                assert_eq!(found, (home.auxiliary, home.auxiliary_weight, home.frequencies), "{system}");
            }
        }
    }
}

#[test]
fn every_system_learns_and_goes_on_from_disk_to_the_same_bytes() {
    for (system, _) in SYSTEMS {
        let options = options(system);
        let step = |learner: SacLearner, made: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(100 + made);
            let batch = transitions(&options, &mut rng);
            learner.update(&batch, &options, made, &mut rng).unwrap()
        };
        let (first, measures) = step(learner(&options), 0);
        assert_eq!(measures.auxiliary_loss.is_some(), options.auxiliary != Auxiliary::None, "{system}");
        assert_eq!(measures.actor_loss.is_some(), options.actor, "{system}");
        let folder = tempfile::tempdir().unwrap();
        first.save(folder.path()).unwrap();
        let loaded = SacLearner::load(folder.path(), &Device::flex()).unwrap();
        let bytes = |learner: &SacLearner| {
            let folder = tempfile::tempdir().unwrap();
            learner.save(folder.path()).unwrap();
            ["sac.safetensors", "sac_optimizer.safetensors", "sac.json"]
                .map(|file| std::fs::read(folder.path().join(file)).unwrap())
        };
        assert!(bytes(&first) == bytes(&loaded), "{system}: saving and loading");
        let (gone_on, undisturbed) = (step(loaded, 1).0, step(first.clone(), 1).0);
        assert!(bytes(&gone_on) == bytes(&undisturbed), "{system}: going on");
        assert!(bytes(&gone_on) != bytes(&first), "{system}: learning");
    }
}

/// The numbers that each system's own repository gives (`train/BASELINES.md` has where this departs from them). For QT-Opt there is none: rates are those of the system with an actor.
#[test]
fn every_system_goes_by_its_published_numbers() {
    // Shares that the slow encoder and the slow critics go, Adam's step sizes for the networks and the temperature; updates from one step of the actor to the next.
    let published = [
        ("sac-rad", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("sac-drq", [0.01, 0.01, 1e-3, 1e-3], 2),
        ("qt-opt-rad", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("qt-opt-drq", [0.01, 0.01, 1e-3, 1e-3], 2),
        ("curl", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("deepmdp", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("dbc", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("mico", [0.005, 0.005, 1e-3, 1e-3], 1),
        ("simsr", [0.05, 0.01, 1e-3, 1e-4], 2),
        ("sar", [0.05, 0.01, 5e-4, 5e-4], 2),
    ];
    assert_eq!(published.map(|(system, ..)| system), SYSTEMS.map(|(system, _)| system));
    for (system, rates, actor_every) in published {
        for size in [Size::Paper, Size::Small] {
            let made = SacOptions::system(system, size).unwrap();
            let found = [made.encoder_rate, made.critic_rate, made.lr, made.temperature_lr];
            assert_eq!((found, made.actor_every), (rates, actor_every), "{system} at {size}");
        }
    }
}

/// That of all of them but `MICo`, whose 1 is a departure.
#[test]
fn every_systems_first_temperature_is_a_tenth() {
    for (system, _) in SYSTEMS {
        let first = learner(&options(system)).networks.temperature.log.val().exp().into_scalar::<f32>();
        assert!((first - 0.1).abs() < 1e-6, "{system}: {first}");
    }
}

#[test]
fn neither_actor_nor_temperature_moves_the_critics_and_the_slow_copy_waits_for_them() {
    let options = SacOptions { actor_every: 2, ..options("sac-drq") };
    let before = learner(&options);
    // The actor makes a step after an even number of updates only; the critics' step is the same.
    let (with_actor, without) = (updated(&before, &options, 0), updated(&before, &options, 1));
    let critic = |learner: &SacLearner| read_parameters(&learner.networks.critic, "");
    assert!(critic(&with_actor) == critic(&without));
    let slow = |learner: &SacLearner| read_parameters(&learner.networks.slow, "");
    assert!(slow(&without) == slow(&before) && slow(&with_actor) != slow(&before));
    let actor = |learner: &SacLearner| read_parameters(learner.networks.actor.as_ref().unwrap(), "");
    assert!(actor(&without) == actor(&before) && actor(&with_actor) != actor(&before));
}

#[test]
fn the_slow_copy_follows_by_its_systems_rates() {
    let rates = [("sac-rad", 0.05, 0.01), ("sac-drq", 0.01, 0.01), ("mico", 0.005, 0.005), ("sar", 0.05, 0.01)];
    for (system, of_encoder, of_critics) in rates {
        let options = options(system);
        let before = learner(&options);
        let after = updated(&before, &options, 0);
        let slow = |learner: &SacLearner| read_parameters(&learner.networks.slow, "");
        let (from, to) = (slow(&before), read_parameters(&after.networks.critic, ""));
        for (name, copy) in slow(&after) {
            let is_encoder = name.contains("convolutions") || name.contains("trunk");
            let rate: f32 = if is_encoder { of_encoder } else { of_critics };
            for ((copy, from), to) in copy.values.iter().zip(&from[&name].values).zip(&to[&name].values) {
                assert!((copy - (from + rate * (to - from))).abs() < 1e-6, "{system}: {name}");
            }
        }
    }
}

#[test]
fn a_loss_that_is_no_number_is_an_error() {
    let options = options("sac-drq");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut batch = transitions(&options, &mut rng);
    batch.rewards[0] = f32::NAN;
    let error = learner(&options).update(&batch, &options, 0, &mut rng).unwrap_err().to_string();
    assert!(error.contains("critics' loss"), "{error}");
}

#[test]
fn no_weight_that_is_no_number_is_saved_wherever_it_is() {
    let options = options("curl");
    let sound = learner(&options);
    let refused = |change: &dyn Fn(&mut SacNetworks)| {
        let mut learner = sound.clone();
        change(&mut learner.networks);
        let folder = tempfile::tempdir().unwrap();
        let error = learner.save(folder.path()).unwrap_err().to_string();
        assert!(error.contains("a weight") && !folder.path().join("sac.safetensors").exists(), "{error}");
    };
    refused(&|networks| networks.temperature = overflowed(networks.temperature.clone()));
    refused(&|networks| networks.slow = overflowed(networks.slow.clone()));
    refused(&|networks| networks.further = overflowed(networks.further.clone()));
}

/// The module with weights that are no numbers.
fn overflowed<M: Module>(module: M) -> M {
    let mut tensors = read_parameters(&module, "all");
    tensors.values_mut().for_each(|tensor| tensor.values.fill(f32::NAN));
    write_parameters(module, "all", &tensors).unwrap()
}

/// Adam would move the first of the weights and leave the rest.
#[test]
fn moments_of_other_networks_are_refused() {
    let options = options("sac-drq");
    let [own, other] = [16, 12].map(|feature| SacOptions { feature, ..options.clone() });
    let folders = [own, other].map(|options| {
        let folder = tempfile::tempdir().unwrap();
        updated(&learner(&options), &options, 0).save(folder.path()).unwrap();
        folder
    });
    let [own, other] = folders.each_ref().map(|folder| folder.path().join("sac_optimizer.safetensors"));
    std::fs::copy(other, own).unwrap();
    let error = SacLearner::load(folders[0].path(), &Device::flex()).unwrap_err().to_string();
    assert!(error.contains("moments of 416 weights of first.first.weight") && error.contains("has 544"), "{error}");
}
