//! The GRU as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`sequence::backward`], or `None` where the custom path does not apply.

use std::sync::Arc;

use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::sequence::{self, Inputs, Lane, Sizes};
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::operation::{Operand, Operation, run};

/// The sizes, where states are kept, and with which instructions it runs.
#[derive(Clone, Debug)]
struct Gru {
    sizes: Sizes,
    keep: Option<FlexTensor>,
    instructions: Instructions,
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
    let operands = [Operand::of(gates)?, Operand::of(weight)?, Operand::of(bias)?, Operand::of(initial)?];
    run(Gru { sizes, keep, instructions }, operands)
}

impl Gru {
    fn inputs<'a>(&'a self, tensors: &'a [FlexTensor; 4]) -> Inputs<'a> {
        let [gates, weight, bias, initial] = tensors.each_ref().map(flex::numbers);
        Inputs { gates, weight, bias, initial, keep: self.keep.as_ref().map(flex::numbers) }
    }
}

impl Operation<4> for Gru {
    type Kept = Arc<Vec<Lane>>;

    fn forward(&self, tensors: &[FlexTensor; 4], _keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let Sizes { length, batch, hidden } = self.sizes;
        let (states, lanes) = sequence::forward(self.sizes, self.inputs(tensors), self.instructions);
        Some((flex::tensor(states, [length, batch, hidden]), Arc::new(lanes)))
    }

    fn backward(
        &self,
        tensors: &[FlexTensor; 4],
        lanes: &Self::Kept,
        output: &[f32],
        _wanted: [bool; 4],
    ) -> [Vec<f32>; 4] {
        let found = sequence::backward(self.sizes, self.inputs(tensors), lanes, output, self.instructions);
        [found.gates, found.weight, found.bias, found.initial]
    }
}
