//! The transposed convolution as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`Sizes::backward`], or `None` where the custom path does not apply.

use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::layout::Sizes;
use crate::kernels::TransposedLayer;
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::operation::{Operand, Operation, run};

/// See [`transposed`](super::transposed); with given instructions.
pub(super) fn transposed(maps: &Tensor<4>, layer: &TransposedLayer, instructions: Instructions) -> Option<Tensor<4>> {
    let ([frames, height, width, in_channels], [inputs, out_channels, tall, wide]) = (maps.dims(), layer.weight.dims());
    if inputs != in_channels
        || [tall, wide] != [4, 4]
        || layer.bias.dims() != [out_channels]
        || maps.shape().num_elements() == 0
    {
        return None;
    }
    let output = [2 * height + 2 + layer.padding[0], 2 * width + 2 + layer.padding[1]];
    let input = [height, width];
    let sizes = Sizes { frames, input, output, in_channels, out_channels, relu: layer.relu, instructions };
    run(sizes, [Operand::of(maps.clone())?, Operand::of(layer.weight.clone())?, Operand::of(layer.bias.clone())?])
}

impl Operation<3> for Sizes {
    /// The output.
    type Kept = FlexTensor;

    fn forward(&self, tensors: &[FlexTensor; 3], _keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let [maps, weight, bias] = tensors.each_ref().map(flex::numbers);
        let [height, width] = self.output;
        let numbers = Self::forward(self, maps, weight, bias);
        let output = flex::tensor(numbers, [self.frames, height, width, self.out_channels]);
        Some((output.clone(), output))
    }

    fn backward(&self, tensors: &[FlexTensor; 3], kept: &FlexTensor, output: &[f32], _: [bool; 3]) -> [Vec<f32>; 3] {
        let [maps, weight, _] = tensors.each_ref().map(flex::numbers);
        let found = Self::backward(self, maps, weight, flex::numbers(kept), output);
        [found.maps, found.weight, found.bias]
    }
}
