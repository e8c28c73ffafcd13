//! What stacks of convolutions share, whatever their kernels: weights and gradients layer by layer, and how work is dealt out.
//!
//! Work is split over cores by frames in fixed shares, so that a result does not depend on how many cores there are.

use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::flex;
use super::memory::Buffer;
use super::operation::Operand;

/// Frames of one share of a backward pass over so many; each share has its own sums of weight gradients, which are added up at the end. There are at least two shares, for two cores, and
/// at most eight; with 32 frames in one the sums are worth their additions. It depends on the frames alone, never on the cores.
pub(super) fn share_of(frames: usize) -> usize {
    frames.div_ceil(frames.div_ceil(32).clamp(2, 8)).max(1)
}

/// One layer's weight, `[out, in, rows, columns]` in Burn's order, and bias.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights<'a> {
    pub(super) weight: &'a [f32],
    pub(super) bias: &'a [f32],
}

/// Gradients of one layer, in the order of [`Weights`].
#[derive(Debug)]
pub(super) struct Gradients {
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

/// Weight and bias of each layer in turn; nothing where one of them does not live on `flex`.
pub(super) fn operands<'a>(layers: impl Iterator<Item = (&'a Tensor<4>, &'a Tensor<1>)>) -> Option<Vec<Operand>> {
    layers.flat_map(|(weight, bias)| [Operand::of(weight.clone()), Operand::of(bias.clone())]).collect()
}

/// Weights and biases in turn, as pairs.
pub(super) fn pairs(tensors: &[FlexTensor]) -> Vec<Weights<'_>> {
    tensors
        .chunks_exact(2)
        .map(|pair| Weights { weight: flex::numbers(&pair[0]), bias: flex::numbers(&pair[1]) })
        .collect()
}

/// Gradients in the order of the tensors.
///
/// # Panics
/// If there are not as many layers as pairs of tensors.
pub(super) fn in_turn<const N: usize>(found: Vec<Gradients>) -> [Vec<f32>; N] {
    let all: Vec<Vec<f32>> = found.into_iter().flat_map(|layer| [layer.weight, layer.bias]).collect();
    all.try_into().expect("a gradient of every weight and bias")
}

/// Frames in shares of `chunk`, each with the place of its outputs in every layer. `kept` are the layers' outputs, with the numbers of one frame's.
pub(super) fn dealt<'a>(
    bytes: &'a [u8],
    frame_bytes: usize,
    chunk: usize,
    kept: impl Iterator<Item = (&'a mut Buffer, usize)>,
) -> Vec<(&'a [u8], Vec<&'a mut [f32]>)> {
    let mut work: Vec<_> = bytes.chunks(chunk * frame_bytes).map(|bytes| (bytes, Vec::new())).collect();
    for (kept, len) in kept {
        for ((_, outputs), kept) in work.iter_mut().zip(kept.chunks_mut(chunk * len)) {
            outputs.push(kept);
        }
    }
    work
}
