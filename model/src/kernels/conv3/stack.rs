//! All layers, forward and backward, frame by frame: what passes between layers stays in the core's own cache.
//!
//! In: bytes, weights, and for the backward pass the kept activations and the features' gradient. Out: activations; gradients in Burn's order. Work is split over
//! cores by frames in fixed shares, and sums are added in a fixed order: the result does not depend on how many cores there are.

use rayon::prelude::*;

use super::geometry::{FILTERS, Layer};
use super::winograd::{Finish, Map, Room};
use super::{passes, winograd};
use crate::kernels::layered::{Gradients, Weights, dealt, share_of};
use crate::kernels::{instructions::Instructions, memory::Buffer};

/// Frames of one piece of forward work.
const CHUNK: usize = 8;
/// The first layer's stride of two times the channels of one RGB picture.
const ONE: usize = 2 * 3;
/// The same for three RGB pictures.
const THREE: usize = 2 * 9;

/// The convolutions of one picture size.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    pub(super) layers: Vec<Layer>,
    pub(super) instructions: Instructions,
}

/// A share's sums of gradients for one layer, in the kernels' order.
struct Sums {
    weight: Buffer,
    bias: Vec<f32>,
}

/// What every share of the backward pass reads.
struct Kept<'a> {
    bytes: &'a [u8],
    activations: &'a [Buffer],
    gradient: &'a [f32],
    turned: &'a [Buffer],
}

impl Stack {
    fn frame_bytes(&self) -> usize {
        self.layers[0].input_len()
    }

    fn last(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }

