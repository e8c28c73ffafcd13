//! The objective against `tests/golden/objective.json`: values and gradients computed in float64 by another program.

use burn::tensor::{Device, Tensor, TensorData};
use serde_json::Value as Json;
use vibes_model::gaussian::Gaussian;
use vibes_model::parameters::to_values;

use super::vibes::{Clip, adversary_objective};
use super::*;
use crate::learners::scene::{Predictions, gated};
use crate::options::Options;

const TOLERANCE: f32 = 1e-5;

fn golden() -> Json {
    serde_json::from_str(include_str!("../../../tests/golden/objective.json")).expect("golden file")
}

fn flatten(json: &Json, out: &mut Vec<f32>) {
    match json {
        Json::Array(items) => items.iter().for_each(|item| flatten(item, out)),
        number => out.push(number.as_f64().expect("a number") as f32),
    }
}

fn numbers(json: &Json) -> Vec<f32> {
    let mut out = Vec::new();
    flatten(json, &mut out);
    out
}

/// `[6, 4, last]`, gradients kept.
fn leaf(json: &Json, device: &Device) -> Tensor<3> {
    let values = numbers(json);
    let last = values.len() / 24;
    Tensor::<3>::from_data(TensorData::new(values, [6, 4, last]), device).require_grad()
}

fn assert_close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        let error = (found - wanted).abs() / wanted.abs().max(1.0);
        assert!(error <= TOLERANCE, "{what}[{index}]: {found} against {wanted}");
    }
}

/// The golden arrays, where every one of the six steps has a prediction: a first latent that nothing predicts is put before them, with a reward
/// that does not count.
struct Case {
    s: Tensor<3>,
    dynamics: Gaussian,
    adversary: Gaussian,
    reward: Gaussian,
    predictions: Predictions,
}

fn case(golden: &Json, device: &Device) -> Case {
    let input = |name: &str| leaf(&golden["inputs"][name], device);
    let s = input("s");
    let dynamics = Gaussian { mean: input("dyn_mean"), std: input("dyn_std") };
    let adversary = Gaussian { mean: input("adv_mean"), std: input("adv_std") };
    let reward = Gaussian { mean: input("r_mean"), std: input("r_std") };
    let row = |value: f32, width: usize| Tensor::<3>::full([1, 4, width], value, device);
    let first = |x: &Tensor<3>, value: f32| Tensor::cat(vec![row(value, x.dims()[2]), x.clone()], 0);
    let predictions = Predictions {
        latents: first(&s, 0.0),
        dynamics: dynamics.clone(),
        reward: Gaussian { mean: first(&reward.mean, 0.0), std: first(&reward.std, 1.0) },
        rewards: first(&leaf(&golden["inputs"]["r"], device), 0.0),
        counted: first(&Tensor::ones([6, 4, 1], device), 0.0),
        count: 24.0,
    };
    Case { s, dynamics, adversary, reward, predictions }
}

const ONE: Weights = Weights { reward: 1.0, count: 24.0 };

fn stated(value: &Value, name: &str) -> Vec<f32> {
    let found = value.stated.iter().find(|(stated, _)| *stated == name);
    to_values(found.unwrap_or_else(|| panic!("no {name}")).1.clone())
}

#[test]
fn vibes_agrees_with_the_golden_value_and_all_gradients() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    // ψ is held fixed: the adversary's outputs are constants here, the latents are not.
    let fixed = Gaussian { mean: case.adversary.mean.clone().detach(), std: case.adversary.std.clone().detach() };
    let value = vibes::value(&case.predictions, &fixed, Clip::Batch, ONE);
    assert_close(&to_values(value.objective.clone()), &numbers(&golden["L"]), "L");
    assert_close(&stated(&value, "clipped_share"), &numbers(&golden["clipped_share"]), "clipped share");
    let grads = value.objective.backward();
    let checks = [
        ("s", &case.s),
        ("dyn_mean", &case.dynamics.mean),
        ("dyn_std", &case.dynamics.std),
        ("r_mean", &case.reward.mean),
        ("r_std", &case.reward.std),
    ];
    for (name, tensor) in checks {
        let grad = tensor.grad(&grads).unwrap_or_else(|| panic!("no gradient for {name}"));
        assert_close(&to_values(grad), &numbers(&golden["grad_L"][name]), name);
    }
}

