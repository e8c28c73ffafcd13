//! The convolutions as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`Stack::backward`], or `None` where the custom path does not apply.

use std::sync::Arc;

use burn::tensor::{Int, Tensor};
use burn_flex::FlexTensor;

use super::geometry::{self, FILTERS};
use super::stack::Stack;
use crate::kernels::Conv3Layer;
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::layered::{in_turn, operands, pairs};
use crate::kernels::memory::Buffer;
use crate::kernels::operation::{Operation, run_layers};

/// See [`conv3_features`](super::conv3_features).
pub(super) fn features(pixels: &Tensor<4, Int>, layers: &[Conv3Layer]) -> Option<Tensor<2>> {
    features_with(pixels, layers, Instructions::best())
}

/// The same with given instructions.
pub(super) fn features_with(
    pixels: &Tensor<4, Int>,
    layers: &[Conv3Layer],
    instructions: Instructions,
) -> Option<Tensor<2>> {
    let [_, height, width, channels] = pixels.dims();
    let inputs = std::iter::once(channels).chain(std::iter::repeat(FILTERS));
    let fits = |(layer, input): (&Conv3Layer, usize)| layer.weight.dims() == [FILTERS, input, 3, 3];
    if ![3, 9].contains(&channels)
        || !flex::runs_on_flex(&pixels.device())
        || layers.is_empty()
        || !layers.iter().zip(inputs).all(fits)
    {
        return None;
    }
    let stack = Stack { layers: geometry::layers([height, width], channels, layers.len())?, instructions };
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

    fn forward(&self, tensors: &[FlexTensor; N], keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let activations = self.stack.forward(self.bytes(), &pairs(tensors), keep);
        Some((self.output(&activations), Arc::new(activations)))
    }

    fn backward(
        &self,
        tensors: &[FlexTensor; N],
        activations: &Self::Kept,
        output: &[f32],
        _wanted: [bool; N],
    ) -> [Vec<f32>; N] {
        in_turn(self.stack.backward(self.bytes(), &pairs(tensors), activations, output))
    }
}

impl Convolutions {
    fn bytes(&self) -> &[u8] {
        self.bytes.as_slice().expect("bytes in one piece")
    }

    /// The last activations as features.
    fn output(&self, activations: &[Buffer]) -> FlexTensor {
        let width = self.stack.layers[self.stack.layers.len() - 1].output_len();
        let last = &activations[activations.len() - 1];
        flex::tensor(last.to_vec(), [last.len() / width, width])
    }
}
