//! Sizes and places: how activations, tiles and weights of one layer lie in memory.
//!
//! In: a layer's image size and channels. Out: indices. Activations are `[height, width, stride]`, channels last, the number of channels
//! padded to `Layer::stride`; only the part that the next layer reads is kept.

use crate::kernels::{memory::Buffer, product::PANEL};

/// Channels as they lie in memory: a whole number of vectors.
#[inline(always)]
pub(super) fn padded(channels: usize) -> usize {
    channels.next_multiple_of(16)
}

/// One 4×4 convolution of stride 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    /// `[height, width]` of the input that is kept in memory.
    pub(super) input: [usize; 2],
    /// `[height, width]` of the output that is needed.
    pub(super) output: [usize; 2],
    pub(super) in_channels: usize,
    pub(super) out_channels: usize,
}

/// Layers over an image, or `None` when it is too small or the channels do not follow from each other.
/// `channels` are `[in, out]` for each layer.
pub(super) fn layers(image: [usize; 2], channels: &[[usize; 2]]) -> Option<Vec<Layer>> {
    if channels.windows(2).any(|pair| pair[0][1] != pair[1][0]) {
        return None;
    }
    let smaller = |size: [usize; 2]| Some([size[0].checked_sub(4)? / 2 + 1, size[1].checked_sub(4)? / 2 + 1]);
    let mut size = image;
    for _ in channels {
        size = smaller(size)?;
    }
    // From the last layer down: each input is what its outputs reach.
    let mut layers: Vec<Layer> = Vec::with_capacity(channels.len());
    for [in_channels, out_channels] in channels.iter().rev().copied() {
        let input = size.map(|size| 2 * size + 2);
        layers.push(Layer { input, output: size, in_channels, out_channels });
        size = input;
    }
    layers.reverse();
    if let Some(first) = layers.first_mut() {
        first.input = image;
    }
    Some(layers)
}

impl Layer {
    /// Numbers of one input position.
    #[inline(always)]
    pub(super) fn input_stride(&self) -> usize {
        padded(self.in_channels)
    }

    /// Numbers of one output position.
    #[inline(always)]
    pub(super) fn output_stride(&self) -> usize {
        padded(self.out_channels)
    }

    /// Output channels in whole panels.
    #[inline(always)]
    pub(super) fn panelled_channels(&self) -> usize {
        self.out_channels.next_multiple_of(PANEL)
    }

    /// Numbers of one 2×2 cell of the input: `[2, 2, stride]`.
    #[inline(always)]
    pub(super) fn cell_width(&self) -> usize {
        4 * self.input_stride()
    }

    /// Inner and outer size of the products.
    pub(super) fn product(&self) -> [usize; 2] {
        [self.cell_width(), self.panelled_channels()]
    }

    /// Numbers of one frame's input.
    #[inline(always)]
    pub(super) fn input_len(&self) -> usize {
        self.input[0] * self.input[1] * self.input_stride()
    }

    /// Numbers of one frame's output.
    #[inline(always)]
    pub(super) fn output_len(&self) -> usize {
        self.output[0] * self.output[1] * self.output_stride()
    }

    /// 2×2 output tiles of one frame.
    #[inline(always)]
    pub(super) fn tiles(&self) -> usize {
        self.output[0].div_ceil(2) * self.output[1].div_ceil(2)
    }

    #[inline(always)]
    fn tile(&self, tile: usize) -> [usize; 2] {
        let across = self.output[1].div_ceil(2);
        [tile / across * 2, tile % across * 2]
    }

    /// Where a tile's 3×3 cells start in the frame's input; `None` beyond an odd output's edge.
    #[inline(always)]
    pub(super) fn cells(&self, tile: usize) -> [[Option<usize>; 3]; 3] {
        let [top, left] = self.tile(tile);
        let [high, wide] = self.output;
        let mut cells = [[None; 3]; 3];
        for (i, cells) in cells.iter_mut().enumerate() {
            for (j, cell) in cells.iter_mut().enumerate() {
                if top + i <= high && left + j <= wide {
                    *cell = Some((2 * (top + i) * self.input[1] + 2 * (left + j)) * self.input_stride());
                }
            }
        }
        cells
    }

    /// Numbers of one of a cell's two lines: two pixels.
    #[inline(always)]
    pub(super) fn cell_line_len(&self) -> usize {
        2 * self.input_stride()
    }

    /// Numbers from one line of the input to the next.
    #[inline(always)]
    pub(super) fn input_line(&self) -> usize {
        self.input[1] * self.input_stride()
    }

    /// Whether a tile's upper and left cells belong to an earlier tile too.
    #[inline(always)]
    pub(super) fn is_begun(&self, tile: usize) -> [bool; 2] {
        self.tile(tile).map(|start| start > 0)
    }

    /// Where a tile's 2×2 outputs start in the frame's output; `None` beyond an odd output's edge.
    #[inline(always)]
    pub(super) fn spots(&self, tile: usize) -> [[Option<usize>; 2]; 2] {
        let [top, left] = self.tile(tile);
        let [high, wide] = self.output;
        let mut spots = [[None; 2]; 2];
        for (i, spots) in spots.iter_mut().enumerate() {
            for (j, spot) in spots.iter_mut().enumerate() {
                if top + i < high && left + j < wide {
                    *spot = Some(((top + i) * wide + left + j) * self.output_stride());
                }
            }
        }
        spots
    }
}

/// A layer's weights, or their gradients, as the kernels read them.
#[derive(Debug)]
pub(super) struct Planes {
    /// Panels of the left-to-right products.
    pub(super) weights: Buffer,
    /// The same turned round, for the input's gradient; empty where that is not wanted.
    pub(super) turned: Buffer,
    /// Padded to whole panels.
    pub(super) bias: Buffer,
}