    /// Activations of the layers, `[frames, height, width, 32]` each: of all of them if the backward pass will want them, else of the last alone.
    pub(super) fn forward(&self, bytes: &[u8], given: &[Weights<'_>], keep: bool) -> Vec<Buffer> {
        let frames = bytes.len() / self.frame_bytes();
        let prepared = |(index, (layer, given)): (usize, (&Layer, &Weights<'_>))| match index {
            0 => layer.panel(given.weight),
            _ => winograd::transformed(given.weight, false),
        };
        let panels: Vec<Buffer> = self.layers.iter().zip(given).enumerate().map(prepared).collect();
        let kept_layers = if keep { &self.layers[..] } else { &self.layers[self.layers.len() - 1..] };
        let mut kept: Vec<Buffer> =
            kept_layers.iter().map(|layer| Buffer::stale(frames * layer.output_len())).collect();
        let outputs = kept.iter_mut().zip(kept_layers.iter().map(Layer::output_len));
        let work = dealt(bytes, self.frame_bytes(), CHUNK, outputs);
        work.into_par_iter().for_each(|(bytes, outputs)| self.forward_chunk(bytes, given, &panels, outputs));
        kept
    }

    fn forward_chunk(&self, bytes: &[u8], given: &[Weights<'_>], panels: &[Buffer], mut outputs: Vec<&mut [f32]>) {
        let mut image = Buffer::stale(self.frame_bytes());
        let mut room = Room::new(self.layers[0].input[1]);
        let dropped = self.layers.len() - outputs.len();
        let mut scratch: Vec<Buffer> =
            self.layers[..dropped].iter().map(|layer| Buffer::stale(layer.output_len())).collect();
        for (frame, bytes) in bytes.chunks_exact(self.frame_bytes()).enumerate() {
            passes::scale(bytes, &mut image, self.instructions);
            let mut maps: Vec<&mut [f32]> = scratch.iter_mut().map(|buffer| &mut buffer[..]).collect();
            for (layer, output) in self.layers[dropped..].iter().zip(&mut outputs) {
                maps.push(&mut output[frame * layer.output_len()..(frame + 1) * layer.output_len()]);
            }
            for (index, layer) in self.layers.iter().enumerate() {
                let (below, above) = maps.split_at_mut(index);
                let (panel, bias, output) = (&panels[index], given[index].bias, &mut *above[0]);
                match below.last() {
                    None => self.forward_first(&image, panel, bias, output),
                    Some(input) => {
                        let input = Map { size: layer.input, numbers: input };
                        winograd::convolve(input, panel, Finish::Relu(bias), output, &mut room, self.instructions);
                    }
                }
            }
        }
    }

    fn forward_first(&self, image: &[f32], panel: &[f32], bias: &[f32], output: &mut [f32]) {
        let layer = &self.layers[0];
        let run = if layer.channels == 3 { passes::forward::<ONE> } else { passes::forward::<THREE> };
        run(layer, image, panel, bias, output, self.instructions);
    }

    /// Gradients of all weights, from the gradient of the last activations.
    pub(super) fn backward(
        &self,
        bytes: &[u8],
        given: &[Weights<'_>],
        activations: &[Buffer],
        gradient: &[f32],
    ) -> Vec<Gradients> {
        let frames = bytes.len() / self.frame_bytes();
        let turned: Vec<Buffer> = given.iter().skip(1).map(|given| winograd::transformed(given.weight, true)).collect();
        let kept = Kept { bytes, activations, gradient, turned: &turned };
        let share = share_of(frames);
        let starts: Vec<usize> = (0..frames).step_by(share).collect();
        let shares: Vec<Vec<Sums>> =
            starts.into_par_iter().map(|start| self.share(&kept, start..frames.min(start + share))).collect();
        let layers = self.layers.iter().enumerate();
        layers
            .map(|(index, layer)| {
                let weights: Vec<&Buffer> = shares.iter().map(|share| &share[index].weight).collect();
                let bias =
                    (0..FILTERS).map(|filter| shares.iter().map(|share| share[index].bias[filter]).sum()).collect();
                let weight = if index == 0 { layer.gradient(&weights) } else { winograd::gradient(&weights) };
                Gradients { weight, bias }
            })
            .collect()
    }

    /// The sums of some frames.
    fn share(&self, kept: &Kept<'_>, frames: std::ops::Range<usize>) -> Vec<Sums> {
        let sums = |(index, layer): (usize, &Layer)| Sums {
            weight: Buffer::zeros(if index == 0 { 3 * layer.reach() * FILTERS } else { winograd::WEIGHTS }),
            bias: vec![0.0; FILTERS],
        };
        let mut sums: Vec<Sums> = self.layers.iter().enumerate().map(sums).collect();
        let mut room = Room::new(self.layers[0].input[1]);
        let mut image = Buffer::stale(self.frame_bytes());
        let mut gradients: Vec<Buffer> = self.layers.iter().map(|layer| Buffer::stale(layer.output_len())).collect();
        let bordered = |layer: &Layer| Buffer::zeros((layer.output[0] + 4) * (layer.output[1] + 4) * FILTERS);
        let mut bordered: Vec<Buffer> = self.layers.iter().skip(1).map(bordered).collect();
        for frame in frames {
            let of = |width: usize| frame * width..(frame + 1) * width;
            passes::scale(&kept.bytes[of(self.frame_bytes())], &mut image, self.instructions);
            let last = self.layers.len() - 1;
            gradients[last].copy_from_slice(&kept.gradient[of(self.last().output_len())]);
            for index in (0..=last).rev() {
                let layer = &self.layers[index];
                let (below, above) = gradients.split_at_mut(index);
                let gradient = &mut above[0];
                let output = &kept.activations[index][of(layer.output_len())];
                passes::mask(output, gradient, &mut sums[index].bias, self.instructions);
                let sum = &mut sums[index].weight;
                let Some(found) = below.last_mut() else {
                    self.first_sums(&image, gradient, sum);
                    continue;
                };
                let below = &kept.activations[index - 1][of(self.layers[index - 1].output_len())];
                let input = Map { size: layer.input, numbers: below };
                winograd::weight_products(input, gradient, sum, &mut room, self.instructions);
                let bordered = &mut bordered[index - 1];
                passes::border(gradient, layer.output[1], bordered);
                let gradient = Map { size: layer.output.map(|size| size + 4), numbers: bordered };
                winograd::convolve(
                    gradient,
                    &kept.turned[index - 1],
                    Finish::Plain,
                    found,
                    &mut room,
                    self.instructions,
                );
            }
        }
        sums
    }

    fn first_sums(&self, image: &[f32], gradient: &[f32], sums: &mut [f32]) {
        let layer = &self.layers[0];
        let run = if layer.channels == 3 { passes::weights::<ONE> } else { passes::weights::<THREE> };
        run(layer, image, gradient, sums, self.instructions);
    }
}
