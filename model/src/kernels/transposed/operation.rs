//! The transposed convolution as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`Sizes::backward`], or `None` where the custom path does not apply.

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::{Device, Tensor};
use burn_flex::FlexTensor;

use super::layout::Sizes;
use crate::kernels::TransposedLayer;
use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    sizes: Sizes,
    /// maps, weight, bias
    tensors: [FlexTensor; 3],
    output: FlexTensor,
}

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
    let (maps, weight, bias) = (maps.clone(), layer.weight.clone(), layer.bias.clone());
    let devices = [maps.device(), weight.device(), bias.device()];
    if devices.iter().any(Device::is_autodiff) {
        let tensors = [flex::followed(maps)?, flex::followed(weight)?, flex::followed(bias)?];
        return Some(Tensor::from_primitive::<Autodiff<Flex>>(record(sizes, tensors)));
    }
    let tensors = [flex::unfollowed(maps)?, flex::unfollowed(weight)?, flex::unfollowed(bias)?];
    Some(Tensor::from_primitive::<Flex>(forward(sizes, &tensors)))
}

fn forward(sizes: Sizes, tensors: &[FlexTensor; 3]) -> FlexTensor {
    let [maps, weight, bias] = tensors.each_ref().map(flex::numbers);
    let [height, width] = sizes.output;
    flex::tensor(sizes.forward(maps, weight, bias), [sizes.frames, height, width, sizes.out_channels])
}

/// Runs forward and records the backward step.
fn record(sizes: Sizes, tensors: [Followed; 3]) -> Followed {
    let nodes = tensors.each_ref().map(Followed::node);
    let tensors = tensors.map(|tensor| tensor.into_primitive().to_contiguous());
    let output = forward(sizes, &tensors);
    match Transposed.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => prepared.finish(Kept { sizes, tensors, output: output.clone() }, output),
        OpsKind::UnTracked(prepared) => prepared.finish(output),
    }
}

/// The backward step.
#[derive(Debug)]
struct Transposed;

impl Backward<Flex, 3> for Transposed {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 3>, gradients: &mut grads::Gradients, _: &mut Checkpointer) {
        let Kept { sizes, tensors, output } = ops.state;
        let gradient = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let [maps, weight, _] = tensors.each_ref().map(flex::numbers);
        let found = sizes.backward(maps, weight, flex::numbers(&output), flex::numbers(&gradient));
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        flex::register(gradients, parents, &tensors, [found.maps, found.weight, found.bias]);
    }
}
