//! First values of the parameters, from a passed-in generator, so that the same seed gives the same model on every device.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

/// He initialisation: normal with standard deviation √(2 / fan-in), which keeps the picture's signal at the size of the action input through
/// the four convolutions; with the smaller usual uniform values the encoder starts, and stays, a function of the past actions.
pub fn he_normal<const D: usize>(
    shape: [usize; D],
    fan_in: usize,
    rng: &mut impl Rng,
    device: &Device,
) -> Param<Tensor<D>> {
    let std = (2.0 / fan_in as f32).sqrt();
    let values = normal(shape.iter().product(), rng).into_iter().map(|x| x * std).collect();
    parameter(values, shape, device)
}

/// Uniform within ±1/√size, as is usual for recurrent weights.
pub fn recurrent_uniform<const D: usize>(
    shape: [usize; D],
    size: usize,
    rng: &mut impl Rng,
    device: &Device,
) -> Param<Tensor<D>> {
    let bound = 1.0 / (size as f32).sqrt();
    let count = shape.iter().product();
    parameter((0..count).map(|_| rng.random_range(-bound..bound)).collect(), shape, device)
}

/// All values equal.
pub fn constant<const D: usize>(shape: [usize; D], value: f32, device: &Device) -> Param<Tensor<D>> {
    parameter(vec![value; shape.iter().product()], shape, device)
}

/// `count` independent standard normal numbers (Box–Muller).
pub fn normal(count: usize, rng: &mut impl Rng) -> Vec<f32> {
    let mut values = Vec::with_capacity(count + 1);
    while values.len() < count {
        // 1 − u lies in (0, 1], where the logarithm is finite.
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * rng.random::<f64>()).sin_cos();
        values.push((radius * cos) as f32);
        values.push((radius * sin) as f32);
    }
    values.truncate(count);
    values
}

fn parameter<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    Param::from_data(TensorData::new(values, shape), device)
}
