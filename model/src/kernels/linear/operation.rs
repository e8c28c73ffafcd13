//! The linear layer as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor with a hand-written backward pass, or `None` where the custom path does not apply. Every panel of a result is made by one
//! core from first to last, so results do not depend on the number of threads.

use std::sync::Arc;

use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::operation::{Operand, Operation, run};
use crate::kernels::sheet::{Dense, Sheet};

/// The layer's sizes, and with which instructions it runs.
#[derive(Debug, Clone, Copy)]
struct Linear {
    rows: usize,
    input: usize,
    output: usize,
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
    let linear = Linear { rows, input, output, instructions };
    run(linear, [Operand::of(x)?, Operand::of(weight)?, Operand::of(bias)?])
}

impl Operation<3> for Linear {
    type Kept = Arc<(Dense, Sheet)>;

    fn forward(&self, [x, weight, bias]: &[FlexTensor; 3], keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let Self { rows, input, output, instructions } = *self;
        let layer = Dense::pack(flex::numbers(weight), flex::numbers(bias), &[input], &[output], keep);
        let x = Sheet::of(flex::numbers(x), rows, input);
        let out = layer.forward_everywhere(&x, instructions);
        Some((flex::tensor(out.numbers(output), [rows, output]), Arc::new((layer, x))))
    }

    fn backward(
        &self,
        _: &[FlexTensor; 3],
        kept: &Self::Kept,
        output: &[f32],
        [wants_x, wants_weight, wants_bias]: [bool; 3],
    ) -> [Vec<f32>; 3] {
        let ((layer, x), instructions) = (&**kept, self.instructions);
        let output = Sheet::of(output, self.rows, self.output);
        let found_x = match wants_x {
            true => layer.backward_everywhere(&output, instructions).numbers(self.input),
            false => Vec::new(),
        };
        let (weight, bias) = match wants_weight || wants_bias {
            true => layer.learn_everywhere(x, &output, instructions),
            false => (Vec::new(), Vec::new()),
        };
        [found_x, weight, bias]
    }
}
