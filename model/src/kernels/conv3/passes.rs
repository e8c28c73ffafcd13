//! The first layer of one frame, of stride 2, forward and backward, as products that read the input where it lies: three neighbouring positions of a channels-last map
//! are one stretch of memory, so a kernel row needs no copy. And what all layers need around their products.
//!
//! In: an input `[height, width, channels]`, weights in the kernels' order. Out: the output `[height, width, 32]`, or gradients. `REACH` is the stride times the
//! channels.

use super::geometry::{FILTERS, Layer};
use crate::kernels::instructions::Instructions;
use crate::kernels::lanes::{relu, relu_backward};
use crate::kernels::product::Left;

/// Rows of the output's gradient worked on at once: what fits into the first-level cache.
const ROWS: usize = 8;
/// Rows of a product that are made together; an output row is split evenly into pieces of at most so many.
const PIECE: usize = 12;
/// Stride.
const STRIDE: usize = 2;

/// Bytes as numbers `x/255`.
pub(super) fn scale(bytes: &[u8], scaled: &mut [f32], instructions: Instructions) {
    instructions.run(
        #[inline(always)]
        || {
            for (scaled, byte) in scaled.iter_mut().zip(bytes) {
                *scaled = f32::from(*byte) * (1.0 / 255.0);
            }
        },
    );
}

/// The output of the layer: convolution, bias, ReLU.
pub(super) fn forward<const REACH: usize>(
    layer: &Layer,
    input: &[f32],
    panel: &[f32],
    bias: &[f32],
    output: &mut [f32],
    instructions: Instructions,
) {
    let line = layer.input[1] * layer.channels;
    for (row, output) in output.chunks_exact_mut(layer.output[1] * FILTERS).enumerate() {
        let data = &input[STRIDE * row * line..];
        let left = Left::<REACH, 1>::lines(data, 3, line, layer.reach());
        products(&left, panel, output, instructions);
        instructions.run(
            #[inline(always)]
            || {
                for position in output.chunks_exact_mut(FILTERS) {
                    for (value, bias) in position.iter_mut().zip(bias) {
                        *value = relu(*value + bias);
                    }
                }
            },
        );
    }
}

/// `left · right` for all positions of `output`, in pieces of nearly equal size.
fn products<const ROW: usize>(left: &Left<'_, ROW, 1>, right: &[f32], output: &mut [f32], instructions: Instructions) {
    let positions = output.len() / FILTERS;
    let pieces = positions.div_ceil(PIECE);
    let mut start = 0;
    for piece in 0..pieces {
        let end = positions * (piece + 1) / pieces;
        left.rows_from(start).times(
            right,
            end - start,
            &mut output[start * FILTERS..end * FILTERS],
            false,
            instructions,
        );
        start = end;
    }
}

/// The gradient of an output where ReLU was open, in place; adds the bias's share.
pub(super) fn mask(output: &[f32], gradient: &mut [f32], bias: &mut [f32], instructions: Instructions) {
    instructions.run(
        #[inline(always)]
        || {
            for (gradient, output) in gradient.chunks_exact_mut(FILTERS).zip(output.chunks_exact(FILTERS)) {
                for ((gradient, output), bias) in gradient.iter_mut().zip(output).zip(bias.iter_mut()) {
                    *gradient = relu_backward(*output, *gradient);
                    *bias += *gradient;
                }
            }
        },
    );
}

/// Adds the gradient of the layer's weights.
pub(super) fn weights<const REACH: usize>(
    layer: &Layer,
    input: &[f32],
    gradient: &[f32],
    sums: &mut [f32],
    instructions: Instructions,
) {
    let line = layer.input[1] * layer.channels;
    let wide = layer.output[1];
    for (index, gradient) in gradient.chunks(ROWS * wide * FILTERS).enumerate() {
        let outer = gradient.len() / (wide * FILTERS);
        for (row, sums) in sums.chunks_exact_mut(layer.reach() * FILTERS).enumerate() {
            let data = &input[(STRIDE * ROWS * index + row) * line..];
            let left = Left::<1, REACH>::lines(data, outer, STRIDE * line, wide);
            left.times(gradient, layer.reach(), sums, true, instructions);
        }
    }
}

/// A gradient `[height, width, 32]` with a border of two zeros on every side; `bordered` is `[height + 4, width + 4, 32]`, its border zeros already.
pub(super) fn border(gradient: &[f32], width: usize, bordered: &mut [f32]) {
    let line = (width + 4) * FILTERS;
    for (row, gradient) in gradient.chunks_exact(width * FILTERS).enumerate() {
        bordered[(row + 2) * line + 2 * FILTERS..][..gradient.len()].copy_from_slice(gradient);
    }
}
