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
