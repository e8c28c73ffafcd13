//! The GRU against the plain Burn operations: values and gradients.

use burn::tensor::{Device, Distribution, Tensor};

use super::*;
use crate::kernels::plain;

fn random<const D: usize>(shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::random(shape, Distribution::Normal(0.0, 0.5), device).require_grad()
}

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
    let gates = random([length, batch, 3 * hidden], &device);
    let weight = random([hidden, 3 * hidden], &device);
    let bias = random([3 * hidden], &device);
    let initial = random([batch, hidden], &device);
    let keep = resets.then(|| Tensor::random([length, batch], Distribution::Bernoulli(0.8), &device));
    let tensors = (gates.clone(), weight.clone(), bias.clone(), initial.clone());
    let found = operation::gru(tensors, keep.clone(), instructions).expect("the custom path");
    let expected = plain::gru(gates.clone(), weight.clone(), bias.clone(), initial.clone(), keep);
    assert_close(found.clone().inner(), expected.clone().inner());

    let factor = Tensor::<3>::random(found.dims(), Distribution::Normal(0.0, 1.0), &device);
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
    let [gates, weight] =
        [[4, 2, 30], [1, 10, 30]].map(|shape| Tensor::<3>::random(shape, Distribution::Default, &device));
    let (weight, bias, initial) =
        (weight.squeeze_dim(0), Tensor::zeros([30], &device), Tensor::zeros([2, 10], &device));
    let found = gru(gates.clone(), weight.clone(), bias.clone(), initial.clone(), None);
    assert_close(found, plain::gru(gates, weight, bias, initial, None));
}
