//! Squared error of drawn pictures against pixels, for the reconstruction's likelihood.
//!
//! In: pictures `[frames, height, width, channels]` scaled to −0.5..0.5, and pixels of the same shape (see [`pixel_tensor`](super::pixel_tensor())). Out: the sum of
//! squared differences of every frame, `[frames]`. Differentiable in the pictures. On `flex` it reads both once, where ordinary operations write and read
//! several copies of them.

use burn::tensor::{Int, Tensor};
use burn_flex::FlexTensor;
use rayon::prelude::*;

use super::operation::{Operand, Operation, run};
use super::{flex, plain};

/// Sums of squared differences, one a frame: `[frames]`.
///
/// # Panics
/// If the shapes differ.
pub fn pixel_error(pictures: Tensor<4>, pixels: Tensor<4, Int>) -> Tensor<1> {
    assert_eq!(pictures.dims(), pixels.dims(), "pictures and pixels");
    operation(&pictures, &pixels).unwrap_or_else(|| plain::pixel_error(pictures, pixels))
}

fn operation(pictures: &Tensor<4>, pixels: &Tensor<4, Int>) -> Option<Tensor<1>> {
    let [frames, ..] = pictures.dims();
    if frames == 0 || !flex::runs_on_flex(&pixels.device()) {
        return None;
    }
    let bytes = flex::bytes(pixels)?;
    run(PixelError { frames, bytes }, [Operand::of(pictures.clone())?])
}

/// A byte as the pictures have it.
fn scaled(byte: u8) -> f32 {
    f32::from(byte) / 255.0 - 0.5
}

/// The true pictures.
#[derive(Clone, Debug)]
struct PixelError {
    frames: usize,
    bytes: FlexTensor,
}

impl PixelError {
    fn bytes(&self) -> &[u8] {
        self.bytes.as_slice().expect("bytes in one piece")
    }
}

impl Operation<1> for PixelError {
    type Kept = ();

    fn forward(&self, [pictures]: &[FlexTensor; 1], _keep: bool) -> Option<(FlexTensor, ())> {
        let (pictures, bytes, frames) = (flex::numbers(pictures), self.bytes(), self.frames);
        let pairs = pictures.par_chunks(pictures.len() / frames).zip(bytes.par_chunks(bytes.len() / frames));
        let error = |(picture, bytes): (&[f32], &[u8])| {
            // Sixteen sums beside each other, so that the compiler makes vectors of them.
            let mut sums = [0.0_f32; 16];
            for (picture, bytes) in picture.chunks(16).zip(bytes.chunks(16)) {
                for (sum, (value, byte)) in sums.iter_mut().zip(picture.iter().zip(bytes)) {
                    let difference = value - scaled(*byte);
                    *sum += difference * difference;
                }
            }
            sums.iter().sum::<f32>()
        };
        Some((flex::tensor(pairs.map(error).collect(), [frames]), ()))
    }

    fn backward(&self, [pictures]: &[FlexTensor; 1], (): &(), slopes: &[f32], _: [bool; 1]) -> [Vec<f32>; 1] {
        let (values, bytes) = (flex::numbers(pictures), self.bytes());
        let mut found = vec![0.0; values.len()];
        let width = values.len() / slopes.len();
        let frames = found.par_chunks_mut(width).zip(values.par_chunks(width).zip(bytes.par_chunks(width)));
        frames.zip(slopes).for_each(|((found, (picture, bytes)), slope)| {
            for (found, (value, byte)) in found.iter_mut().zip(picture.iter().zip(bytes)) {
                *found = 2.0 * slope * (value - scaled(*byte));
            }
        });
        [found]
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::kernels::pixel_tensor;
    use crate::parameters::to_values;

    #[test]
    fn agrees_with_ordinary_operations() {
        let device = Device::flex().autodiff();
        let shape = [3, 5, 4, 3];
        let values: Vec<f32> = (0..180).map(|i| (i as f32 * 0.37).sin()).collect();
        let pictures = Tensor::<4>::from_data(TensorData::new(values, shape), &device).require_grad();
        let pixels = pixel_tensor((0..180).map(|i| (i * 7 % 256) as u8).collect(), shape, &device);
        let slopes = Tensor::<1>::from_data([1.0_f32, -0.5, 2.0], &device);
        let [found, wanted] =
            [operation(&pictures, &pixels).expect("flex"), plain::pixel_error(pictures.clone(), pixels)].map(
                |errors| {
                    let gradients = (errors.clone() * slopes.clone()).sum().backward();
                    (to_values(errors), to_values(pictures.grad(&gradients).expect("a gradient")))
                },
            );
        let close = |a: &[f32], b: &[f32]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(&found.0, &wanted.0), "{:?} {:?}", found.0, wanted.0);
        assert!(close(&found.1, &wanted.1));
    }
}