#[test]
fn log_ratio_is_summed_over_the_batch() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    let of = |gaussian: &Gaussian| case.predictions.latent_log_prob(gaussian);
    let ratio = vibes::log_ratio(of(&case.dynamics), of(&case.adversary));
    assert_close(&to_values(ratio), &numbers(&golden["log_ratio"]), "log-ratio");
}

#[test]
fn the_adversary_objective_agrees_with_the_golden_value_and_gradients() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    let detached = Predictions { latents: case.predictions.latents.clone().detach(), ..case.predictions.clone() };
    let value = adversary_objective(detached.latent_log_prob(&case.adversary), 24.0);
    assert_close(&to_values(value.clone()), &numbers(&golden["J"]), "J");
    let grads = value.backward();
    for (name, tensor) in [("adv_mean", &case.adversary.mean), ("adv_std", &case.adversary.std)] {
        let grad = tensor.grad(&grads).unwrap_or_else(|| panic!("no gradient for {name}"));
        assert_close(&to_values(grad), &numbers(&golden["grad_J"][name]), name);
    }
    assert!(case.s.grad(&grads).is_none(), "the latents are held fixed");
}

#[test]
fn no_adversary_agrees_with_the_golden_value() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    let value = no_adversary::value(&case.predictions, ONE);
    assert_close(&to_values(value.objective), &numbers(&golden["L_without_adversary"]), "L without adversary");
}

#[test]
fn reconstruction_adds_the_observations_to_no_adversary() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    // The first row does not count, so only six of the seven rows of four add their −2.5.
    let observations = Tensor::<2>::full([7, 4], -2.5, &device);
    let value = reconstruction::value(&case.predictions, observations, ONE);
    let wanted = numbers(&golden["L_without_adversary"])[0] - 2.5;
    assert_close(&to_values(value.objective), &[wanted], "L");
}

#[test]
fn rows_that_do_not_count_have_no_influence() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let mut case = case(&golden, &device);
    let before = to_values(vibes::value(&case.predictions, &case.adversary, Clip::Batch, ONE).objective);
    // Another latent and another reward in the row that does not count.
    let first = |x: Tensor<3>| Tensor::cat(vec![x.clone().narrow(0, 0, 1) + 3.0, x.clone().narrow(0, 1, 6)], 0);
    case.predictions.latents = first(case.predictions.latents);
    case.predictions.rewards = first(case.predictions.rewards);
    let after = to_values(vibes::value(&case.predictions, &case.adversary, Clip::Batch, ONE).objective);
    assert_close(&after, &before, "objective");
}

#[test]
fn an_unknown_objective_lists_the_known_ones() {
    let error = "dreamer".parse::<Objective>().expect_err("unknown").to_string();
    assert!(error.contains("vibes, no-adversary, reconstruction"), "{error}");
}

#[test]
fn the_share_of_the_gradient_is_the_weight_and_the_values_stay() {
    let device = Device::flex().autodiff();
    for weight in [0.0, 0.25, 1.0] {
        let latents = Tensor::<3>::from_data([[[1.0_f32, -2.0, 0.5]]], &device).require_grad();
        let gated = gated(&latents, weight);
        assert_close(&to_values(gated.clone()), &[1.0, -2.0, 0.5], "values");
        let grads = gated.sum().backward();
        let found = latents.grad(&grads).map_or(vec![0.0; 3], to_values);
        assert_close(&found, &[weight; 3], "gradient");
    }
}

