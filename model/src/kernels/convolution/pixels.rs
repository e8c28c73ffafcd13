//! The first layer: a 4×4 convolution of stride 2 straight from RGB bytes.
//!
//! In: bytes `[height, width, 3]`. Out: the first activations, or the gradient of the first weights. A kernel row covers twelve neighbouring numbers, so
//! the products read the image where it lies, without a copy per patch; pixels need no gradient.

use super::geometry::{Layer, Planes};
use crate::kernels::{
    instructions::Instructions,
    lanes::{LANES, Lanes, with_lanes},
    memory::Buffer,
    product::{Left, PANEL},
};

/// Numbers of a pixel.
pub(super) const COLORS: usize = 3;
/// Numbers of one row of the kernel.
const REACH: usize = 4 * COLORS;
/// Numbers of the kernel: the inner size of the product.
pub(super) const KERNEL: usize = 4 * REACH;
/// Rows of the output's gradient worked on at once: what fits into the first-level cache.
const ROWS: usize = 6;
/// Numbers from one output's patch to the next.
const STRIDE: usize = 2 * COLORS;

/// `x/255 − 0.5`
fn scaled(layer: &Layer, bytes: &[u8], instructions: Instructions) -> Buffer {
    let mut scaled = Buffer::stale(bytes.len());
    assert_eq!(bytes.len(), layer.input[0] * layer.input[1] * COLORS);
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
pub(super) fn forward(layer: &Layer, bytes: &[u8], planes: &Planes, output: &mut [f32], instructions: Instructions) {
    let (wide, line) = (layer.output[1], layer.input[1] * COLORS);
    let mut summed = Buffer::stale(wide * PANEL);
    let frames = bytes.chunks_exact(layer.input[0] * line).zip(output.chunks_exact_mut(layer.output_len()));
    for (bytes, output) in frames {
        let image = scaled(layer, bytes, instructions);
        for (row, output) in output.chunks_exact_mut(wide * layer.output_stride()).enumerate() {
            let data = &image[2 * row * line..];
            let left = Left::<STRIDE, 1>::lines(data, 4, line, REACH);
            for (panel, weights) in planes.weights.chunks_exact(KERNEL * PANEL).enumerate() {
                left.times_columns(layer.out_channels - panel * PANEL, weights, wide, &mut summed, false, instructions);
                with_lanes!(instructions, finish(layer, panel, &summed, &planes.bias, output));
            }
        }
    }
}

/// Bias and ReLU of one panel of channels.
#[inline(always)]
fn finish<V: Lanes>(proof: V::Proof, layer: &Layer, panel: usize, summed: &[f32], bias: &[f32], output: &mut [f32]) {
    let (start, stride) = (panel * PANEL, layer.output_stride());
    for part in (start..stride.min(start + PANEL)).step_by(LANES) {
        let bias = V::at(proof, bias, part);
        for (summed, output) in summed.chunks_exact(PANEL).zip(output.chunks_exact_mut(stride)) {
            V::at(proof, summed, part - start).plus(bias).positive().put(output, part);
        }
    }
}

/// Adds the gradients of weights and bias for some frames, from the gradient of the output (after ReLU).
pub(super) fn backward(
    layer: &Layer,
    bytes: &[u8],
    [output, output_gradient]: [&[f32]; 2],
    sums: &mut Planes,
    instructions: Instructions,
) {
    let (wide, line) = (layer.output[1], layer.input[1] * COLORS);
    let mut open = Buffer::stale(ROWS * wide * PANEL);
    let activations = output.chunks_exact(layer.output_len()).zip(output_gradient.chunks_exact(layer.output_len()));
    for (bytes, (output, gradient)) in bytes.chunks_exact(layer.input[0] * line).zip(activations) {
        let image = scaled(layer, bytes, instructions);
        let rows = ROWS * wide * layer.output_stride();
        for (index, (output, gradient)) in output.chunks(rows).zip(gradient.chunks(rows)).enumerate() {
            let high = output.len() / (wide * layer.output_stride());
            for (panel, weights) in sums.weights.chunks_exact_mut(KERNEL * PANEL).enumerate() {
                with_lanes!(instructions, mask(layer, panel, [output, gradient], &mut open, &mut sums.bias));
                for (row, weights) in weights.chunks_exact_mut(REACH * PANEL).enumerate() {
                    let data = &image[(2 * ROWS * index + row) * line..];
                    let left = Left::<1, STRIDE>::lines(data, high, 2 * line, wide);
                    left.times_columns(layer.out_channels - panel * PANEL, &open, REACH, weights, true, instructions);
                }
            }
        }
    }
}

/// One panel of the gradient where ReLU was open, and the bias's share.
#[inline(always)]
fn mask<V: Lanes>(
    proof: V::Proof,
    layer: &Layer,
    panel: usize,
    [output, gradient]: [&[f32]; 2],
    open: &mut [f32],
    bias: &mut [f32],
) {
    let (start, stride) = (panel * PANEL, layer.output_stride());
    for part in (start..stride.min(start + PANEL)).step_by(LANES) {
        let mut sum = V::at(proof, bias, part);
        let positions = output.chunks_exact(stride).zip(gradient.chunks_exact(stride));
        for (open, (output, gradient)) in open.chunks_exact_mut(PANEL).zip(positions) {
            let value = V::at(proof, gradient, part).where_open(V::at(proof, output, part));
            sum = sum.plus(value);
            value.put(open, part - start);
        }
        sum.put(bias, part);
    }
}
