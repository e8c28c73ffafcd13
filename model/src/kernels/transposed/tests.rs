//! The custom operation against Burn's own, values and gradients, at sizes even and odd and with every set of instructions.

use burn::tensor::{Device, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::init::normal;
use crate::parameters::to_values;

fn leaf<const D: usize>(shape: [usize; D], seed: u64) -> Tensor<D> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let values = normal(shape.iter().product(), &mut rng);
    Tensor::from_data(TensorData::new(values, shape), &Device::flex().autodiff()).require_grad()
}

fn assert_close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((found - wanted).abs() <= 1e-4 * wanted.abs().max(1.0), "{what}[{index}]: {found}, not {wanted}");
    }
}

/// Values, and gradients of maps, weight and bias under a slope that differs from place to place.
fn run(shape: [usize; 4], output: usize, padding: [usize; 2], relu: bool, own: Option<Instructions>) -> [Vec<f32>; 4] {
    let maps = leaf(shape, 1);
    let layer = TransposedLayer { weight: leaf([shape[3], output, 4, 4], 2), bias: leaf([output], 3), padding, relu };
    let y = match own {
        Some(instructions) => operation::transposed(&maps, &layer, instructions).expect("runs on flex"),
        None => plain::transposed(maps.clone(), &layer),
    };
    let gradients = (y.clone() * leaf(y.dims(), 4).detach()).sum().backward();
    [
        to_values(y),
        to_values(maps.grad(&gradients).expect("of the maps")),
        to_values(layer.weight.grad(&gradients).expect("of the weight")),
        to_values(layer.bias.grad(&gradients).expect("of the bias")),
    ]
}

#[test]
fn agrees_with_the_ordinary_transposed_convolution() {
    let sets = [Instructions::Avx512, Instructions::Avx2, Instructions::Portable];
    let cases = [
        ([2, 3, 3, 5], 4, [0, 0], false),
        ([1, 2, 5, 3], 2, [1, 0], true),
        ([3, 4, 1, 33], 3, [1, 1], true),
        ([70, 2, 2, 40], 17, [0, 1], true),
    ];
    for (shape, output, padding, relu) in cases {
        let wanted = run(shape, output, padding, relu, None);
        for instructions in sets.into_iter().filter(|set| set.available()) {
            let found = run(shape, output, padding, relu, Some(instructions));
            for ((found, wanted), what) in found.iter().zip(&wanted).zip(["values", "maps", "weight", "bias"]) {
                assert_close(found, wanted, &format!("{instructions:?}, {shape:?}, {what}"));
            }
        }
    }
}

/// As with Burn's own ReLU.
#[test]
fn what_is_no_number_stays_none_and_passes_gradients_on() {
    let bias = Tensor::full([4], f32::NAN, &Device::flex().autodiff()).require_grad();
    let layer = TransposedLayer { weight: leaf([3, 4, 4, 4], 2), bias, padding: [0, 0], relu: true };
    let sets = [Instructions::Avx512, Instructions::Avx2, Instructions::Portable];
    for instructions in sets.into_iter().filter(|set| set.available()) {
        let y = operation::transposed(&leaf([1, 2, 2, 3], 1), &layer, instructions).expect("runs on flex");
        let gradients = y.clone().sum().backward();
        assert!(to_values(y).iter().all(|value| value.is_nan()), "{instructions:?}");
        // One for each of the 6×6 places.
        assert_eq!(to_values(layer.bias.grad(&gradients).expect("of the bias")), [36.0; 4], "{instructions:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| run([67, 3, 3, 6], 5, [0, 0], true, Some(Instructions::best())))
    };
    assert_eq!(on(1), on(3));
}
