//! Convolutional features: 4×4 convolutions of stride 2 with ReLU over pixels.
//!
//! In: `[frames, height, width, 3]` pixels and the layers' weights. Out: `[frames, features]`.

use burn::tensor::{DType, Device, Int, Tensor, TensorData};

use super::flex::runs_on_flex;
use super::{ConvLayer, plain};

mod geometry;
mod operation;
mod pixels;
mod stack;
#[cfg(test)]
mod tests;
mod weights;
mod winograd;

/// Pixels as the tensor [`features`] takes: `[frames, height, width, 3]`, bytes where the device can hold them.
///
/// # Panics
/// If `pixels` does not hold exactly `shape`'s number of bytes.
pub fn pixel_tensor(pixels: Vec<u8>, shape: [usize; 4], device: &Device) -> Tensor<4, Int> {
    let data = TensorData::new(pixels, shape);
    if runs_on_flex(device) { Tensor::from_data(data, (device, DType::U8)) } else { Tensor::from_data(data, device) }
}

/// Features of frames: pixels `x/255 − 0.5`, then each layer's convolution and ReLU, then flattened channels last.
///
/// `pixels` is `[frames, height, width, channels]`, see [`pixel_tensor`]; the result is `[frames, h·w·c]` in the order
/// `[h, w, c]` of the last layer. Differentiable in the weights and biases, not in the pixels. On `flex`, with RGB bytes and
/// up to six layers, it runs as one operation with 9/16 of the multiplications; it is fastest when channel counts are multiples of 32.
///
/// # Panics
/// If a layer's input is smaller than its 4×4 kernel or the channel counts do not follow from each other.
pub fn features(pixels: Tensor<4, Int>, layers: &[ConvLayer]) -> Tensor<2> {
    operation::features(&pixels, layers).unwrap_or_else(|| plain::features(pixels, layers))
}

/// Width of [`features`]' result for `[height, width]` images, or `None` when the images are too small for that many layers.
pub fn feature_count(image: [usize; 2], layers: usize, last_channels: usize) -> Option<usize> {
    let side = |size: usize| (0..layers).try_fold(size, |size, _| Some(size.checked_sub(4)? / 2 + 1));
    Some(side(image[0])? * side(image[1])? * last_channels)
}
