//! Actor and critic on made-up worlds: both recipes and both gradients get better, values become what can be written down, and the world model stays as it is.

use burn::tensor::TensorData;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_model::parameters::read_parameters;
use vibes_model::{Model, ModelConfig};

use vibes_model::actions::noise;

use super::*;
use crate::error::TrainError;

const LENGTH: usize = 4;
const BATCH: usize = 6;

fn config() -> ModelConfig {
    serde_json::from_value(serde_json::json!({
        "task": "made-up", "observation": { "kind": "vector", "len": 3 },
        "action_min": [-1.0, -1.0], "action_max": [1.0, 1.0],
        "depth": 4, "hidden": 16, "head": 24, "latent": 6,
        "latent_std": 0.1, "prediction_floor": 0.1, "reward_floor": 0.1, "adversary": false, "decoder": false,
    }))
    .unwrap()
}

fn world(seed: u64) -> World {
    Model::init(config(), &mut ChaCha8Rng::seed_from_u64(seed), &Device::flex()).unwrap().world
}

/// A world whose every reward is `reward`.
fn constant_world(reward: f32) -> World {
    let mut world = world(1);
    world.reward.head = world.reward.head.last_zeroed();
    let bias = world.reward.head.last.bias.clone();
    world.reward.head.last.bias = bias.map(|bias| Tensor::from_data([reward, 0.0], &bias.device()));
    world
}

fn rows(reward: f32) -> Replayed {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(5));
    let latents: Tensor<3> = noise([LENGTH, BATCH, 6], &mut rng, &device);
    Replayed {
        latents: vibes_model::gaussian::unit_norm(latents),
        states: noise::<3>([LENGTH, BATCH, 16], &mut rng, &device).tanh(),
        actions: noise::<3>([LENGTH, BATCH, 2], &mut rng, &device).clamp(-1.0, 1.0),
        rewards: vec![reward; LENGTH * BATCH],
        counted: (0..LENGTH * BATCH).map(|place| place >= BATCH).collect(),
        episodes: (0..BATCH as u32).collect(),
    }
}

fn learner(options: &BehaviourOptions) -> BehaviourLearner {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let behaviour = Behaviour::init(&config(), options.config(), &mut rng, &Device::flex());
    BehaviourLearner::new(behaviour, &Device::flex())
}

fn trained(world: &World, rows: &Replayed, options: &BehaviourOptions, updates: u64) -> (BehaviourLearner, [f32; 2]) {
    let mut learner = learner(options);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut first, mut last) = (0.0, 0.0);
    for update in 0..updates {
        let (next, measures) = learner.update(world, rows, options, true, &mut rng).unwrap();
        learner = next;
        if update < 10 {
            first += measures.imagined_reward / 10.0;
        }
        if update + 10 >= updates {
            last += measures.imagined_reward / 10.0;
        }
    }
    (learner, [first, last])
}

fn quick(options: BehaviourOptions) -> BehaviourOptions {
    BehaviourOptions { horizon: 5, discount: 0.9, actor_lr: 3e-3, critic_lr: 3e-3, hidden: 24, ..options }
}

#[test]
fn every_recipe_and_gradient_finds_better_actions_and_leaves_the_world_alone() {
    let (world, rows) = (world(4), rows(0.0));
    let before = read_parameters(&world, "world");
    for (name, recipe) in options::RECIPES {
        for gradient in [Gradient::Dynamics, Gradient::Reinforce] {
            let options = BehaviourOptions { gradient, ..quick(recipe()) };
            let (_, [first, last]) = trained(&world, &rows, &options, 200);
            assert!(last > first + 0.1, "{name} {gradient:?}: {first} to {last}");
        }
    }
    assert_eq!(read_parameters(&world, "world"), before);
}

/// Reward 1 for ever is worth 1 / (1 − γ) = 10, whatever is done.
#[test]
fn values_of_a_constant_reward_become_the_sum_of_the_series() {
    for (name, recipe) in options::RECIPES {
        let options = BehaviourOptions { critic_lr: 1e-2, slow_rate: 0.1, ..quick(recipe()) };
        let rows = rows(1.0);
        let (learner, _) = trained(&constant_world(1.0), &rows, &options, 600);
        let starts = rows.starts(&rows.chosen(1), &Device::flex());
        let seen = vibes_model::actor::features(starts.states, starts.latents);
        let value = mean(&to_values(learner.behaviour.critic.valid().values(seen)));
        assert!((value - 10.0).abs() < 0.5, "{name}: {value}");
    }
}

