//! The arithmetic: every position of the input times all sixteen taps is one product of matrices, whose rows are then added where they fall.
//!
//! In: `[frames, height, width, in]` maps and a layer's numbers. Out: the larger maps; for the backward pass the gradients of maps, weight and bias.
//!
//! Work is split over cores by frames in fixed shares, and sums are added in a fixed order: the result does not depend on how many cores there are.

use rayon::prelude::*;

use super::layout::{SIDE, Sizes};
use crate::kernels::lanes::{relu, relu_backward};
use crate::kernels::memory::Buffer;
use crate::kernels::product::{Left, PANEL};

/// Shares of the frames, each with its own sums of weight gradients.
const SHARES: usize = 8;

/// Gradients of one layer: of the maps and, in Burn's order, of weight and bias.
#[derive(Debug)]
pub(super) struct Gradients {
    pub(super) maps: Vec<f32>,
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

impl Sizes {
    /// The larger maps.
    pub(super) fn forward(&self, maps: &[f32], weight: &[f32], bias: &[f32]) -> Vec<f32> {
        let weight = self.panels(weight);
        let mut output = vec![0.0; self.frames * self.output_len()];
        let block = self.block();
        let work = output.par_chunks_mut(block * self.output_len()).zip(maps.par_chunks(block * self.input_len()));
        work.for_each(|(output, maps)| {
            output.chunks_exact_mut(self.out_channels).for_each(|pixel| pixel.copy_from_slice(bias));
            let rows = maps.len() / self.in_channels;
            let input = self.input_panels(maps);
            let mut product = Buffer::stale(rows * self.columns());
            for (weight, product) in
                weight.chunks_exact(self.channels() * PANEL).zip(product.chunks_exact_mut(rows * PANEL))
            {
                Left::panels(&input, rows, self.in_channels).times(weight, rows, product, false, self.instructions);
            }
            self.instructions.run(
                #[inline(always)]
                || {
                    self.each_piece(rows, |at, place, len| {
                        let falls = &mut output[place..place + len];
                        falls.iter_mut().zip(&product[at..at + len]).for_each(|(sum, value)| *sum += value);
                    });
                    if self.relu {
                        output.iter_mut().for_each(|value| *value = relu(*value));
                    }
                },
            );
        });
        output
    }

    /// Gradients from that of the output; `output` is what [`forward`](Self::forward) gave.
    pub(super) fn backward(&self, maps: &[f32], weight: &[f32], output: &[f32], gradient: &[f32]) -> Gradients {
        let turned = self.turned_panels(weight);
        let mut found = vec![0.0; maps.len()];
        let share = self.frames.div_ceil(SHARES).max(1);
        let shares: Vec<Sums> = found
            .par_chunks_mut(share * self.input_len())
            .zip(maps.par_chunks(share * self.input_len()))
            .zip(output.par_chunks(share * self.output_len()).zip(gradient.par_chunks(share * self.output_len())))
            .map(|((found, maps), (output, gradient))| self.backward_share(found, maps, &turned, [output, gradient]))
            .collect();
        Gradients {
            maps: found,
            weight: self.weight_gradient(&shares),
            bias: (0..self.out_channels).map(|channel| shares.iter().map(|share| share.bias[channel]).sum()).collect(),
        }
    }

    fn backward_share(&self, found: &mut [f32], maps: &[f32], turned: &[f32], [output, gradient]: [&[f32]; 2]) -> Sums {
        let mut sums =
            Sums { weight: Buffer::zeros(self.channels() * self.columns()), bias: vec![0.0; self.out_channels] };
        let (small, large) = (self.block() * self.input_len(), self.block() * self.output_len());
        let blocks = found.chunks_mut(small).zip(maps.chunks(small));
        for ((found, maps), (output, gradient)) in blocks.zip(output.chunks(large).zip(gradient.chunks(large))) {
            self.backward_block(found, maps, turned, [output, gradient], &mut sums);
        }
        sums
    }

    fn backward_block(
        &self,
        found: &mut [f32],
        maps: &[f32],
        turned: &[f32],
        [output, gradient]: [&[f32]; 2],
        sums: &mut Sums,
    ) {
        let rows = maps.len() / self.in_channels;
        let mut open = Buffer::stale(gradient.len());
        let mut product = Buffer::zeros(rows * self.columns());
        self.instructions.run(
            #[inline(always)]
            || {
                for (open, (output, gradient)) in open.iter_mut().zip(output.iter().zip(gradient)) {
                    *open = if self.relu { relu_backward(*output, *gradient) } else { *gradient };
                }
                for pixel in open.chunks_exact(self.out_channels) {
                    sums.bias.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
                }
                self.each_piece(rows, |at, place, len| {
                    product[at..at + len].copy_from_slice(&open[place..place + len]);
                });
            },
        );
        let input = self.input_panels(maps);
        self.maps_gradient(found, &product, turned, rows);
        let pairs = sums.weight.chunks_exact_mut(self.channels() * PANEL).zip(product.chunks_exact(rows * PANEL));
        for (sums, product) in pairs {
            for (input, sums) in input.chunks_exact(rows * PANEL).zip(sums.chunks_exact_mut(PANEL * PANEL)) {
                Left::turned(input, rows).times(product, PANEL.min(self.in_channels), sums, true, self.instructions);
            }
        }
    }

    fn maps_gradient(&self, found: &mut [f32], product: &[f32], turned: &[f32], rows: usize) {
        let mut panel = Buffer::stale(rows * PANEL);
        for (index, turned) in turned.chunks_exact(self.columns() * PANEL).enumerate() {
            let left = Left::panels(product, rows, self.columns());
            left.times(turned, rows, &mut panel, false, self.instructions);
            let first = index * PANEL;
            let width = PANEL.min(self.in_channels - first);
            for (found, panel) in found.chunks_exact_mut(self.in_channels).zip(panel.chunks_exact(PANEL)) {
                found[first..first + width].copy_from_slice(&panel[..width]);
            }
        }
    }

    /// The gradient of the weight in Burn's order, from the shares' sums, added in their order.
    fn weight_gradient(&self, shares: &[Sums]) -> Vec<f32> {
        let mut gradient = vec![0.0; self.in_channels * self.out_channels * SIDE * SIDE];
        self.each_weight(|at, input, column| {
            let place = (column / PANEL * self.channels() + input) * PANEL + column % PANEL;
            gradient[at] = shares.iter().map(|share| share.weight[place]).sum();
        });
        gradient
    }
}

/// One share's sums: of the weight's gradient as panels `[columns/PANEL][channels, PANEL]`, and of the bias's.
struct Sums {
    weight: Buffer,
    bias: Vec<f32>,
}
