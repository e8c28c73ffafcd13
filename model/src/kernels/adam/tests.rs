//! The one-pass update against the plain operations, and against numbers worked out by hand.

use burn::tensor::{Device, Tensor, Tolerance};

use super::{Adam, Moments};
use crate::kernels::draws::Draws;

#[test]
fn agrees_with_plain_operations() {
    let device = Device::flex();
    let mut draws = Draws::new(0);
    let mut random = || draws.normal([37, 1001], 1.0, &device);
    let (parameter, gradient, first, second) = (random(), random(), random(), random().abs());
    let adam = Adam::default();
    let tensors = [parameter.clone(), gradient.clone(), first.clone(), second.clone()];
    let expected = adam.update_plainly(tensors, 0.5, adam.corrections(1e-3, 7));
    let (parameter, moments) = adam.update(parameter, gradient, Some(Moments { first, second }), 1e-3, 0.5, 7);
    for (found, expected) in [parameter, moments.first, moments.second].into_iter().zip(expected) {
        found.into_data().assert_approx_eq::<f32>(&expected.into_data(), Tolerance::absolute(1e-6));
    }
}

#[test]
fn the_first_step_has_the_size_of_the_rate() {
    let device = Device::flex();
    let parameter = Tensor::<1>::from_floats([1.0, 1.0, 1.0], &device);
    let kept = parameter.clone();
    let gradient = Tensor::<1>::from_floats([4.0, -0.01, 0.0], &device);
    let (updated, _) = Adam::default().update(parameter, gradient, None, 0.1, 1.0, 1);
    updated.into_data().assert_approx_eq::<f32>(&[0.9_f32, 1.1, 1.0].into(), Tolerance::absolute(1e-5));
    kept.into_data().assert_eq(&[1.0_f32, 1.0, 1.0].into(), true);
}

/// Kingma and Ba's algorithm 1 in double precision, from moments of zero on: every step is corrected by its own power of the decays. The gradients change sign, so that the first moment and the
/// root of the second go apart.
#[test]
fn four_steps_are_those_of_the_published_formula() {
    const RATE: f64 = 0.1;
    let gradients = [[0.5_f32, -2.0, 1e-3], [-0.7, 1.5, 2e-3], [0.3, 0.25, -4e-3], [-1.1, -0.5, 1e-3]];
    let device = Device::flex();
    let start = [1.0_f32, -0.5, 0.25];
    let (mut parameter, mut moments) = (Tensor::<1>::from_floats(start, &device), None);
    // Value and both moments of each number.
    let mut wanted = start.map(|value| [f64::from(value), 0.0, 0.0]);
    for (step, gradient) in (1_i32..).zip(gradients) {
        let given = Tensor::<1>::from_floats(gradient, &device);
        let (next, made) = Adam::default().update(parameter, given, moments, RATE, 1.0, step as u64);
        for ([value, first, second], gradient) in wanted.iter_mut().zip(gradient.map(f64::from)) {
            *first = 0.9 * *first + 0.1 * gradient;
            *second = 0.999 * *second + 0.001 * gradient * gradient;
            let (mean, square) = (*first / (1.0 - 0.9_f64.powi(step)), *second / (1.0 - 0.999_f64.powi(step)));
            *value -= RATE * mean / (square.sqrt() + 1e-8);
        }
        let values = wanted.map(|[value, ..]| value as f32);
        next.clone().into_data().assert_approx_eq::<f32>(&values.into(), Tolerance::absolute(1e-5));
        (parameter, moments) = (next, Some(made));
    }
}

/// On `flex` the loop would end with the shortest of them, and the rest of the weights would stay where they are.
#[test]
#[should_panic(expected = "of one shape")]
fn moments_of_fewer_numbers_are_none_of_the_parameter() {
    let device = Device::flex();
    let [parameter, gradient] = [1.0, 2.0].map(|value| Tensor::<1>::full([4], value, &device));
    let [first, second] = [0.0, 0.0].map(|value| Tensor::<1>::full([3], value, &device));
    let _ = Adam::default().update(parameter, gradient, Some(Moments { first, second }), 0.1, 1.0, 2);
}
