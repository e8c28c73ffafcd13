//! The arithmetic: every position of the input times all sixteen taps is one product of matrices, whose rows are then added where they fall.
//!
//! In: `[frames, height, width, in]` maps and a layer's numbers. Out: the larger maps; for the backward pass the gradients of maps, weight and bias.
//!
//! A row of the product has four segments, one for each row of the kernel: the four taps beside each other, each with all output channels. A segment falls on
//! neighbouring numbers of one output row. Segments are padded to a whole number of [`LANES`], so none of those pieces crosses a panel.
//! Work is split over cores by frames in fixed shares, and sums are added in a fixed order: the result does not depend on how many cores there are.

use rayon::prelude::*;

use crate::kernels::instructions::Instructions;
use crate::kernels::lanes::LANES;
use crate::kernels::memory::Buffer;
use crate::kernels::product::{Left, PANEL};

/// Rows, or columns, of the kernel.
const SIDE: usize = 4;
/// Shares of the frames, each with its own sums of weight gradients.
const SHARES: usize = 8;
/// Numbers of the product made at a time; they stay in a core's own cache.
const PRODUCT: usize = 64 * 1024;

/// Sizes of one layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub(super) frames: usize,
    /// Height and width of the input.
    pub(super) input: [usize; 2],
    /// Height and width of the output.
    pub(super) output: [usize; 2],
    pub(super) in_channels: usize,
    pub(super) out_channels: usize,
    pub(super) relu: bool,
    pub(super) instructions: Instructions,
}

/// Gradients of one layer: of the maps and, in Burn's order, of weight and bias.
#[derive(Debug)]
pub(super) struct Gradients {
    pub(super) maps: Vec<f32>,
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

impl Sizes {
    fn positions(&self) -> usize {
        self.input[0] * self.input[1]
    }

    fn input_len(&self) -> usize {
        self.positions() * self.in_channels
    }

    fn output_len(&self) -> usize {
        self.output[0] * self.output[1] * self.out_channels
    }

    /// Numbers of a segment that are used, and with padding.
    fn segment(&self) -> [usize; 2] {
        let used = SIDE * self.out_channels;
        [used, used.next_multiple_of(LANES)]
    }

    /// Columns of the product, in whole panels.
    fn columns(&self) -> usize {
        (SIDE * self.segment()[1]).next_multiple_of(PANEL)
    }

    /// Channels of the input, in whole panels.
    fn channels(&self) -> usize {
        self.in_channels.next_multiple_of(PANEL)
    }

    /// Frames worked on at a time.
    fn block(&self) -> usize {
        (PRODUCT / (self.positions() * self.columns())).clamp(1, 64)
    }

    fn share(&self) -> usize {
        self.frames.div_ceil(SHARES).max(1)
    }

    /// The column of the product for a tap and an output channel.
    fn column(&self, tap: usize, channel: usize) -> usize {
        tap / SIDE * self.segment()[1] + tap % SIDE * self.out_channels + channel
    }

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
                let left = Left { inner: PANEL.min(self.in_channels), ..Left::panels(&input, rows, self.channels()) };
                left.times(weight, rows, product, false, self.instructions);
            }
            self.instructions.run(
                #[inline(always)]
                || {
                    self.each_piece(rows, |at, place, len| {
                        let falls = &mut output[place..place + len];
                        falls.iter_mut().zip(&product[at..at + len]).for_each(|(sum, value)| *sum += value);
                    });
                    if self.relu {
                        output.iter_mut().for_each(|value| *value = value.max(0.0));
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
        let share = self.share();
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
                    *open = if !self.relu || *output > 0.0 { *gradient } else { 0.0 };
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

    /// Calls `of(place in the product, place in the output, length)` for every piece of every segment of a block of `rows` positions.
    #[inline(always)]
    fn each_piece(&self, rows: usize, mut of: impl FnMut(usize, usize, usize)) {
        let ([height, width], [used, padded]) = (self.input, self.segment());
        let line = self.output[1] * self.out_channels;
        for row in 0..rows {
            let (frame, i, j) = (row / (height * width), row / width % height, row % width);
            for k in 0..SIDE {
                let place = frame * self.output_len() + (2 * i + k) * line + 2 * j * self.out_channels;
                for piece in (0..used).step_by(LANES) {
                    let column = k * padded + piece;
                    let at = column / PANEL * rows * PANEL + row * PANEL + column % PANEL;
                    of(at, place + piece, LANES.min(used - piece));
                }
            }
        }
    }

    /// Maps as panels `[channels/PANEL][rows, PANEL]`.
    fn input_panels(&self, maps: &[f32]) -> Buffer {
        let rows = maps.len() / self.in_channels;
        let mut panels = Buffer::zeros(rows * self.channels());
        for (index, panel) in panels.chunks_exact_mut(rows * PANEL).enumerate() {
            let first = index * PANEL;
            let width = PANEL.min(self.in_channels - first);
            for (panel, row) in panel.chunks_exact_mut(PANEL).zip(maps.chunks_exact(self.in_channels)) {
                panel[..width].copy_from_slice(&row[first..first + width]);
            }
        }
        panels
    }

    /// Weights as panels `[columns/PANEL][channels, PANEL]`.
    fn panels(&self, weight: &[f32]) -> Buffer {
        let mut panels = Buffer::zeros(self.channels() * self.columns());
        self.each_weight(|at, input, column| {
            panels[(column / PANEL * self.channels() + input) * PANEL + column % PANEL] = weight[at];
        });
        panels
    }

    /// Weights turned round, as panels `[channels/PANEL][columns, PANEL]`.
    fn turned_panels(&self, weight: &[f32]) -> Buffer {
        let mut panels = Buffer::zeros(self.channels() * self.columns());
        self.each_weight(|at, input, column| {
            panels[(input / PANEL * self.columns() + column) * PANEL + input % PANEL] = weight[at];
        });
        panels
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

    /// Calls `of(place in Burn's order, input channel, column of the product)` for every weight.
    fn each_weight(&self, mut of: impl FnMut(usize, usize, usize)) {
        for input in 0..self.in_channels {
            for output in 0..self.out_channels {
                for tap in 0..SIDE * SIDE {
                    of((input * self.out_channels + output) * SIDE * SIDE + tap, input, self.column(tap, output));
                }
            }
        }
    }
}

/// One share's sums: of the weight's gradient as panels `[columns/PANEL][channels, PANEL]`, and of the bias's.
struct Sums {
    weight: Buffer,
    bias: Vec<f32>,
}
