//! λ-returns against `tests/golden/behaviour.json` and the identities that hold of any.

use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::actions::noise;
use crate::golden::{Case, assert_close};
use crate::parameters::to_values;

#[test]
fn lambda_returns_are_the_golden_ones() {
    let case = Case::named("lambda_return");
    let found = lambda_returns(case.input("reward"), case.input("value"), case.scalar("gamma"), case.scalar("lambda"));
    assert_close(&to_values(found), &case.out("returns"), "returns");
}

fn made_up(horizon: usize) -> (Tensor<2>, Tensor<2>) {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
    (noise([horizon, 4], &mut rng, &device), noise([horizon + 1, 4], &mut rng, &device))
}

#[test]
fn one_step_is_the_reward_and_the_discounted_next_value() {
    let (rewards, values) = made_up(1);
    let found = lambda_returns(rewards.clone(), values.clone(), 0.9, 0.7);
    let wanted = rewards + values.narrow(0, 1, 1) * 0.9;
    assert_close(&to_values(found), &to_values(wanted), "H = 1");
}

#[test]
fn with_lambda_one_it_is_the_discounted_sum() {
    let (rewards, values) = made_up(6);
    let found = to_values(lambda_returns(rewards.clone(), values.clone(), 0.9, 1.0));
    let (rewards, values) = (to_values(rewards), to_values(values));
    for k in 0..6 {
        for row in 0..4 {
            let sum: f32 = (k..6).map(|j| 0.9_f32.powi((j - k) as i32) * rewards[j * 4 + row]).sum();
            let wanted = sum + 0.9_f32.powi(6 - k as i32) * values[6 * 4 + row];
            assert!((found[k * 4 + row] - wanted).abs() < 1e-5, "{k} {row}");
        }
    }
}

#[test]
fn a_constant_reward_has_the_sum_of_the_series_for_every_lambda_and_horizon() {
    let device = Device::flex();
    for (horizon, lambda) in [(1, 0.0), (5, 0.5), (15, 0.95), (15, 1.0)] {
        let rewards = Tensor::<2>::ones([horizon, 3], &device);
        let values = Tensor::<2>::full([horizon + 1, 3], 100.0, &device);
        for found in to_values(lambda_returns(rewards, values, 0.99, lambda)) {
            assert!((found - 100.0).abs() < 1e-3, "{horizon} {lambda}: {found}");
        }
    }
}

#[test]
fn the_scale_of_returns_is_the_golden_one() {
    let case = Case::named("return_scale");
    let mut scale = ReturnScale::default();
    let found: Vec<f32> = case
        .rows("returns")
        .iter()
        .map(|returns| {
            scale = scale.after(returns);
            scale.divisor() as f32
        })
        .collect();
    assert_close(&found, &case.out("scale"), "scale");
}
