//! Auxiliary terms against the same sums made one window, one start and one step at a time.

use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use toml::{Table, Value};
use vibes_model::parameters::{HostTensors, to_values};
use vibes_model::{Model, ObservationKind};

use super::*;
use crate::batch::Batch;
use crate::bench::{Sizes, made_up_spec, made_up_windows};
use crate::learners::optimizer::NamedGradients;
use crate::learners::world::Learner;
use crate::options::Options;
use crate::settings::own::Kind;

const SIZES: Sizes = Sizes { picture: 16, actions: 2, repeats: 1 };
const TERMS: &str = "inverse_weight = 1.0\ninverse_steps = 3\nreward_steps = 3\nreward_steps_weight = 0.5\nlatent_steps = 2\nburn_in = 2\nlength = 6";

fn made_up(text: &str) -> (Model, Batch, Options) {
    made_up_with(text.parse().unwrap())
}

fn made_up_with(table: Table) -> (Model, Batch, Options) {
    let options = Options::resolve("tiny", &[("the test", table)]).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let kind = ObservationKind::Pixels { height: 16, width: 16 };
    let config = options.model(&made_up_spec(SIZES), kind, 1.0);
    let device = Device::flex();
    let model = Model::init(config, &mut rng, &device).unwrap();
    let windows = made_up_windows(&options, SIZES, &mut rng);
    let batch = Batch::new(&windows, &model.config, options.burn_in, &device.autodiff()).unwrap();
    (model, batch, options)
}

fn cell(x: &Tensor<3>, t: usize, b: usize) -> Tensor<3> {
    x.clone().narrow(0, t, 1).narrow(1, b, 1)
}

fn number(x: Tensor<1>) -> f64 {
    f64::from(x.into_scalar::<f32>())
}

/// `(h_t, s_t)` of one window, from its beginning.
fn policy_state(scene: &Scene<'_>, t: usize, b: usize) -> (Tensor<2>, Tensor<3>) {
    let mut state = Tensor::<2>::zeros([1, scene.options.hidden], &scene.latents.device());
    for before in 0..t {
        let (latent, action) = (cell(&scene.latents, before, b), cell(&scene.batch.actions, before, b));
        state = scene.world.dynamics.forward(latent, action, Some(state)).1.squeeze_dim::<2>(0);
    }
    (state, cell(&scene.latents, t, b))
}

#[test]
fn rewards_and_latents_ahead_are_those_of_single_steps() {
    let (model, batch, options) = made_up(TERMS);
    let learner = Learner::new(model, &options, &Device::flex());
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let schedule = options.schedule(0, Some(0));
    let Model { config, world, .. } = &learner.model;
    let scene = Scene::new((world, config), &batch, (&options.settings, schedule), &mut rng, &Device::flex()).unwrap();
    let (mut reward, mut latents) = ((0.0, 0), (0.0, 0));
    // The terms look three and two steps ahead of six rows, each from every row that has as many after it; the first two rows only warm up.
    for (t, b) in (2..4).flat_map(|t| (0..options.batch).map(move |b| (t, b))) {
        let (mut state, mut latent) = policy_state(&scene, t, b);
        for k in 1..=5 - t {
            let (next, after) = world.dynamics.forward(latent, cell(&batch.actions, t + k - 1, b), Some(state));
            state = after.squeeze_dim::<2>(0);
            if k <= 2 {
                latents.0 += number(next.log_prob(cell(&scene.latents, t + k, b)).sum());
                latents.1 += 1;
            }
            latent = next.mean;
            if t + 3 < 6 {
                let predicted = world.reward.forward(latent.clone(), cell(&batch.actions, t + k, b));
                reward.0 += number(predicted.log_prob(cell(&batch.rewards, t + k, b)).sum());
                reward.1 += 1;
            }
        }
    }
    let found = number(reward_ahead::RewardAhead.value(&scene, &mut rng).unwrap());
    let wanted = reward.0 / f64::from(reward.1);
    assert!((found - wanted).abs() < 1e-4 * wanted.abs(), "{found} against {wanted}");
    let found = number(latent_ahead::LatentAhead.value(&scene, &mut rng).unwrap());
    let wanted = latents.0 / f64::from(latents.1);
    assert!((found - wanted).abs() < 1e-4 * wanted.abs(), "{found} against {wanted}");
}

#[test]
fn the_inverse_sees_where_it_stood_and_where_it_was_later() {
    let (model, batch, options) = made_up(TERMS);
    let learner = Learner::new(model, &options, &Device::flex());
    let schedule = options.schedule(0, Some(0));
    let Model { config, world, .. } = &learner.model;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let scene = Scene::new((world, config), &batch, (&options.settings, schedule), &mut rng, &Device::flex()).unwrap();
    let steps = rand::Rng::random_range(&mut ChaCha8Rng::seed_from_u64(11), 1..=3_usize);
    let found = number(inverse::Inverse.value(&scene, &mut ChaCha8Rng::seed_from_u64(11)).unwrap());
    let (mut sum, mut count) = (0.0, 0);
    for (t, b) in (2..6 - steps).flat_map(|t| (0..options.batch).map(move |b| (t, b))) {
        let (state, latent) = policy_state(&scene, t, b);
        let distance: Vec<f32> = (1..=3).map(|k| if k == steps { 1.0 } else { 0.0 }).collect();
        let distance = Tensor::<1>::from_floats(&distance[..], &state.device()).reshape([1, 1, 3]);
        let features = vec![state.unsqueeze_dim::<3>(0), latent, cell(&scene.latents, t + steps, b), distance];
        let output = to_values(world.head("inverse").unwrap().forward(Tensor::cat(features, 2)));
        let action = to_values(cell(&batch.actions, t, b));
        for axis in 0..2 {
            let std = f64::from(output[2 + axis]).exp().ln_1p() + 0.1;
            let distance = (f64::from(action[axis]) - f64::from(output[axis])) / std;
            sum += -0.5 * distance * distance - std.ln() - 0.5 * std::f64::consts::TAU.ln();
        }
        count += 1;
    }
    let wanted = sum / f64::from(count);
    assert!((found - wanted).abs() < 1e-4 * wanted.abs().max(1.0), "{found} against {wanted}");
}

