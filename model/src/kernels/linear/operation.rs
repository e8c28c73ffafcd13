//! The linear layer as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor with a hand-written backward pass, or `None` where the custom path does not apply. Every panel of a result is made by one
//! core from first to last, so results do not depend on the number of threads.

use std::sync::Arc;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;
use crate::kernels::sheet::{Dense, Sheet};

#[derive(Debug, Clone, Copy)]
struct Sizes {
    rows: usize,
    input: usize,
    output: usize,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    sizes: Sizes,
    /// `x`, weight, bias; only their shapes are needed.
    tensors: [FlexTensor; 3],
    layer: Arc<Dense>,
    x: Arc<Sheet>,
    instructions: Instructions,
}

/// See [`linear`](super::linear()); with given instructions.
///
/// # Panics
/// If the shapes do not follow one another.
pub(super) fn linear(
    x: Tensor<2>,
    weight: Tensor<2>,
    bias: Tensor<1>,
    instructions: Instructions,
) -> Option<Tensor<2>> {
    let ([rows, input], [inputs, output]) = (x.dims(), weight.dims());
    assert_eq!((inputs, bias.dims()), (input, [output]), "weights [input, output] and a bias for every output");
    let sizes = Sizes { rows, input, output };
    if [x.device(), weight.device(), bias.device()].iter().any(burn::tensor::Device::is_autodiff) {
        let tensors = [flex::followed(x)?, flex::followed(weight)?, flex::followed(bias)?];
        return Some(Tensor::from_primitive::<Autodiff<Flex>>(record(sizes, tensors, instructions)));
    }
    let tensors = [flex::unfollowed(x)?, flex::unfollowed(weight)?, flex::unfollowed(bias)?];
    let (out, ..) = forward(sizes, &tensors, false, instructions);
    Some(Tensor::from_primitive::<Flex>(out))
}

fn forward(
    Sizes { rows, input, output }: Sizes,
    [x, weight, bias]: &[FlexTensor; 3],
    with_backward: bool,
    instructions: Instructions,
) -> (FlexTensor, Dense, Sheet) {
    let layer = Dense::pack(flex::numbers(weight), flex::numbers(bias), &[input], &[output], with_backward);
    let x = Sheet::of(flex::numbers(x), rows, input);
    let out = layer.forward_everywhere(&x, instructions);
    (flex::tensor(out.numbers(output), [rows, output]), layer, x)
}

/// Runs forward and records the backward step.
fn record(sizes: Sizes, tensors: [Followed; 3], instructions: Instructions) -> Followed {
    let nodes = tensors.each_ref().map(Followed::node);
    let tensors = tensors.map(|tensor| tensor.into_primitive().to_contiguous());
    let (out, layer, x) = forward(sizes, &tensors, true, instructions);
    match Linear.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            prepared.finish(Kept { sizes, tensors, layer: Arc::new(layer), x: Arc::new(x), instructions }, out)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(out),
    }
}

/// The backward step.
#[derive(Debug)]
struct Linear;

impl Backward<Flex, 3> for Linear {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 3>, gradients: &mut grads::Gradients, _: &mut Checkpointer) {
        let Kept { sizes, tensors, layer, x, instructions } = ops.state;
        let out = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let out = Sheet::of(flex::numbers(&out), sizes.rows, sizes.output);
        let is_wanted = |parent: usize| ops.parents[parent].is_some();
        let found_x = match is_wanted(0) {
            true => layer.backward_everywhere(&out, instructions).numbers(sizes.input),
            false => Vec::new(),
        };
        let (weight, bias) = match is_wanted(1) || is_wanted(2) {
            true => layer.learn_everywhere(&x, &out, instructions),
            false => (Vec::new(), Vec::new()),
        };
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        flex::register(gradients, parents, &tensors, [found_x, weight, bias]);
    }
}
