//! Where the numbers of a layer lie while it is worked on.
//!
//! In: `[frames, height, width, in]` maps and `[in, out, 4, 4]` weights. Out: both as panels for the product, and where every piece of the product falls on the output.
//!
//! A row of the product has four segments, one for each row of the kernel: the four taps beside each other, each with all output channels. A segment falls on
//! neighbouring numbers of one output row. Segments are padded to a whole number of [`LANES`], so none of those pieces crosses a panel.

use crate::kernels::instructions::Instructions;
use crate::kernels::lanes::LANES;
use crate::kernels::memory::Buffer;
use crate::kernels::product::PANEL;

/// Rows, or columns, of the kernel.
pub(super) const SIDE: usize = 4;
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

impl Sizes {
    pub(super) fn positions(&self) -> usize {
        self.input[0] * self.input[1]
    }

    pub(super) fn input_len(&self) -> usize {
        self.positions() * self.in_channels
    }

    pub(super) fn output_len(&self) -> usize {
        self.output[0] * self.output[1] * self.out_channels
    }

    /// Numbers of a segment that are used, and with padding.
    pub(super) fn segment(&self) -> [usize; 2] {
        let used = SIDE * self.out_channels;
        [used, used.next_multiple_of(LANES)]
    }

    /// Columns of the product, in whole panels.
    pub(super) fn columns(&self) -> usize {
        (SIDE * self.segment()[1]).next_multiple_of(PANEL)
    }

    /// Channels of the input, in whole panels.
    pub(super) fn channels(&self) -> usize {
        self.in_channels.next_multiple_of(PANEL)
    }

    /// Frames worked on at a time.
    pub(super) fn block(&self) -> usize {
        (PRODUCT / (self.positions() * self.columns())).clamp(1, 64)
    }

    /// The column of the product for a tap and an output channel.
    pub(super) fn column(&self, tap: usize, channel: usize) -> usize {
        tap / SIDE * self.segment()[1] + tap % SIDE * self.out_channels + channel
    }

    /// Calls `of(place in the product, place in the output, length)` for every piece of every segment of a block of `rows` positions.
    #[inline(always)]
    pub(super) fn each_piece(&self, rows: usize, mut of: impl FnMut(usize, usize, usize)) {
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
    pub(super) fn input_panels(&self, maps: &[f32]) -> Buffer {
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
    pub(super) fn panels(&self, weight: &[f32]) -> Buffer {
        let mut panels = Buffer::zeros(self.channels() * self.columns());
        self.each_weight(|at, input, column| {
            panels[(column / PANEL * self.channels() + input) * PANEL + column % PANEL] = weight[at];
        });
        panels
    }

    /// Weights turned round, as panels `[channels/PANEL][columns, PANEL]`.
    pub(super) fn turned_panels(&self, weight: &[f32]) -> Buffer {
        let mut panels = Buffer::zeros(self.channels() * self.columns());
        self.each_weight(|at, input, column| {
            panels[(input / PANEL * self.columns() + column) * PANEL + input % PANEL] = weight[at];
        });
        panels
    }

    /// Calls `of(place in Burn's order, input channel, column of the product)` for every weight.
    pub(super) fn each_weight(&self, mut of: impl FnMut(usize, usize, usize)) {
        for input in 0..self.in_channels {
            for output in 0..self.out_channels {
                for tap in 0..SIDE * SIDE {
                    of((input * self.out_channels + output) * SIDE * SIDE + tap, input, self.column(tap, output));
                }
            }
        }
    }
}
