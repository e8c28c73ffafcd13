//! The convolutions as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`Stack::backward`], or `None` where the custom path does not apply.

use std::sync::Arc;

use burn::tensor::{Int, Tensor};
use burn_flex::FlexTensor;

use super::geometry;
use super::pixels::COLORS;
use super::stack::Stack;
use crate::kernels::ConvLayer;
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::layered::{in_turn, operands, pairs};
use crate::kernels::memory::Buffer;
use crate::kernels::operation::{Operation, run_layers};

/// See [`features`](super::features).
pub(super) fn features(pixels: &Tensor<4, Int>, layers: &[ConvLayer]) -> Option<Tensor<2>> {
    features_with(pixels, layers, Instructions::best())
}

/// The same with given instructions.
pub(super) fn features_with(
    pixels: &Tensor<4, Int>,
    layers: &[ConvLayer],
    instructions: Instructions,
) -> Option<Tensor<2>> {
    let [_, height, width, colors] = pixels.dims();
    if colors != COLORS || !flex::runs_on_flex(&pixels.device()) {
        return None;
    }
    let channels: Vec<[usize; 2]> = layers.iter().map(|layer| layer.weight.dims()).map(|[n, c, _, _]| [c, n]).collect();
    let kernels_fit = layers.iter().all(|layer| layer.weight.dims()[2..] == [4, 4]);
    if !kernels_fit || channels.first()?[0] != COLORS {
        return None;
    }
    let stack = Stack { layers: geometry::layers([height, width], &channels)?, instructions };
    let convolutions = Convolutions { stack, bytes: flex::bytes(pixels)? };
    run_layers(convolutions, operands(layers.iter().map(|layer| (&layer.weight, &layer.bias)))?)
}

/// The layers, and the pictures they look at.
#[derive(Clone, Debug)]
struct Convolutions {
    stack: Stack,
    bytes: FlexTensor,
}

impl<const N: usize> Operation<N> for Convolutions {
    /// Activations of the layers.
    type Kept = Arc<Vec<Buffer>>;

    fn forward(&self, tensors: &[FlexTensor; N], _keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let activations = self.stack.forward(self.bytes(), &pairs(tensors));
        Some((self.output(&activations), Arc::new(activations)))
    }

    fn backward(
        &self,
        tensors: &[FlexTensor; N],
        activations: &Self::Kept,
        output: &[f32],
        _wanted: [bool; N],
    ) -> [Vec<f32>; N] {
        let stack = &self.stack;
        let last = &stack.layers[stack.layers.len() - 1];
        let mut padded = Buffer::stale(activations[stack.layers.len() - 1].len());
        let positions = output.chunks_exact(last.out_channels);
        for (padded, position) in padded.chunks_exact_mut(last.output_stride()).zip(positions) {
            padded[..last.out_channels].copy_from_slice(position);
            padded[last.out_channels..].fill(0.0);
        }
        in_turn(stack.backward(self.bytes(), &pairs(tensors), activations, &padded))
    }
}

impl Convolutions {
    fn bytes(&self) -> &[u8] {
        self.bytes.as_slice().expect("bytes in one piece")
    }

    /// The last activations without padding.
    fn output(&self, activations: &[Buffer]) -> FlexTensor {
        let last = &self.stack.layers[self.stack.layers.len() - 1];
        let activations = &activations[activations.len() - 1];
        let numbers: Vec<f32> = activations
            .chunks_exact(last.output_stride())
            .flat_map(|channels| &channels[..last.out_channels])
            .copied()
            .collect();
        let frames = activations.len() / last.output_len();
        flex::tensor(numbers, [frames, last.output[0] * last.output[1] * last.out_channels])
    }
}
