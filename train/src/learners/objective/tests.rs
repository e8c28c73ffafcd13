//! The objective against `tests/golden/objective.json`: values and gradients computed in float64 by another program.

use burn::tensor::{Device, Tensor, TensorData};
use serde_json::Value as Json;
use vibes_model::gaussian::Gaussian;
use vibes_model::parameters::to_values;

use super::*;

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

const ONE: f32 = 1.0;

#[test]
fn vibes_agrees_with_the_golden_value_and_all_gradients() {
    let (golden, device) = (golden(), Device::flex().autodiff());
    let case = case(&golden, &device);
    // ψ is held fixed: the adversary's outputs are constants here, the latents are not.
    let fixed = Gaussian { mean: case.adversary.mean.clone().detach(), std: case.adversary.std.clone().detach() };
    let value = vibes::value(&case.predictions, &fixed, ONE);
    assert_close(&to_values(value.objective.clone()), &numbers(&golden["L"]), "L");
    assert_close(&to_values(value.clipped.expect("clipping")), &numbers(&golden["clipped_share"]), "clipped share");
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
    let before = to_values(vibes::value(&case.predictions, &case.adversary, ONE).objective);
    // Another latent and another reward in the row that does not count.
    let first = |x: Tensor<3>| Tensor::cat(vec![x.clone().narrow(0, 0, 1) + 3.0, x.clone().narrow(0, 1, 6)], 0);
    case.predictions.latents = first(case.predictions.latents);
    case.predictions.rewards = first(case.predictions.rewards);
    let after = to_values(vibes::value(&case.predictions, &case.adversary, ONE).objective);
    assert_close(&after, &before, "objective");
}

#[test]
fn an_unknown_objective_lists_the_known_ones() {
    let error = "dreamer".parse::<Objective>().expect_err("unknown").to_string();
    assert!(error.contains("vibes, no-adversary, reconstruction"), "{error}");
}

#[test]
fn the_encoder_hears_the_share_it_is_told_and_the_values_stay() {
    let device = Device::flex().autodiff();
    for weight in [0.0, 0.25, 1.0] {
        let latents = Tensor::<3>::from_data([[[1.0_f32, -2.0, 0.5]]], &device).require_grad();
        let heard = hear(&latents, weight);
        assert_close(&to_values(heard.clone()), &[1.0, -2.0, 0.5], "values");
        let grads = heard.sum().backward();
        let found = latents.grad(&grads).map_or(vec![0.0; 3], to_values);
        assert_close(&found, &[weight; 3], "gradient");
    }
}
