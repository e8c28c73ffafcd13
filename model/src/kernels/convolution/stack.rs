//! All layers, forward and backward, over all frames.
//!
//! In: bytes, weights, and for the backward pass the kept activations and the features' gradient. Out: features with activations; gradients in Burn's order.
//!
//! Frames are worked on a few at a time through several layers, so that what passes between layers stays in the core's own cache.
//! Work is split over cores by frames in fixed shares, and sums are added in a fixed order: the result does not depend on how many cores there are.

use rayon::prelude::*;

use super::geometry::{Layer, Planes};
use super::{pixels, weights, winograd};
use crate::kernels::layered::{Gradients, Weights, dealt, share_of};
use crate::kernels::{instructions::Instructions, memory::Buffer};

/// Frames of one piece of forward work.
const CHUNK: usize = 64;

/// The convolutions of one image size.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    pub(super) layers: Vec<Layer>,
    pub(super) instructions: Instructions,
}

/// What one share of the backward pass reads; it starts with frame `start`.
struct Share<'a> {
    start: usize,
    bytes: &'a [u8],
    kept: &'a [Buffer],
    planes: &'a [Planes],
}

impl Stack {
    fn frame_bytes(&self) -> usize {
        self.layers[0].input[0] * self.layers[0].input[1] * pixels::COLORS
    }

    /// Frames at which a layer is most efficient: enough rows for full tiles, few enough to stay in cache.
    pub(super) fn block(&self, layer: usize) -> usize {
        let layer = &self.layers[layer];
        let [k, n] = layer.product();
        let frame = winograd::PRODUCTS * layer.tiles() * (k + n);
        (128 * 1024 / frame).max(64 / layer.tiles()).clamp(1, 64)
    }

    /// Activations of every layer, `[frames, height, width, stride]` each.
    pub(super) fn forward(&self, bytes: &[u8], given: &[Weights<'_>]) -> Vec<Buffer> {
        let frames = bytes.len() / self.frame_bytes();
        let planes = self.planes(given, false);
        let mut kept: Vec<Buffer> =
            self.layers.iter().map(|layer| Buffer::stale(frames * layer.output_len())).collect();
        let outputs = kept.iter_mut().zip(self.layers.iter().map(Layer::output_len));
        let work = dealt(bytes, self.frame_bytes(), CHUNK, outputs);
        work.into_par_iter().for_each(|(bytes, mut outputs)| {
            let frames = bytes.len() / self.frame_bytes();
            self.forward_to(self.layers.len() - 1, [0, frames], bytes, &mut outputs, &planes);
        });
        kept
    }

    /// Fills the outputs of `top` and all layers below it for the frames `[from, to]`.
    fn forward_to(
        &self,
        top: usize,
        [from, to]: [usize; 2],
        bytes: &[u8],
        outputs: &mut [&mut [f32]],
        planes: &[Planes],
    ) {
        let layer = &self.layers[top];
        let (below, output) = outputs.split_at_mut(top);
        let output = &mut output[0][..];
        if top == 0 {
            let bytes = &bytes[from * self.frame_bytes()..to * self.frame_bytes()];
            let output = &mut output[from * layer.output_len()..to * layer.output_len()];
            return pixels::forward(layer, bytes, &planes[0], output, self.instructions);
        }
        for start in (from..to).step_by(self.block(top)) {
            let end = to.min(start + self.block(top));
            self.forward_to(top - 1, [start, end], bytes, below, planes);
            let input = &below[top - 1][start * layer.input_len()..end * layer.input_len()];
            let output = &mut output[start * layer.output_len()..end * layer.output_len()];
            winograd::forward(layer, end - start, input, &planes[top], output, self.instructions);
        }
    }

    /// Gradients of all weights, from the gradient of the last activations (padded like them).
    pub(super) fn backward(
        &self,
        bytes: &[u8],
        given: &[Weights<'_>],
        kept: &[Buffer],
        gradient: &[f32],
    ) -> Vec<Gradients> {
        let frames = bytes.len() / self.frame_bytes();
        let planes = self.planes(given, true);
        let share = share_of(frames);
        let starts: Vec<usize> = (0..frames).step_by(share).collect();
        let last = self.layers.len() - 1;
        let width = self.layers[last].output_len();
        let shares: Vec<Vec<Planes>> = starts
            .into_par_iter()
            .map(|start| {
                let end = frames.min(start + share);
                let mut sums = self.sums();
                let share = Share { start, bytes, kept, planes: &planes };
                self.backward_from(last, [start, end], &share, &gradient[start * width..end * width], &mut sums);
                sums
            })
            .collect();
        let layers = self.layers.iter().enumerate();
        layers
            .map(|(index, layer)| {
                let shares: Vec<&Planes> = shares.iter().map(|share| &share[index]).collect();
                let weight = match index {
                    0 => weights::pixel_gradient(layer, &shares),
                    _ => weights::gradient(layer, &shares, self.instructions),
                };
                Gradients { weight, bias: weights::bias_gradient(layer, &shares) }
            })
            .collect()
    }

    /// Adds the gradients of `top` and all layers below it for the frames `[from, to]`; `gradient` is theirs alone.
    fn backward_from(
        &self,
        top: usize,
        [from, to]: [usize; 2],
        share: &Share<'_>,
        gradient: &[f32],
        sums: &mut [Planes],
    ) {
        let (layer, kept) = (&self.layers[top], share.kept);
        let width = layer.output_len();
        if top == 0 {
            let bytes = &share.bytes[from * self.frame_bytes()..to * self.frame_bytes()];
            let output = &kept[0][from * width..to * width];
            return pixels::backward(layer, bytes, [output, gradient], &mut sums[0], self.instructions);
        }
        let block = self.block(top).min(to - from);
        let mut below = Buffer::stale(block * layer.input_len());
        for start in (from..to).step_by(block) {
            let end = to.min(start + block);
            let input = &kept[top - 1][start * layer.input_len()..end * layer.input_len()];
            let output = &kept[top][start * width..end * width];
            let gradient = &gradient[(start - from) * width..(end - from) * width];
            let below = &mut below[..input.len()];
            let sum = (&mut sums[top], start == share.start);
            let planes = &share.planes[top];
            winograd::backward(layer, end - start, [input, output], gradient, planes, sum, below, self.instructions);
            self.backward_from(top - 1, [start, end], share, below, sums);
        }
    }

    fn planes(&self, given: &[Weights<'_>], turned: bool) -> Vec<Planes> {
        let layers = self.layers.iter().zip(given).enumerate();
        layers
            .map(|(index, (layer, Weights { weight, bias }))| match index {
                0 => weights::pixel_planes(layer, weight, bias),
                _ => weights::planes(layer, weight, bias, turned, self.instructions),
            })
            .collect()
    }

    fn sums(&self) -> Vec<Planes> {
        let layers = self.layers.iter().enumerate();
        layers
            .map(|(index, layer)| if index == 0 { weights::pixel_sums(layer) } else { weights::sums(layer) })
            .collect()
    }
}
