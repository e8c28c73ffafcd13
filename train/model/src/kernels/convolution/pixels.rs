//! The first layer: a 4×4 convolution of stride 2 straight from RGB bytes.
//!
//! In: bytes `[height, width, 3]`. Out: the first activations, or the gradient of the first weights. A kernel row covers twelve neighbouring numbers, so
//! the products read the image where it lies, without a copy per patch; pixels need no gradient.

use super::geometry::{Layer, Planes};
use crate::kernels::{
    instructions::Instructions,
    memory::Buffer,
    product::{Left, PANEL},
};

/// Numbers of a pixel.
pub(super) const COLORS: usize = 3;
/// Numbers of one row of the kernel.
const REACH: usize = 4 * COLORS;
/// Numbers of the kernel: the inner size of the product.
pub(super) const KERNEL: usize = 4 * REACH;
/// Numbers from one output's patch to the next.
const STRIDE: usize = 2 * COLORS;

/// `x/255 − 0.5`
fn scaled(layer: &Layer, bytes: &[u8], instructions: Instructions) -> Buffer {
    let mut scaled = Buffer::stale(bytes.len());
    debug_assert_eq!(bytes.len(), layer.input[0] * layer.input[1] * COLORS);
    instructions.run(
        #[inline(always)]
        || {
            for (scaled, byte) in scaled.iter_mut().zip(bytes) {
                *scaled = f32::from(*byte) * (1.0 / 255.0) - 0.5;
            }
        },
    );
    scaled
}

/// The layer's output for some frames: convolution, bias, ReLU.
pub(super) fn forward(
    layer: &Layer,
    bytes: &[u8],
    planes: &Planes,
    output: &mut [f32],
    instructions: Instructions,
) {
    let [high, wide] = layer.output;
    let mut summed = Buffer::stale(high * wide * PANEL);
    let frame = layer.input[0] * layer.input[1] * COLORS;
    for (bytes, output) in bytes
        .chunks_exact(frame)
        .zip(output.chunks_exact_mut(layer.output_len()))
    {
        let image = scaled(layer, bytes, instructions);
        for (panel, weights) in planes.weights.chunks_exact(KERNEL * PANEL).enumerate() {
            for (row, summed) in summed.chunks_exact_mut(wide * PANEL).enumerate() {
                let data = &image[2 * row * layer.input[1] * COLORS..];
                let left = Left::<STRIDE, 1> {
                    data,
                    outer: 4,
                    outer_step: layer.input[1] * COLORS,
                    inner: REACH,
                };
                left.times(weights, wide, summed, false, instructions);
            }
            finish(layer, panel, &summed, &planes.bias, output, instructions);
        }
    }
}

/// Bias and ReLU of one panel of channels.
fn finish(
    layer: &Layer,
    panel: usize,
    summed: &[f32],
    bias: &[f32],
    output: &mut [f32],
    instructions: Instructions,
) {
    let (start, stride) = (panel * PANEL, layer.output_stride());
    let count = PANEL.min(stride - start);
    let bias = &bias[start..start + count];
    instructions.run(
        #[inline(always)]
        || {
            for (summed, output) in summed
                .chunks_exact(PANEL)
                .zip(output.chunks_exact_mut(stride))
            {
                for ((output, summed), bias) in output[start..start + count]
                    .iter_mut()
                    .zip(summed)
                    .zip(bias)
                {
                    *output = (summed + bias).max(0.0);
                }
            }
        },
    );
}

/// Adds the gradients of weights and bias for some frames, from the gradient of the output (after ReLU).
pub(super) fn backward(
    layer: &Layer,
    bytes: &[u8],
    output: &[f32],
    output_gradient: &[f32],
    sums: &mut Planes,
    instructions: Instructions,
) {
    let [high, wide] = layer.output;
    let mut open = Buffer::stale(high * wide * PANEL);
    let frame = layer.input[0] * layer.input[1] * COLORS;
    let activations = output
        .chunks_exact(layer.output_len())
        .zip(output_gradient.chunks_exact(layer.output_len()));
    for (bytes, (output, gradient)) in bytes.chunks_exact(frame).zip(activations) {
        let image = scaled(layer, bytes, instructions);
        for (panel, weights) in sums.weights.chunks_exact_mut(KERNEL * PANEL).enumerate() {
            mask(
                layer,
                panel,
                output,
                gradient,
                &mut open,
                &mut sums.bias,
                instructions,
            );
            for (row, weights) in weights.chunks_exact_mut(REACH * PANEL).enumerate() {
                let data = &image[row * layer.input[1] * COLORS..];
                let left = Left::<1, STRIDE> {
                    data,
                    outer: high,
                    outer_step: 2 * layer.input[1] * COLORS,
                    inner: wide,
                };
                left.times(&open, REACH, weights, true, instructions);
            }
        }
    }
}

/// One panel of the gradient where ReLU was open, and the bias's share.
fn mask(
    layer: &Layer,
    panel: usize,
    output: &[f32],
    gradient: &[f32],
    open: &mut [f32],
    bias: &mut [f32],
    instructions: Instructions,
) {
    let (start, stride) = (panel * PANEL, layer.output_stride());
    let count = PANEL.min(stride - start);
    let bias = &mut bias[start..start + count];
    instructions.run(
        #[inline(always)]
        || {
            let positions = output
                .chunks_exact(stride)
                .zip(gradient.chunks_exact(stride));
            for (open, (output, gradient)) in open.chunks_exact_mut(PANEL).zip(positions) {
                open[count..].fill(0.0);
                let channels = output[start..start + count]
                    .iter()
                    .zip(&gradient[start..start + count]);
                for ((open, bias), (output, gradient)) in
                    open.iter_mut().zip(bias.iter_mut()).zip(channels)
                {
                    *open = if *output > 0.0 { *gradient } else { 0.0 };
                    *bias += *open;
                }
            }
        },
    );
}
