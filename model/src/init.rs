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

/// A matrix `gain · Q` with orthonormal rows or columns, whichever are fewer: normal numbers through Gram–Schmidt. What the model-free agents' linear layers begin
/// with.
pub fn orthogonal([input, output]: [usize; 2], gain: f32, rng: &mut impl Rng, device: &Device) -> Param<Tensor<2>> {
    parameter(orthogonal_values([input, output], gain, rng), [input, output], device)
}

/// A convolution `[output, input, size, size]` that begins as an orthogonal matrix at the kernel's middle and zeros around it ("delta-orthogonal").
pub fn delta_orthogonal(
    [output, input]: [usize; 2],
    size: usize,
    gain: f32,
    rng: &mut impl Rng,
    device: &Device,
) -> Param<Tensor<4>> {
    let taps = size * size;
    let mut values = vec![0.0; output * input * taps];
    for (kernel, value) in values.chunks_exact_mut(taps).zip(orthogonal_values([output, input], gain, rng)) {
        kernel[taps / 2] = value;
    }
    parameter(values, [output, input, size, size], device)
}

fn orthogonal_values([rows, columns]: [usize; 2], gain: f32, rng: &mut impl Rng) -> Vec<f32> {
    let (count, length) = (rows.min(columns), rows.max(columns));
    let mut basis: Vec<Vec<f32>> = Vec::with_capacity(count);
    for _ in 0..count {
        let mut vector = normal(length, rng);
        // Twice: once leaves rounding errors of the size of what was taken away.
        for _ in 0..2 {
            for other in &basis {
                let along = dot(&vector, other);
                vector.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
            }
        }
        let norm = dot(&vector, &vector).sqrt().max(f32::MIN_POSITIVE);
        vector.iter_mut().for_each(|value| *value /= norm);
        basis.push(vector);
    }
    let value = |at: usize| {
        let (row, column) = (at / columns, at % columns);
        gain * if rows <= columns { basis[row][column] } else { basis[column][row] }
    };
    (0..rows * columns).map(value).collect()
}

/// In sixteen running sums, which the compiler makes vectors of.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; 16];
    let (a_chunks, b_chunks) = (a.chunks_exact(16), b.chunks_exact(16));
    let rest: f32 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::parameters::to_values;

    #[test]
    fn fewer_rows_or_columns_are_orthonormal() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for shape in [[40, 7], [7, 40], [33, 33]] {
            let matrix = orthogonal(shape, 2.0, &mut rng, &Device::flex()).val();
            let matrix = if shape[0] <= shape[1] { matrix } else { matrix.transpose() };
            let count = matrix.dims()[0];
            let products = to_values(matrix.clone().matmul(matrix.transpose()));
            for (at, product) in products.iter().enumerate() {
                let wanted = if at / count == at % count { 4.0 } else { 0.0 };
                assert!((product - wanted).abs() < 1e-5, "{shape:?} {at}: {product}");
            }
        }
        let kernel = to_values(delta_orthogonal([4, 3], 3, 1.0, &mut rng, &Device::flex()).val());
        assert!(kernel.iter().enumerate().all(|(at, value)| (at % 9 == 4) == (*value != 0.0)));
    }
}