/// Recorded and imagined rewards of the same constant give the same targets.
#[test]
fn targets_along_recorded_rewards_end_in_imagined_returns() {
    let options = quick(options::dreamer_v3());
    let (rows, learner) = (rows(1.0), learner(&options));
    let chosen = rows.chosen(1);
    assert_eq!(chosen.len(), (LENGTH - 1) * BATCH);
    let imagined = vec![10.0; options.horizon * chosen.len()];
    let (seen, targets) = learner.replay_targets(&rows, &chosen, &imagined, &options).unwrap();
    // The first row of each window does not count and the last has no successor.
    assert_eq!(seen.dims(), [(LENGTH - 2) * BATCH, 22]);
    assert!(to_values(targets).iter().all(|target| (target - 10.0).abs() < 1e-4));
}

/// With rewards and imagined returns that differ from row to row a target of another row would be seen: R(k) is r(k) + γ[(1 − λ) I(k+1) + λ R(k+1)], where R of a window's last row
/// is the imagined I.
#[test]
fn targets_of_a_row_begin_with_its_own_reward_and_the_next_rows_return() {
    let options = quick(options::dreamer_v3());
    let learner = learner(&options);
    let numbers: Vec<f32> = (0..LENGTH * BATCH).map(|row| 0.1 * row as f32).collect();
    let rows = Replayed { rewards: numbers, ..rows(1.0) };
    let chosen = rows.chosen(1);
    let imagined: Vec<f32> = (0..options.horizon * chosen.len()).map(|start| 3.0 + 0.7 * start as f32).collect();
    let (_, targets) = learner.replay_targets(&rows, &chosen, &imagined, &options).unwrap();
    let (discount, lambda) = (options.discount as f32, options.lambda as f32);
    let return_of = |step: usize, window: usize| {
        let place = chosen.iter().position(|&row| row as usize == step * BATCH + window).unwrap();
        imagined[place]
    };
    let mut wanted = Vec::new();
    for window in 0..BATCH {
        let mut target = return_of(LENGTH - 1, window);
        for step in (1..LENGTH - 1).rev() {
            let reward = 0.1 * (step * BATCH + window) as f32;
            target = reward + discount * ((1.0 - lambda) * return_of(step + 1, window) + lambda * target);
            wanted.push(target);
        }
    }
    let found = to_values(targets);
    assert_eq!(found.len(), wanted.len());
    assert!(
        found.iter().zip(&wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-4),
        "{found:?}, not {wanted:?}"
    );
}

#[test]
fn while_only_the_critic_learns_the_actor_does_not_move() {
    let options = quick(options::gaussian());
    let learner = learner(&options);
    let before = [read_parameters(&learner.behaviour.actor, ""), read_parameters(&learner.behaviour.critic, "")];
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (learner, measures) = learner.update(&constant_world(1.0), &rows(1.0), &options, false, &mut rng).unwrap();
    assert_eq!(read_parameters(&learner.behaviour.actor, ""), before[0]);
    assert_ne!(read_parameters(&learner.behaviour.critic, ""), before[1]);
    assert_eq!(measures.actor_gradient_norm, None);
}

#[test]
fn a_reward_that_is_no_number_ends_the_update_with_its_name() {
    let options = quick(options::gaussian());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let error = learner(&options).update(&constant_world(f32::NAN), &rows(1.0), &options, true, &mut rng).unwrap_err();
    assert!(matches!(error, TrainError::NotFinite { .. }), "{error}");
}

/// By steps of a window, and not by places in a batch, of which every 4th would be of 2 windows only.
#[test]
fn imagination_starts_in_every_window_alike() {
    let (length, batch) = (16, 8);
    let like = Tensor::<3>::zeros([length, batch, 1], &Device::flex());
    let after = Tensor::<3>::zeros([length - 1, batch, 1], &Device::flex());
    let counted = (0..length * batch).map(|place| place >= 2 * batch).collect();
    let rows = Replayed::detached(like.clone(), after, like, vec![0.0; length * batch], (counted, vec![0; batch]));
    assert_eq!(rows.chosen(1).len(), 14 * batch);
    for every in 2..=8 {
        let mut of_window = vec![0; batch];
        for place in rows.chosen(every) {
            assert!(place >= 2 * batch as i64, "only rows that count");
            of_window[place as usize % batch] += 1;
        }
        let (least, most) = (14 / every, 14_usize.div_ceil(every));
        assert!(of_window.iter().all(|count| (least..=most).contains(count)), "{every}: {of_window:?}");
    }
}

