//! Sizes of the layers, and weights between Burn's order and the kernels'.
//!
//! In: `[32, in, 3, 3]` weights of the first layer, or summed gradients in the kernels' order. Out: the other. The first layer's order is one panel `[3, 3, in, 32]`:
//! kernel row, kernel column, input channel, filter; that of the later layers is [`winograd`](super::winograd)'s.

use crate::kernels::memory::Buffer;
use crate::kernels::product::PANEL;

/// Filters of every layer: one panel of a product.
pub(super) const FILTERS: usize = PANEL;
/// Numbers of one 3×3 kernel.
const TAPS: usize = 9;

/// One convolution: `[height, width]` of input and output, and the channels and stride of its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    pub(super) input: [usize; 2],
    pub(super) output: [usize; 2],
    pub(super) channels: usize,
}

impl Layer {
    /// Numbers of one frame's input.
    pub(super) fn input_len(&self) -> usize {
        self.input[0] * self.input[1] * self.channels
    }

    /// Numbers of one frame's output.
    pub(super) fn output_len(&self) -> usize {
        self.output[0] * self.output[1] * FILTERS
    }

    /// Numbers of one kernel row: three positions.
    pub(super) fn reach(&self) -> usize {
        3 * self.channels
    }

    /// The weights as the kernels read them.
    pub(super) fn panel(&self, weight: &[f32]) -> Buffer {
        let mut panel = Buffer::stale(TAPS * self.channels * FILTERS);
        for (filter, weight) in weight.chunks_exact(self.channels * TAPS).enumerate() {
            for (at, value) in weight.iter().enumerate() {
                panel[self.place(at) * FILTERS + filter] = *value;
            }
        }
        panel
    }

    /// A gradient of the weights in Burn's order, from the shares' sums, added in their order.
    pub(super) fn gradient(&self, shares: &[&Buffer]) -> Vec<f32> {
        let mut gradient = vec![0.0; FILTERS * self.channels * TAPS];
        for (filter, gradient) in gradient.chunks_exact_mut(self.channels * TAPS).enumerate() {
            for (at, value) in gradient.iter_mut().enumerate() {
                let place = self.place(at) * FILTERS + filter;
                *value = shares.iter().map(|share| share[place]).sum();
            }
        }
        gradient
    }

    /// From `[channel, row, column]` to `[row, column, channel]`.
    fn place(&self, at: usize) -> usize {
        at % TAPS * self.channels + at / TAPS
    }
}

/// The layers over a picture, or `None` when it is too small.
pub(super) fn layers([height, width]: [usize; 2], channels: usize, count: usize) -> Option<Vec<Layer>> {
    let mut layers = Vec::with_capacity(count);
    let (mut input, mut channels) = ([height, width], channels);
    for index in 0..count {
        let side = |size: usize| Some(if index == 0 { size.checked_sub(3)? / 2 + 1 } else { size.checked_sub(2)? });
        let output = [side(input[0])?, side(input[1])?];
        if output.contains(&0) {
            return None;
        }
        layers.push(Layer { input, output, channels });
        (input, channels) = (output, FILTERS);
    }
    Some(layers)
}
