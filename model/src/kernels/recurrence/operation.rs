//! The GRU as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`sequence::backward`], or `None` where the custom path does not apply.

use std::sync::Arc;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::sequence::{self, Inputs, Lane, Sizes};
use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;

/// What the GRU reads, and with which instructions.
#[derive(Clone, Debug)]
struct Input {
    sizes: Sizes,
    /// gates, weight, bias, initial
    tensors: [FlexTensor; 4],
    keep: Option<FlexTensor>,
    instructions: Instructions,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    input: Input,
    lanes: Arc<Vec<Lane>>,
}

/// See [`gru`](super::gru); with given instructions.
pub(super) fn gru(
    (gates, weight, bias, initial): (Tensor<3>, Tensor<2>, Tensor<1>, Tensor<2>),
    keep: Option<Tensor<2>>,
    instructions: Instructions,
) -> Option<Tensor<3>> {
    let ([length, batch, width], [_, hidden]) = (gates.dims(), initial.dims());
    assert!(
        width == 3 * hidden
            && weight.dims() == [hidden, width]
            && bias.dims() == [width]
            && initial.dims() == [batch, hidden],
        "gates [length, batch, 3·hidden], weight [hidden, 3·hidden], bias [3·hidden] and initial [batch, hidden] were expected, \
         got {:?}, {:?}, {:?} and {:?}",
        gates.dims(),
        weight.dims(),
        bias.dims(),
        initial.dims()
    );
    let sizes = Sizes { length, batch, hidden };
    let keep = match keep {
        Some(keep) => {
            assert_eq!(keep.dims(), [length, batch], "keep is [length, batch]");
            let keep = if keep.device().is_autodiff() { keep.inner() } else { keep };
            Some(flex::unfollowed(keep)?)
        }
        None => None,
    };
    let devices = [gates.device(), weight.device(), bias.device(), initial.device()];
    if devices.iter().any(burn::tensor::Device::is_autodiff) {
        let tensors =
            [flex::followed(gates)?, flex::followed(weight)?, flex::followed(bias)?, flex::followed(initial)?];
        return Some(Tensor::from_primitive::<Autodiff<Flex>>(record(sizes, tensors, keep, instructions)));
    }
    let tensors =
        [flex::unfollowed(gates)?, flex::unfollowed(weight)?, flex::unfollowed(bias)?, flex::unfollowed(initial)?];
    let (states, _) = Input { sizes, tensors, keep, instructions }.forward();
    Some(Tensor::from_primitive::<Flex>(states))
}

/// Runs forward and records the backward step.
fn record(sizes: Sizes, tensors: [Followed; 4], keep: Option<FlexTensor>, instructions: Instructions) -> Followed {
    let nodes = tensors.each_ref().map(Followed::node);
    let tensors = tensors.map(|tensor| tensor.into_primitive().to_contiguous());
    let input = Input { sizes, tensors, keep, instructions };
    let (states, lanes) = input.forward();
    match Gru.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => prepared.finish(Kept { input, lanes: Arc::new(lanes) }, states),
        OpsKind::UnTracked(prepared) => prepared.finish(states),
    }
}

impl Input {
    fn inputs(&self) -> Inputs<'_> {
        let [gates, weight, bias, initial] = self.tensors.each_ref().map(flex::numbers);
        Inputs { gates, weight, bias, initial, keep: self.keep.as_ref().map(flex::numbers) }
    }

    fn forward(&self) -> (FlexTensor, Vec<Lane>) {
        let Sizes { length, batch, hidden } = self.sizes;
        let (states, lanes) = sequence::forward(self.sizes, self.inputs(), self.instructions);
        (flex::tensor(states, [length, batch, hidden]), lanes)
    }
}

/// The backward step.
#[derive(Debug)]
struct Gru;

impl Backward<Flex, 4> for Gru {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 4>, gradients: &mut grads::Gradients, _: &mut Checkpointer) {
        let Kept { input, lanes } = ops.state;
        let states = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let found = sequence::backward(input.sizes, input.inputs(), &lanes, flex::numbers(&states), input.instructions);
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        let found = [found.gates, found.weight, found.bias, found.initial];
        flex::register(gradients, parents, &input.tensors, found);
    }
}
