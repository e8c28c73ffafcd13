//! The GRU against the plain Burn operations: values and gradients.

use burn::tensor::{Device, Tensor};

use super::*;
use crate::kernels::draws::Draws;
use crate::kernels::plain;

fn assert_close<const D: usize>(found: Tensor<D>, expected: Tensor<D>) {
    let scale = expected.clone().abs().max().into_scalar::<f32>().max(1.0);
    let difference = (found - expected).abs().max().into_scalar::<f32>();
    assert!(difference < 5e-5 * scale, "{difference} of {scale}");
}

fn assert_agree([length, batch, hidden]: [usize; 3], resets: bool, instructions: Instructions) {
    if !instructions.available() {
        return;
    }
    let device = Device::flex().autodiff();
    let mut draws = Draws::new(0);
    let gates = draws.normal([length, batch, 3 * hidden], 0.5, &device).require_grad();
    let weight = draws.normal([hidden, 3 * hidden], 0.5, &device).require_grad();
    let bias = draws.normal([3 * hidden], 0.5, &device).require_grad();
    let initial = draws.normal([batch, hidden], 0.5, &device).require_grad();
    let keep = resets.then(|| draws.ones([length, batch], 0.8, &device));
    let tensors = (gates.clone(), weight.clone(), bias.clone(), initial.clone());
    let found = operation::gru(tensors, keep.clone(), instructions).expect("the custom path");
    let expected = plain::gru(gates.clone(), weight.clone(), bias.clone(), initial.clone(), keep);
    assert_close(found.clone().inner(), expected.clone().inner());

    let factor: Tensor<3> = draws.normal(found.dims(), 1.0, &device);
    let found = (found * factor.clone()).sum().backward();
    let expected = (expected * factor).sum().backward();
    assert_close(gates.grad(&found).unwrap(), gates.grad(&expected).unwrap());
    assert_close(weight.grad(&found).unwrap(), weight.grad(&expected).unwrap());
    assert_close(bias.grad(&found).unwrap(), bias.grad(&expected).unwrap());
    assert_close(initial.grad(&found).unwrap(), initial.grad(&expected).unwrap());
}

#[test]
fn agrees_with_plain_operations() {
    for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
        assert_agree([6, 16, 64], false, instructions);
        assert_agree([5, 11, 33], true, instructions);
        assert_agree([1, 1, 1], true, instructions);
        assert_agree([9, 3, 100], true, instructions);
    }
}

#[test]
fn agrees_without_autodiff() {
    let device = Device::flex();
    let mut draws = Draws::new(0);
    let (gates, weight) = (draws.normal([4, 2, 30], 0.5, &device), draws.normal([10, 30], 0.5, &device));
    let (bias, initial) = (Tensor::zeros([30], &device), Tensor::zeros([2, 10], &device));
    let found = gru(gates.clone(), weight.clone(), bias.clone(), initial.clone(), None);
    assert_close(found, plain::gru(gates, weight, bias, initial, None));
}
