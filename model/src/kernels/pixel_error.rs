//! Squared error of drawn pictures against pixels, for the reconstruction's likelihood.
//!
//! In: pictures `[frames, height, width, channels]` scaled to −0.5..0.5, and pixels of the same shape (see [`pixel_tensor`](super::pixel_tensor())). Out: the sum of
//! squared differences of every frame, `[frames]`. Differentiable in the pictures. On `flex` it reads both once, where ordinary operations write and read
//! several copies of them.

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::{Int, Tensor};
use burn_flex::FlexTensor;
use rayon::prelude::*;

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
    if !pictures.device().is_autodiff() {
        let pictures = flex::unfollowed(pictures.clone())?;
        return Some(Tensor::from_primitive::<Flex>(forward(&pictures, &bytes, frames)));
    }
    let pictures = flex::followed(pictures.clone())?;
    let node = pictures.node();
    let pictures = pictures.into_primitive().to_contiguous();
    let errors = forward(&pictures, &bytes, frames);
    Some(Tensor::from_primitive::<Autodiff<Flex>>(
        match PixelError.prepare::<NoCheckpointing>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((pictures, bytes), errors),
            OpsKind::UnTracked(prepared) => prepared.finish(errors),
        },
    ))
}

/// A byte as the pictures have it.
fn scaled(byte: u8) -> f32 {
    f32::from(byte) / 255.0 - 0.5
}

fn pixels_of(bytes: &FlexTensor) -> &[u8] {
    bytes.as_slice().expect("bytes in one piece")
}

fn forward(pictures: &FlexTensor, bytes: &FlexTensor, frames: usize) -> FlexTensor {
    let (pictures, bytes) = (flex::numbers(pictures), pixels_of(bytes));
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
    flex::tensor(pairs.map(error).collect(), [frames])
}

/// The backward step.
#[derive(Debug)]
struct PixelError;

impl Backward<Flex, 1> for PixelError {
    type State = (FlexTensor, FlexTensor);

    fn backward(self, ops: Ops<Self::State, 1>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let (pictures, bytes) = ops.state;
        let slopes = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let (slopes, values, bytes) = (flex::numbers(&slopes), flex::numbers(&pictures), pixels_of(&bytes));
        let mut found = vec![0.0; values.len()];
        let width = values.len() / slopes.len();
        let frames = found.par_chunks_mut(width).zip(values.par_chunks(width).zip(bytes.par_chunks(width)));
        frames.zip(slopes).for_each(|((found, (picture, bytes)), slope)| {
            for (found, (value, byte)) in found.iter_mut().zip(picture.iter().zip(bytes)) {
                *found = 2.0 * slope * (value - scaled(*byte));
            }
        });
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        flex::register(gradients, parents, &[pictures], [found]);
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