/// The states of an update, given as the dynamics has them after each row, are moved to before it.
#[test]
fn states_are_those_before_the_action() {
    let after = Tensor::<3>::from_data(TensorData::new(vec![1.0_f32, 2.0], [2, 1, 1]), &Device::flex());
    let like = Tensor::<3>::zeros([3, 1, 1], &Device::flex());
    let rows = Replayed::detached(like.clone(), after, like, vec![0.0; 3], (vec![true; 3], vec![0]));
    assert_eq!(to_values(rows.states), [0.0, 1.0, 2.0]);
}

/// A guard of the same heads takes nothing from the returns, and one whose heads lie a known distance apart the same from every imagined reward.
#[test]
fn a_guard_takes_the_disagreement_of_its_members_from_every_reward() {
    let options = BehaviourOptions { guard: 3.0, guard_members: 2, ..quick(options::gaussian()) };
    let (world, rows) = (world(4), rows(0.0));
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let returns = |guard: Option<Guard>| {
        let learner = learner(&options).guarded(guard);
        let (dynamics, reward) = (world.dynamics.valid(), world.reward.valid());
        let starts = rows.starts(&rows.chosen(1), &Device::flex());
        let noise = ImaginationNoise::draw(
            [options.horizon, starts.latents.dims()[0]],
            [2, 6],
            &mut ChaCha8Rng::seed_from_u64(9),
            &Device::flex(),
        );
        let judged = learner.judge(&Learned { dynamics: &dynamics, reward: &reward }, starts, &noise, &options, true);
        to_values(judged.returns.inner())
    };
    let mut guard = options.guard(&config(), &mut rng, &Device::flex()).unwrap();
    guard.members.heads = vec![guard.members.heads[0].clone(); 2];
    let without = returns(None);
    let apart = |found: &[f32], wanted: f32| {
        let apart = without.iter().zip(found).map(|(without, found)| (without - found - wanted).abs());
        // `f32::max` would pass over a difference that is none.
        apart.inspect(|apart| assert!(apart.is_finite(), "{apart}")).fold(0.0, f32::max)
    };
    assert!(apart(&returns(Some(guard.clone())), 0.0) < 1e-4);
    // Two heads 2 apart have a standard deviation of 1; three of them are taken from every reward, so 3 (1 + γλ + …) from every return: the last row's is 3.
    let bias = guard.members.heads[1].last.bias.clone();
    guard.members.heads[1].last.bias = bias.map(|bias| bias + 2.0);
    let guarded = returns(Some(guard));
    let last = without.len() - rows.chosen(1).len();
    assert!(guarded[last..].iter().zip(&without[last..]).all(|(found, without)| (without - found - 3.0).abs() < 1e-2));
    let whole: f32 = (0..5).map(|k| 3.0 * (0.9_f32 * 0.95).powi(k)).sum();
    assert!((without[0] - guarded[0] - whole).abs() < 1e-2, "{} {} {whole}", without[0], guarded[0]);
}

#[test]
fn a_guarded_actor_stays_where_the_members_agree() {
    let imagined = |weight: f64| {
        let options = BehaviourOptions { guard: weight, ..quick(options::gaussian()) };
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let guard = options.guard(&config(), &mut rng, &Device::flex());
        let (mut learner, world, rows) = (learner(&options).guarded(guard), constant_world(0.0), rows(0.0));
        let mut recorded = Vec::new();
        let mut last = f32::NAN;
        for _ in 0..150 {
            let (next, measures) = learner.update(&world, &rows, &options, true, &mut rng).unwrap();
            learner = next;
            let [imagined, seen] = measures.disagreement.unwrap();
            recorded.push(seen);
            last = imagined;
        }
        assert!(recorded[149] < 0.5 * recorded[0], "members agree on what they learn: {recorded:?}");
        last
    };
    let [free, guarded] = [1e-9, 5.0].map(imagined);
    assert!(guarded < 0.9 * free, "{guarded} and {free}");
}

#[test]
fn without_a_guard_nothing_is_drawn_or_written_for_one() {
    let options = options::mixed();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    assert!(options.guard(&config(), &mut rng, &Device::flex()).is_none());
    assert_eq!(rng, ChaCha8Rng::seed_from_u64(1));
    let written = serde_json::to_string(&options).unwrap();
    assert!(!written.contains("guard"), "{written}");
    assert_eq!(serde_json::from_str::<BehaviourOptions>(&written).unwrap(), options);
}
