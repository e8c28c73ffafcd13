//! The linear layer against Burn's own, forward and backward, at sizes that fill no panel.

use burn::tensor::{Device, Tensor, TensorData, module};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::init::normal;
use crate::parameters::to_values;

fn random<const D: usize>(shape: [usize; D], rng: &mut ChaCha8Rng, device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(normal(shape.iter().product(), rng), shape), device).require_grad()
}

fn close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let largest = wanted.iter().fold(1e-3_f32, |largest, x| largest.max(x.abs()));
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((found - wanted).abs() <= 2e-5 * largest, "{what}[{index}]: {found} against {wanted}");
    }
}

#[test]
fn it_is_burns_own_in_both_passes() {
    let device = Device::flex().autodiff();
    for [rows, input, output] in [[1, 3, 1], [17, 33, 40], [128, 257, 96], [130, 64, 31]] {
        let mut rng = ChaCha8Rng::seed_from_u64(rows as u64);
        let (x, weight) = (random([rows, input], &mut rng, &device), random([input, output], &mut rng, &device));
        let bias = random([output], &mut rng, &device);
        let scale: Tensor<2> = random([rows, output], &mut rng, &device).inner();
        let gradients = |out: Tensor<2>| {
            let mut gradients = (out * Tensor::from_inner(scale.clone())).sum().backward();
            [
                to_values(x.grad_remove(&mut gradients).unwrap()),
                to_values(weight.grad_remove(&mut gradients).unwrap()),
                to_values(bias.grad_remove(&mut gradients).unwrap()),
            ]
        };
        let wanted = module::linear(x.clone(), weight.clone(), Some(bias.clone()));
        let wanted_gradients = gradients(wanted.clone());
        for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
            if !instructions.available() {
                continue;
            }
            let found = operation::linear(x.clone(), weight.clone(), bias.clone(), instructions).unwrap();
            close(&to_values(found.clone()), &to_values(wanted.clone()), "output");
            for (index, (found, wanted)) in gradients(found).iter().zip(&wanted_gradients).enumerate() {
                close(found, wanted, &format!("gradient {index} with {instructions:?}"));
            }
        }
    }
}

#[test]
fn a_fixed_layer_passes_gradients_to_its_input_alone() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let x = random([20, 6], &mut rng, &device);
    let (weight, bias) = (random([6, 8], &mut rng, &device).inner(), random([8], &mut rng, &device).inner());
    let found = x.grad(&linear(x.clone(), weight.clone(), bias.clone()).sum().backward()).unwrap();
    let plain = module::linear(x.clone(), Tensor::from_inner(weight), Some(Tensor::from_inner(bias)));
    let wanted = x.grad(&plain.sum().backward()).unwrap();
    close(&to_values(found), &to_values(wanted), "input");
}
