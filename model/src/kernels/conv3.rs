//! The features of the model-free agents' encoder: 3×3 convolutions with ReLU, the first of stride 2, the others of stride 1.
//!
//! In: `[frames, height, width, channels]` bytes, a stack of pictures side by side in the channels, and the layers' weights. Out: `[frames, features]`.

use burn::tensor::{Int, Tensor};

use super::{Conv3Layer, plain};

mod geometry;
mod operation;
mod passes;
mod stack;
#[cfg(test)]
mod tests;
mod winograd;

/// Features of stacked pictures: bytes `x/255`, then each layer's convolution (stride 2 in the first, 1 in the others) and ReLU, then flattened channels
/// last.
///
/// `pixels` is `[frames, height, width, channels]`, see [`pixel_tensor`](super::pixel_tensor); the result is `[frames, h·w·c]` in the order `[h, w, c]` of the
/// last layer. Differentiable in the weights and biases, not in the pixels. On `flex`, with 32 filters in every layer and one or three RGB pictures, it runs as
/// one operation, with a quarter of the multiplications after the first layer.
///
/// # Panics
/// If a layer's input is smaller than its kernel or the channel counts do not follow from each other.
pub fn conv3_features(pixels: Tensor<4, Int>, layers: &[Conv3Layer]) -> Tensor<2> {
    operation::features(&pixels, layers).unwrap_or_else(|| plain::conv3_features(pixels, layers))
}

/// `[height, width]` after so many layers, or `None` when the pictures are too small for them.
pub fn conv3_size(image: [usize; 2], layers: usize) -> Option<[usize; 2]> {
    let side = |size: usize| {
        (0..layers).try_fold(size, |size, layer| {
            let room = size.checked_sub(3)?;
            Some(if layer == 0 { room / 2 + 1 } else { room + 1 })
        })
    };
    Some([side(image[0])?, side(image[1])?])
}
