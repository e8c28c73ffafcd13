//! Both distributions against `tests/golden/behaviour.json`, and what must hold of any sample.

use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::golden::{Case, assert_close};
use crate::parameters::to_values;

#[test]
fn the_tanh_normal_is_the_golden_one() {
    let case = Case::named("tanh_normal");
    let [x, mean, std] = ["x", "mean", "std"].map(|name| case.input::<2>(name));
    let actions = Actions::new(ActionDistribution::TanhNormal, mean.clone(), std.clone());
    let density = actions.log_prob(x.clone());
    assert_close(&to_values(density.clone()), &case.out("log_prob"), "log_prob");
    assert_close(&to_values(x.clone().tanh()), &case.out("action"), "action");
    let mut gradients = density.sum().backward();
    for (name, tensor) in [("mean", mean), ("std", std), ("x", x)] {
        let found = tensor.grad_remove(&mut gradients).unwrap();
        assert_close(&to_values(found), &case.gradient(name), name);
    }
}

#[test]
fn the_bounded_normal_is_the_golden_one() {
    let case = Case::named("bounded_normal");
    let [m, v, a] = ["m", "v", "a"].map(|name| case.input::<2>(name));
    let actions = ActionDistribution::BoundedNormal.of(Tensor::cat(vec![m.clone(), v.clone()], 1));
    assert_close(&to_values(actions.mean.clone()), &case.out("mean"), "mean");
    assert_close(&to_values(actions.std.clone()), &case.out("std"), "std");
    let density = actions.log_prob(a.clone().detach());
    let sample = ActionSample { normal: a.clone(), action: a };
    let entropy = actions.entropy(&sample);
    assert_close(&to_values(density.clone()), &case.out("log_prob"), "log_prob");
    assert_close(&to_values(entropy), &case.out("entropy"), "entropy");
    let mut gradients = (density.sum() + actions.std.log().sum()).backward();
    for (name, tensor) in [("m", m), ("v", v)] {
        let found = tensor.grad_remove(&mut gradients).unwrap();
        assert_close(&to_values(found), &case.gradient(name), name);
    }
}

/// What a network may put out, from tame to absurd.
fn outputs(device: &Device) -> Tensor<2> {
    Tensor::from_data([[0.0, 0.0], [3.0, -4.0], [-1e4, 1e4], [1e4, -1e4]], device)
}

#[test]
fn samples_stay_in_bounds_and_all_numbers_are_finite() {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(1));
    for kind in [ActionDistribution::BoundedNormal, ActionDistribution::TanhNormal] {
        let actions = kind.of(outputs(&device));
        let sample = actions.sample(noise([4, 1], &mut rng, &device));
        for tensor in [sample.action.clone(), actions.mode()] {
            assert!(to_values(tensor).iter().all(|action| action.abs() <= 1.0), "{kind:?}");
        }
        let numbers = [actions.log_prob(sample.normal.clone()), actions.entropy(&sample)];
        assert!(numbers.into_iter().flat_map(to_values).all(f32::is_finite), "{kind:?}");
    }
}

/// The estimate of a tanh-normal's entropy is right in the mean: a standard deviation of 0.1 around 0 hardly bends, so it is the normal's own.
#[test]
fn the_entropy_of_a_narrow_tanh_normal_is_that_of_the_normal() {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(2));
    let like = Tensor::<2>::zeros([20_000, 1], &device);
    let actions = Actions::new(ActionDistribution::TanhNormal, like.clone(), like + 0.1);
    let sample = actions.sample(noise([20_000, 1], &mut rng, &device));
    let mean = actions.entropy(&sample).mean().into_scalar::<f32>();
    assert!((mean - (0.1_f32.ln() + UNIT_ENTROPY)).abs() < 0.02, "{mean}");
}

/// Through the cut flows the gradient of the sample as if there were none.
#[test]
fn a_cut_sample_still_moves_its_mean() {
    let device = Device::flex().autodiff();
    let output = Tensor::<2>::from_data([[2.0, 0.0]], &device).require_grad();
    let sample = ActionDistribution::BoundedNormal.of(output.clone()).sample(Tensor::from_data([[3.0]], &device));
    assert!((to_values(sample.action.clone())[0] - 1.0).abs() < 1e-6);
    let gradient = output.grad(&sample.action.sum().backward()).unwrap();
    let slope = 1.0 - 2.0_f32.tanh().powi(2);
    assert!((to_values(gradient)[0] - slope).abs() < 1e-6);
}
