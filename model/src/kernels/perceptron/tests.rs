//! The perceptron against the composition of Burn's own operations, forward and backward, at sizes that fill no panel and no lane.

use burn::tensor::{Device, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::init::normal;
use crate::kernels::Instructions;
use crate::parameters::to_values;

fn random<const D: usize>(shape: [usize; D], scale: f32, rng: &mut ChaCha8Rng, device: &Device) -> Tensor<D> {
    let values: Vec<f32> = normal(shape.iter().product(), rng).into_iter().map(|x| x * scale).collect();
    Tensor::from_data(TensorData::new(values, shape), device).require_grad()
}

fn close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let largest = wanted.iter().fold(1e-3_f32, |largest, x| largest.max(x.abs()));
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((found - wanted).abs() <= 2e-5 * largest, "{what}[{index}]: {found} against {wanted}");
    }
}

#[test]
fn it_is_the_composition_of_plain_operations_in_both_passes() {
    let device = Device::flex().autodiff();
    for (rows, widths) in [(1, [3, 5, 4, 1]), (250, [37, 40, 33, 3]), (485, [288, 64, 64, 255])] {
        let mut rng = ChaCha8Rng::seed_from_u64(rows as u64);
        let x: Tensor<2> = random([rows, widths[0]], 1.0, &mut rng, &device);
        let layers = [0, 1, 2].map(|layer| {
            let scale = (2.0 / widths[layer] as f32).sqrt();
            (
                random([widths[layer], widths[layer + 1]], scale, &mut rng, &device),
                random([widths[layer + 1]], 0.3, &mut rng, &device),
            )
        });
        let weights: Tensor<2> = random([rows, widths[3]], 1.0, &mut rng, &device).inner();
        let wanted = plain::perceptron(x.clone(), layers.clone());
        let mut gradients = (wanted.clone() * weights.clone()).sum().backward();
        let take = |x: &Tensor<2>, layers: &[LayerWeights; 3], gradients: &mut burn::tensor::Gradients| {
            let mut all = vec![to_values(x.grad_remove(gradients).unwrap())];
            for (weight, bias) in layers {
                all.push(to_values(weight.grad_remove(gradients).unwrap()));
                all.push(to_values(bias.grad_remove(gradients).unwrap()));
            }
            all
        };
        let wanted_gradients = take(&x, &layers, &mut gradients);
        for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
            if !instructions.available() {
                continue;
            }
            let found = operation::perceptron(x.clone(), &layers, instructions).unwrap();
            close(&to_values(found.clone()), &to_values(wanted.clone()), "output");
            let mut gradients = (found * weights.clone()).sum().backward();
            let found = take(&x, &layers, &mut gradients);
            for (index, (found, wanted)) in found.iter().zip(&wanted_gradients).enumerate() {
                close(found, wanted, &format!("gradient {index} with {instructions:?}"));
            }
        }
    }
}

/// Rows enough for the operation to be the custom one.
const ROWS: usize = LEAST_ROWS + 4;

fn fixed(rng: &mut ChaCha8Rng, device: &Device) -> [LayerWeights; 3] {
    [[6, 8], [8, 8], [8, 2]].map(|shape: [usize; 2]| {
        (random(shape, 0.5, rng, device).inner(), random([shape[1]], 0.5, rng, device).inner())
    })
}

/// Of constants no gradient is asked for, and the input's is the same as ever.
#[test]
fn a_fixed_perceptron_passes_gradients_to_its_input_alone() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let x: Tensor<2> = random([ROWS, 6], 1.0, &mut rng, &device);
    let layers = fixed(&mut rng, &device);
    let wanted = x.grad(&plain::perceptron(x.clone(), layers.clone()).sum().backward()).unwrap();
    for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
        if instructions.available() {
            let found = operation::perceptron(x.clone(), &layers, instructions).unwrap();
            let found = x.grad(&found.sum().backward()).unwrap();
            close(&to_values(found), &to_values(wanted.clone()), "input");
        }
    }
}

/// What is not asked for is not computed either.
#[test]
fn a_lane_finds_what_is_wanted_and_nothing_else() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let x: Vec<f32> = normal(ROWS * 6, &mut rng);
    let layers = fixed(&mut rng, &device);
    let both = operation::gradients(&x, &layers, [true, true]);
    let [of_x, of_weights] = [[true, false], [false, true]].map(|wanted| operation::gradients(&x, &layers, wanted));
    assert_eq!(both.each_ref().map(Vec::len), [ROWS * 6, 48, 8, 64, 8, 16, 2]);
    assert!(of_x[0] == both[0] && of_x[1..].iter().all(Vec::is_empty));
    assert!(of_weights[0].is_empty() && of_weights[1..] == both[1..]);
}
