//! The kernels against the plain Burn operations: values and gradients.

use burn::tensor::{Device, Int, Tensor};

use super::*;
use crate::kernels::draws::Draws;
use crate::kernels::instructions::Instructions;
use crate::parameters::to_values;

fn layers(channels: &[[usize; 2]], device: &Device) -> Vec<ConvLayer> {
    let mut draws = Draws::new(0);
    channels
        .iter()
        .map(|[c, n]| ConvLayer {
            weight: draws.normal([*n, *c, 4, 4], (2.0 / (16 * c) as f32).sqrt(), device).require_grad(),
            bias: draws.normal([*n], 0.1, device).require_grad(),
        })
        .collect()
}

fn frames(shape: [usize; 4], device: &Device) -> Tensor<4, Int> {
    let bytes = (0..shape.iter().product::<usize>()).map(|i| (i * i / 7 + 31 * i) as u8).collect();
    pixel_tensor(bytes, shape, device)
}

/// Relative distance in the 2-norm.
fn distance<const D: usize>(a: Tensor<D>, b: Tensor<D>) -> f32 {
    assert_eq!(a.dims(), b.dims());
    let norm = |x: Tensor<D>| x.powi_scalar(2).sum().sqrt().into_scalar::<f32>();
    norm(a - b.clone()) / norm(b).max(1e-12)
}

fn assert_agree(image: [usize; 2], channels: &[[usize; 2]], count: usize, instructions: Instructions) {
    if !instructions.available() {
        return;
    }
    let device = Device::flex().autodiff();
    let layers = layers(channels, &device);
    let pixels = frames([count, image[0], image[1], 3], &device);
    let expected = plain::features(pixels.clone(), &layers);
    let found = operation::features_with(&pixels, &layers, instructions).expect("the custom path");
    assert!(distance(found.clone().inner(), expected.clone().inner()) < 1e-5);

    let weight: Tensor<2> = Draws::new(1).normal(found.dims(), 1.0, &device);
    let found = (found * weight.clone()).sum().backward();
    let expected = (expected * weight).sum().backward();
    for (index, layer) in layers.iter().enumerate() {
        let weight = distance(layer.weight.grad(&found).unwrap(), layer.weight.grad(&expected).unwrap());
        let bias = distance(layer.bias.grad(&found).unwrap(), layer.bias.grad(&expected).unwrap());
        assert!(weight < 2e-5 && bias < 2e-5, "layer {index}: {weight} {bias} with {instructions:?}");
    }
}

const ALL: [Instructions; 3] = [Instructions::Avx512, Instructions::Avx2, Instructions::Portable];

#[test]
fn agrees_on_the_default_network() {
    for instructions in ALL {
        assert_agree([64, 64], &[[3, 32], [32, 64], [64, 128], [128, 256]], 5, instructions);
    }
}

#[test]
fn agrees_on_odd_sizes() {
    for instructions in ALL {
        assert_agree([37, 50], &[[3, 40], [40, 24], [24, 7]], 33, instructions);
        assert_agree([23, 30], &[[3, 8], [8, 20]], 3, instructions);
        assert_agree([84, 84], &[[3, 16], [16, 32], [32, 64], [64, 64]], 2, instructions);
        assert_agree([5, 9], &[[3, 5]], 1, instructions);
    }
}

#[test]
fn an_inner_device_gives_the_same_features() {
    let device = Device::flex().autodiff();
    let layers = layers(&[[3, 16], [16, 32]], &device);
    let pixels = frames([4, 16, 16, 3], &device);
    let inner: Vec<ConvLayer> = layers
        .iter()
        .map(|layer| ConvLayer { weight: layer.weight.clone().inner(), bias: layer.bias.clone().inner() })
        .collect();
    let followed = features(pixels.clone(), &layers).inner();
    let unfollowed = features(pixels.inner(), &inner);
    assert_eq!(followed.into_data(), unfollowed.into_data());
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let device = Device::flex().autodiff();
            let layers: Vec<ConvLayer> = [[3, 16], [16, 32], [32, 32]]
                .iter()
                .map(|[c, n]| {
                    let values: Vec<f32> = (0..n * c * 16).map(|i| ((i * 37 % 101) as f32 - 50.0) / 500.0).collect();
                    let data = TensorData::new(values, [*n, *c, 4, 4]);
                    ConvLayer {
                        weight: Tensor::from_data(data, &device).require_grad(),
                        bias: Tensor::zeros([*n], &device).require_grad(),
                    }
                })
                .collect();
            let gradients = features(frames([67, 32, 32, 3], &device), &layers).powi_scalar(2).sum().backward();
            layers.iter().map(|layer| layer.weight.grad(&gradients).unwrap().into_data()).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
#[allow(deprecated, reason = "ndarray is the other backend that needs no graphics processor")]
fn other_backends_take_the_plain_path() {
    let device = Device::ndarray().autodiff();
    let layers = layers(&[[3, 4], [4, 6]], &device);
    let pixels = frames([2, 14, 14, 3], &device);
    assert!(operation::features(&pixels, &layers).is_none());
    let gradients = features(pixels, &layers).sum().backward();
    assert_eq!(layers[0].weight.grad(&gradients).unwrap().dims(), [4, 3, 4, 4]);
}

/// As with Burn's own ReLU.
#[test]
fn what_is_no_number_stays_none_and_passes_gradients_on() {
    let device = Device::flex().autodiff();
    let mut layers = layers(&[[3, 8], [8, 8]], &device);
    layers[0].bias = Tensor::full([8], f32::NAN, &device).require_grad();
    let pixels = frames([2, 14, 14, 3], &device);
    for instructions in ALL.into_iter().filter(|set| set.available()) {
        let found = operation::features_with(&pixels, &layers, instructions).expect("the custom path");
        assert!(to_values(found.clone().inner()).iter().all(|value| value.is_nan()), "{instructions:?}");
        // One for each of the 2×2 places of both frames.
        let bias = layers[1].bias.grad(&found.sum().backward()).unwrap();
        assert_eq!(to_values(bias), [8.0; 8], "{instructions:?}");
    }
}

#[test]
fn counts_features() {
    assert_eq!(feature_count([64, 64], 4, 256), Some(1024));
    assert_eq!(feature_count([84, 84], 4, 64), Some(9 * 64));
    assert_eq!(feature_count([12, 12], 4, 256), None);
}
