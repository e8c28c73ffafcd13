//! The kernels against the plain Burn operations: values and gradients.

use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Int, Tensor, TensorData, activation};

use super::*;
use crate::kernels::draws::Draws;
use crate::kernels::instructions::Instructions;
use crate::kernels::pixel_tensor;
use crate::parameters::to_values;

fn layers(first: usize, filters: usize, count: usize, draws: &mut Draws, device: &Device) -> Vec<Conv3Layer> {
    (0..count)
        .map(|index| if index == 0 { first } else { filters })
        .map(|input| Conv3Layer {
            weight: draws.normal([filters, input, 3, 3], (2.0 / (9 * input) as f32).sqrt(), device).require_grad(),
            bias: draws.normal([filters], 0.1, device).require_grad(),
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

/// The least distance of a unit from the kink of its activation. Nearer than two ways of rounding lie apart, one of them passes a gradient on and the other does not.
fn margin(pixels: &Tensor<4, Int>, layers: &[Conv3Layer]) -> f32 {
    let mut least = f32::INFINITY;
    let mut x = pixels.clone().float().permute([0, 3, 1, 2]) / 255.0;
    for (index, layer) in layers.iter().enumerate() {
        let stride = if index == 0 { 2 } else { 1 };
        let options = ConvOptions::new([stride, stride], [0, 0], [1, 1], 1);
        let y = conv2d(x, layer.weight.clone(), Some(layer.bias.clone()), options);
        least = least.min(y.clone().abs().min().into_scalar::<f32>());
        x = activation::relu(y);
    }
    least
}

fn assert_agree(image: [usize; 2], channels: usize, layer_count: usize, count: usize, instructions: Instructions) {
    if !instructions.available() {
        return;
    }
    let device = Device::flex().autodiff();
    let pixels = frames([count, image[0], image[1], channels], &device);
    let draw = |seed| layers(channels, 32, layer_count, &mut Draws::new(seed), &device);
    let layers = (0..100).map(draw).find(|layers| margin(&pixels, layers) > 2e-5).expect("layers off every kink");
    let expected = plain::conv3_features(pixels.clone(), &layers);
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

#[test]
fn agrees_with_burns_own_operations() {
    for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
        assert_agree([21, 21], 9, 4, 3, instructions);
        assert_agree([20, 33], 3, 4, 9, instructions);
        assert_agree([18, 17], 9, 3, 17, instructions);
        assert_agree([7, 5], 3, 1, 2, instructions);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let device = Device::flex().autodiff();
            let layers: Vec<Conv3Layer> = [9, 32]
                .iter()
                .map(|input| {
                    let values: Vec<f32> =
                        (0..32 * input * 9).map(|i| ((i * 37 % 101) as f32 - 50.0) / 500.0).collect();
                    Conv3Layer {
                        weight: Tensor::from_data(TensorData::new(values, [32, *input, 3, 3]), &device).require_grad(),
                        bias: Tensor::zeros([32], &device).require_grad(),
                    }
                })
                .collect();
            let features = conv3_features(frames([19, 16, 16, 9], &device), &layers);
            let gradients = features.powi_scalar(2).sum().backward();
            layers.iter().map(|layer| layer.weight.grad(&gradients).unwrap().into_data()).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn other_sizes_take_the_plain_path() {
    let device = Device::flex().autodiff();
    let layers = layers(9, 8, 2, &mut Draws::new(0), &device);
    let pixels = frames([2, 14, 14, 9], &device);
    assert!(operation::features(&pixels, &layers).is_none());
    let features = conv3_features(pixels, &layers);
    let [height, width] = conv3_size([14, 14], 2).unwrap();
    assert_eq!(features.dims(), [2, height * width * 8]);
    let gradients = features.sum().backward();
    assert_eq!(layers[0].weight.grad(&gradients).unwrap().dims(), [8, 9, 3, 3]);
}

/// As with Burn's own ReLU.
#[test]
fn what_is_no_number_stays_none_and_passes_gradients_on() {
    let device = Device::flex().autodiff();
    let mut layers = layers(9, 32, 2, &mut Draws::new(0), &device);
    layers[0].bias = Tensor::full([32], f32::NAN, &device).require_grad();
    let pixels = frames([2, 14, 14, 9], &device);
    for instructions in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
        if !instructions.available() {
            continue;
        }
        let found = operation::features_with(&pixels, &layers, instructions).expect("the custom path");
        assert!(to_values(found.clone().inner()).iter().all(|value| value.is_nan()), "{instructions:?}");
        // One for each of the 4×4 places of both frames.
        let bias = layers[1].bias.grad(&found.sum().backward()).unwrap();
        assert_eq!(to_values(bias), [32.0; 32], "{instructions:?}");
    }
}

#[test]
fn sizes() {
    assert_eq!(conv3_size([84, 84], 4), Some([35, 35]));
    assert_eq!(conv3_size([64, 64], 4), Some([25, 25]));
    assert_eq!(conv3_size([6, 6], 4), None);
}

/// Milliseconds of the four layers over a batch: `cargo test -p vibes-model --lib conv3::tests::bench -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement, not a test"]
fn bench() {
    let device = Device::flex().autodiff();
    let (pixels, learned) = (frames([128, 64, 64, 9], &device), layers(9, 32, 4, &mut Draws::new(0), &device));
    let inner =
        |layer: &Conv3Layer| Conv3Layer { weight: layer.weight.clone().inner(), bias: layer.bias.clone().inner() };
    let constant: Vec<Conv3Layer> = learned.iter().map(inner).collect();
    let seen = frames([128, 64, 64, 9], &Device::flex());
    let median = |run: &dyn Fn() -> f64| {
        let mut times: Vec<f64> = (0..9).map(|_| run()).collect();
        times.sort_by(f64::total_cmp);
        times[4]
    };
    let clock = std::time::Instant::now;
    let forward = median(&|| {
        let begun = clock();
        std::hint::black_box(conv3_features(seen.clone(), &constant));
        begun.elapsed().as_secs_f64() * 1e3
    });
    let kept = median(&|| {
        let begun = clock();
        std::hint::black_box(conv3_features(pixels.clone(), &learned));
        begun.elapsed().as_secs_f64() * 1e3
    });
    let backward = median(&|| {
        let features = conv3_features(pixels.clone(), &learned).sum();
        let begun = clock();
        std::hint::black_box(features.backward());
        begun.elapsed().as_secs_f64() * 1e3
    });
    println!("forward {forward:.1} ms, forward kept {kept:.1} ms, backward {backward:.1} ms");
}
