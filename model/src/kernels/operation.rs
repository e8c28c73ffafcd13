//! Operations with a hand-written backward pass, and the one place in which they are recorded for Burn's autodiff.
//!
//! In: an [`Operation`] and the tensors it is differentiable in. Out: a Burn tensor, or nothing where one of them does not live on `flex` as float32; the
//! caller then falls back to [`plain`](super::plain) operations.

use std::fmt::Debug;
use std::marker::PhantomData;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::flex::{self, Followed};

/// An operation on `N` tensors.
pub(super) trait Operation<const N: usize>: Clone + Debug + Send + 'static {
    /// What the backward pass needs beside the tensors.
    type Kept: Clone + Debug + Send + 'static;

    /// The output, and what the backward pass will need, if there will be one (`keep`).
    fn forward(&self, tensors: &[FlexTensor; N], keep: bool) -> Option<(FlexTensor, Self::Kept)>;

    /// The gradient of each tensor from the output's; those that are not `wanted` may be left empty.
    fn backward(
        &self,
        tensors: &[FlexTensor; N],
        kept: &Self::Kept,
        output: &[f32],
        wanted: [bool; N],
    ) -> [Vec<f32>; N];
}

/// A float32 tensor on `flex`, in one piece.
#[derive(Debug)]
pub(super) enum Operand {
    /// Autodiff follows it.
    Followed(Followed),
    /// It is a constant.
    Constant(FlexTensor),
}

impl Operand {
    /// None for a tensor that lives elsewhere or is not float32.
    pub(super) fn of<const D: usize>(tensor: Tensor<D>) -> Option<Self> {
        if tensor.device().is_autodiff() {
            flex::followed(tensor).map(Self::Followed)
        } else {
            flex::unfollowed(tensor).map(Self::Constant)
        }
    }

    fn numbers(self) -> FlexTensor {
        match self {
            Self::Followed(tensor) => flex::in_one_piece(tensor.into_primitive()),
            Self::Constant(tensor) => tensor,
        }
    }

    fn followed(self) -> Followed {
        match self {
            Self::Followed(tensor) => tensor,
            Self::Constant(tensor) => Followed::new(tensor),
        }
    }
}

/// Runs an operation, and records its backward pass where autodiff follows one of the tensors.
pub(super) fn run<const N: usize, const D: usize>(
    operation: impl Operation<N>,
    operands: [Operand; N],
) -> Option<Tensor<D>> {
    if operands.iter().any(|operand| matches!(operand, Operand::Followed(_))) {
        let output = recorded(operation, operands.map(Operand::followed))?;
        return Some(Tensor::from_primitive::<Autodiff<Flex>>(output));
    }
    let (output, _) = operation.forward(&operands.map(Operand::numbers), false)?;
    Some(Tensor::from_primitive::<Flex>(output))
}

/// The same for an operation on the weight and bias of each of one to six layers.
pub(super) fn run_layers<O, const D: usize>(operation: O, operands: Vec<Operand>) -> Option<Tensor<D>>
where
    O: Operation<2> + Operation<4> + Operation<6> + Operation<8> + Operation<10> + Operation<12>,
{
    match operands.len() {
        2 => run::<2, D>(operation, operands.try_into().ok()?),
        4 => run::<4, D>(operation, operands.try_into().ok()?),
        6 => run::<6, D>(operation, operands.try_into().ok()?),
        8 => run::<8, D>(operation, operands.try_into().ok()?),
        10 => run::<10, D>(operation, operands.try_into().ok()?),
        12 => run::<12, D>(operation, operands.try_into().ok()?),
        _ => None,
    }
}

fn recorded<O: Operation<N>, const N: usize>(operation: O, tensors: [Followed; N]) -> Option<Followed> {
    let nodes = tensors.each_ref().map(Followed::node);
    let tensors = tensors.map(|tensor| flex::in_one_piece(tensor.into_primitive()));
    let step = Step(PhantomData);
    Some(match step.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let (output, kept) = operation.forward(&tensors, true)?;
            prepared.finish(State { operation, tensors, kept }, output)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(operation.forward(&tensors, false)?.0),
    })
}

/// What the backward pass finds again.
#[derive(Clone, Debug)]
struct State<O: Operation<N>, const N: usize> {
    operation: O,
    tensors: [FlexTensor; N],
    kept: O::Kept,
}

/// The backward step of an operation.
#[derive(Debug)]
struct Step<O>(PhantomData<O>);

impl<O: Operation<N>, const N: usize> Backward<Flex, N> for Step<O> {
    type State = State<O, N>;

    fn backward(self, ops: Ops<Self::State, N>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let State { operation, tensors, kept } = ops.state;
        let output = flex::in_one_piece(gradients.consume::<Flex>(&ops.node));
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let found = operation.backward(&tensors, &kept, flex::numbers(&output), wanted);
        for ((parent, like), found) in ops.parents.iter().zip(&tensors).zip(found) {
            if let Some(parent) = parent {
                let found = flex::tensor(found, [like.layout().num_elements()]);
                gradients.register::<Flex>(parent.id, found.reshape(like.layout().shape().clone()));
            }
        }
    }
}