#[test]
fn the_ways_to_clip_differ_as_their_sums_do() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    let term = |clip| {
        let value = vibes::value(&case.predictions, &case.adversary, clip, ONE);
        to_values((value.objective - value.reward) * 24.0)[0]
    };
    let ratio = to_values(vibes::log_ratio(
        case.predictions.latent_log_prob(&case.dynamics),
        case.predictions.latent_log_prob(&case.adversary),
    ));
    let dims = ratio.len() / 6;
    let cut: f32 = ratio.iter().map(|x| x.min(0.0)).sum();
    let over_time: f32 = (0..dims).map(|dim| ratio.iter().skip(dim).step_by(dims).sum::<f32>().min(0.0)).sum();
    let sum: f32 = ratio.iter().sum();
    for (clip, wanted) in [(Clip::Batch, cut), (Clip::BatchTime, over_time), (Clip::None, sum)] {
        assert!(
            (term(clip) - wanted).abs() < 1e-3 * wanted.abs().max(1.0),
            "{clip:?}: {} against {wanted}",
            term(clip)
        );
    }
    assert!(cut < over_time && over_time <= sum.min(0.0), "the golden case cuts something: {cut} {over_time} {sum}");
}

#[test]
fn steps_that_only_warm_up_have_no_share_in_what_is_cut() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let mut case = case(&golden, &device);
    // Only the last two of six steps count; all of their ratios are made positive, so all that counts is cut.
    let counted = Tensor::cat(vec![Tensor::zeros([5, 4, 1], &device), Tensor::ones([2, 4, 1], &device)], 0);
    case.predictions.counted = counted;
    let poor = Gaussian { mean: case.adversary.mean.clone() + 100.0, std: case.adversary.std.clone() };
    let value = vibes::value(&case.predictions, &poor, Clip::Batch, ONE);
    assert_close(&stated(&value, "clipped_share"), &[1.0], "clipped share");
}

/// Every objective and every auxiliary term says what nothing else says.
#[test]
fn names_and_options_are_unique() {
    let mut names: Vec<&str> = REGISTRY.iter().map(|definition| definition.name()).collect();
    names.extend(crate::learners::auxiliary::REGISTRY.iter().map(|term| term.metric()));
    names.extend(crate::learners::declared().map(|option| option.flag));
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "{names:?}");
}

/// ψ is held fixed, and the latents reach its log-likelihood by two ways: as what is predicted, and through its own recurrent network as what it is predicted from.
#[test]
fn the_gradient_through_the_adversarys_recurrence_is_that_of_finite_differences() {
    use rand::SeedableRng;
    use vibes_model::adversary::Adversary;
    use vibes_model::{ModelConfig, ObservationKind};

    let device = Device::flex().autodiff();
    let options = Options::resolve("tiny", &[]).expect("a preset");
    let sizes = crate::bench::Sizes { picture: 16, actions: 2, repeats: 1 };
    let kind = ObservationKind::Vector { len: 3 };
    let config = ModelConfig { hidden: 16, latent: 4, ..options.model(&crate::bench::made_up_spec(sizes), kind, 1.0) };
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let adversary = Adversary::init(&config, &mut rng, &device).expect("an adversary");
    let [length, batch] = [6, 3];
    let mut random = |width: usize| {
        let values = vibes_model::init::normal(length * batch * width, &mut rng);
        Tensor::<3>::from_data(TensorData::new(values, [length, batch, width]), &device)
    };
    let (features, actions, next) = (random(16), random(2), random(4) * 0.3);
    let latents = random(4);
    let log_likelihood =
        |latents: Tensor<3>| adversary.forward(features.clone(), latents, actions.clone()).log_prob(next.clone()).sum();
    let leaf = latents.clone().require_grad();
    let grads = log_likelihood(leaf.clone()).backward();
    let gradient = to_values(leaf.grad(&grads).expect("a gradient"));
    let values = to_values(latents);
    // The last step's latent has a gradient through one step only, the first's through all six.
    for index in 0..values.len() {
        let at = |step: f32| {
            let mut moved = values.clone();
            moved[index] += step;
            let moved = Tensor::<3>::from_data(TensorData::new(moved, [length, batch, 4]), &device);
            f64::from(log_likelihood(moved).into_scalar::<f32>())
        };
        const STEP: f32 = 0.01;
        let wanted = (at(STEP) - at(-STEP)) / f64::from(2.0 * STEP);
        let error = (f64::from(gradient[index]) - wanted).abs() / wanted.abs().max(1.0);
        assert!(error < 0.03, "latent {index}: {} against {wanted}", gradient[index]);
    }
    assert!(gradient[..4].iter().any(|x| x.abs() > 1e-3), "the first step reaches the last: {gradient:?}");
}