#[test]
fn a_term_that_is_not_asked_for_is_neither_built_nor_stated() {
    let (model, batch, options) = made_up("");
    assert!(!model.config.heads.iter().any(|head| head.name == "inverse"));
    let schedule = options.schedule(0, Some(0));
    let learner = Learner::new(model, &options, &Device::flex());
    let (_, measures) = learner.update(&batch, schedule, options.parts(), &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    for term in REGISTRY {
        assert!(!measures.stated.contains_key(term.metric()), "{}", term.metric());
    }
}

#[test]
fn every_term_learns_one_batch_beside_every_objective() {
    for objective in crate::learners::objective::Objective::all() {
        let steps = "self_prediction_steps = 3\nmulti_step_inverse_steps = 3";
        let text = format!("objective = '{objective}'\nlr = 0.002\n{TERMS}\n{steps}");
        let (model, batch, options) = made_up(&text);
        let mut learner = Learner::new(model, &options, &Device::flex());
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut stated = Vec::new();
        for _ in 0..120 {
            let (next, measures) =
                learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
            learner = next;
            stated.push(measures.stated);
        }
        for term in REGISTRY {
            let mean = |rows: &[std::collections::BTreeMap<&str, f32>]| {
                rows.iter().map(|row| row[term.metric()]).sum::<f32>() / rows.len() as f32
            };
            let (first, last) = (mean(&stated[..10]), mean(&stated[110..]));
            assert!(last > first, "{objective}, {}: {first} to {last}", term.metric());
        }
    }
}

/// By itself: the gradient of the term alone.
#[test]
fn every_term_reaches_the_encoder() {
    let (model, batch, options) = made_up(TERMS);
    let learner = Learner::new(model, &options, &Device::flex());
    let schedule = options.schedule(0, Some(0));
    let Model { config, world, .. } = &learner.model;
    for term in REGISTRY {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let scene =
            Scene::new((world, config), &batch, (&options.settings, schedule), &mut rng, &Device::flex()).unwrap();
        let mut gradients = term.value(&scene, &mut rng).unwrap().backward();
        let norm = NamedGradients::take(world, &mut gradients).norm("encoder.");
        assert!(norm > 0.0, "{}: {norm}", term.metric());
    }
}

/// In an update: with all else still, each weight in turn changes the encoder's gradient. Adam's first moments are a tenth of it after the first step where no norm is limited, so that a limit on all
/// gradients together changes nothing here.
#[test]
fn the_weight_of_every_term_changes_the_encoders_gradient() {
    for term in REGISTRY {
        let encoder_gradient = |weight: f64| -> HostTensors {
            let mut table: Table = TERMS.parse().unwrap();
            table.insert("gradient_clip".to_owned(), Value::Float(1e9));
            let is_number = |option: &&Declared| matches!(option.kind, Kind::Number { .. });
            let option = term.options().iter().find(is_number).expect("a weight");
            table.insert(option.key(), Value::Float(weight));
            let (model, batch, options) = made_up_with(table);
            assert_eq!(term.weight(&options), weight, "the weight of {} is another option", term.metric());
            let learner = Learner::new(model, &options, &Device::flex());
            let mut rng = ChaCha8Rng::seed_from_u64(6);
            let (learner, _) = learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
            let moments = learner.optimizer.to_tensors("world");
            moments.into_iter().filter(|(name, _)| name.starts_with("world.first.encoder.")).collect()
        };
        let (light, heavy) = (encoder_gradient(1.0), encoder_gradient(3.0));
        assert!(!light.is_empty() && light != heavy, "{}", term.metric());
    }
}

/// The future is never asked to be easier to predict: a latent that only others are run ahead to has no gradient at all.
#[test]
fn a_latent_that_is_only_a_target_is_not_moved() {
    let (model, batch, options) = made_up(TERMS);
    let learner = Learner::new(model, &options, &Device::flex());
    let schedule = options.schedule(0, Some(0));
    let Model { config, world, .. } = &learner.model;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut scene =
        Scene::new((world, config), &batch, (&options.settings, schedule), &mut rng, &Device::flex()).unwrap();
    let leaf = scene.latents.clone().detach().require_grad();
    scene.latents = leaf.clone();
    let gradients = latent_ahead::LatentAhead.value(&scene, &mut rng).unwrap().backward();
    let gradient = to_values(leaf.grad(&gradients).unwrap());
    // Six rows, two steps ahead: rows 2 and 3 are starts that count, rows 4 and 5 are targets and nothing else.
    let row = gradient.len() / 6;
    let is_moved = |t: usize| gradient[t * row..(t + 1) * row].iter().any(|slope| *slope != 0.0);
    assert_eq!([2, 3, 4, 5].map(is_moved), [true, true, false, false], "{gradient:?}");
}
