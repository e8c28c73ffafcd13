//! The perceptron as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor with a hand-written backward pass, or `None` where the custom path does not apply. Rows are cut into lanes of a fixed
//! number, each on one core; gradients of weights are added up lane by lane, so that they do not depend on the number of threads.

use std::sync::Arc;

use burn::tensor::Tensor;
use burn_flex::FlexTensor;
use rayon::prelude::*;

use crate::kernels::LayerWeights;
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::operation::{Operand, Operation, run};
use crate::kernels::sheet::{Activation, Dense, LayerGradients, Sheet, add, panels, through_elu};

/// Rows of one lane, where there are many.
const ROWS: usize = 240;

/// Rows of one lane of so many: a few are cut in two, so that a single batch of windows keeps two cores busy. It depends on the rows alone, never on the cores.
fn lane_rows(rows: usize) -> usize {
    if rows > 2 * ROWS { ROWS } else { rows.div_ceil(2).max(32) }
}

/// Widths of input, hidden layers and output, and with which instructions it runs.
#[derive(Debug, Clone, Copy)]
struct Perceptron {
    rows: usize,
    widths: [usize; 4],
    instructions: Instructions,
}

/// What one lane computed.
#[derive(Debug)]
struct Lane {
    at: usize,
    count: usize,
    x: Sheet,
    hidden: [Sheet; 2],
}

/// The layers as the kernels read them, and what each lane computed.
#[derive(Debug)]
struct Kept {
    layers: [Dense; 3],
    lanes: Vec<Lane>,
}

/// See [`perceptron`](super::perceptron()); with given instructions.
pub(super) fn perceptron(x: Tensor<2>, layers: &[LayerWeights; 3], instructions: Instructions) -> Option<Tensor<2>> {
    let [rows, input] = x.dims();
    let widths = [input, layers[0].0.dims()[1], layers[1].0.dims()[1], layers[2].0.dims()[1]];
    for (layer, pair) in layers.iter().zip(widths.windows(2)) {
        assert_eq!(layer.0.dims(), [pair[0], pair[1]], "weights [input, output] that follow one another");
        assert_eq!(layer.1.dims(), [pair[1]], "a bias for every output");
    }
    let [(w1, b1), (w2, b2), (w3, b3)] = layers.clone();
    let weights =
        [Operand::of(w1)?, Operand::of(b1)?, Operand::of(w2)?, Operand::of(b2)?, Operand::of(w3)?, Operand::of(b3)?];
    let [w1, b1, w2, b2, w3, b3] = weights;
    run(Perceptron { rows, widths, instructions }, [Operand::of(x)?, w1, b1, w2, b2, w3, b3])
}

impl Perceptron {
    fn pack(&self, tensors: &[FlexTensor; 7], with_backward: bool) -> [Dense; 3] {
        [0, 1, 2].map(|layer| {
            let [weight, bias] = [1, 2].map(|offset| flex::numbers(&tensors[2 * layer + offset]));
            let (inputs, outputs) = (&self.widths[layer..=layer], &self.widths[layer + 1..layer + 2]);
            Dense::pack(weight, bias, inputs, outputs, with_backward)
        })
    }

    /// Runs the rows from `at` on, as many as `out` has room for.
    fn lane(&self, x: &[f32], layers: &[Dense; 3], at: usize, out: &mut [f32]) -> Lane {
        let Self { widths: [input, first, second, output], instructions, .. } = *self;
        let count = out.len() / output;
        let mut lane = Lane {
            at,
            count,
            x: Sheet::stale(panels(input), count),
            hidden: [Sheet::stale(panels(first), count), Sheet::stale(panels(second), count)],
        };
        lane.x.fill((0, 0, count), input, |row| &x[(at + row) * input..(at + row + 1) * input]);
        let mut last = Sheet::stale(panels(output), count);
        let [one, two] = &mut lane.hidden;
        layers[0].forward((&lane.x, 0, 0), (one, 0), count, Activation::Elu, instructions);
        layers[1].forward((one, 0, 0), (two, 0), count, Activation::Elu, instructions);
        layers[2].forward((two, 0, 0), (&mut last, 0), count, Activation::None, instructions);
        for (row, out) in out.chunks_exact_mut(output).enumerate() {
            last.read(0, row, output, out);
        }
        lane
    }
}

impl Operation<7> for Perceptron {
    type Kept = Arc<Kept>;

    /// `x`, then weight and bias of each layer.
    fn forward(&self, tensors: &[FlexTensor; 7], keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let layers = self.pack(tensors, keep);
        let (x, rows, output) = (flex::numbers(&tensors[0]), lane_rows(self.rows), self.widths[3]);
        let mut out = vec![0.0; self.rows * output];
        let pieces = out.par_chunks_mut(rows * output).enumerate();
        let lanes = pieces.map(|(lane, out)| self.lane(x, &layers, lane * rows, out)).collect();
        Some((flex::tensor(out, [self.rows, output]), Arc::new(Kept { layers, lanes })))
    }

    fn backward(&self, _: &[FlexTensor; 7], kept: &Self::Kept, output: &[f32], wanted: [bool; 7]) -> [Vec<f32>; 7] {
        let wanted = [wanted[0], wanted[1..].contains(&true)];
        let found: Vec<Found> =
            kept.lanes.par_iter().map(|lane| self.lane_backward(&kept.layers, lane, output, wanted)).collect();
        let mut lanes = found.into_iter();
        let Some(mut all) = lanes.next() else { return Default::default() };
        for lane in lanes {
            all.x.extend(lane.x);
            add(&mut all.layers, &lane.layers);
        }
        let [one, two, three] = all.layers;
        [all.x, one.0, one.1, two.0, two.1, three.0, three.1]
    }
}

/// What one lane finds.
struct Found {
    x: Vec<f32>,
    layers: LayerGradients,
}

impl Perceptron {
    fn lane_backward(
        &self,
        layers: &[Dense; 3],
        lane: &Lane,
        out: &[f32],
        [wants_x, wants_weights]: [bool; 2],
    ) -> Found {
        let (instructions, count, [input, first, second, output]) = (self.instructions, lane.count, self.widths);
        let mut last = Sheet::stale(panels(output), count);
        last.fill((0, 0, count), output, |row| &out[(lane.at + row) * output..(lane.at + row + 1) * output]);
        let mut two = Sheet::stale(panels(second), count);
        layers[2].backward((&last, 0), (&mut two, 0, 0), count, false, instructions);
        through_elu(&mut two, (&lane.hidden[1], 0), panels(second), count, instructions);
        let mut one = Sheet::stale(panels(first), count);
        layers[1].backward((&two, 0), (&mut one, 0, 0), count, false, instructions);
        through_elu(&mut one, (&lane.hidden[0], 0), panels(first), count, instructions);
        let mut found = Found { x: Vec::new(), layers: [const { (Vec::new(), Vec::new()) }; 3] };
        if wants_x {
            let mut x = Sheet::stale(panels(input), count);
            layers[0].backward((&one, 0), (&mut x, 0, 0), count, false, instructions);
            found.x = vec![0.0; count * input];
            found.x.chunks_exact_mut(input).enumerate().for_each(|(row, out)| x.read(0, row, input, out));
        }
        if wants_weights {
            let inputs = [&lane.x, &lane.hidden[0], &lane.hidden[1]];
            for (layer, (x, gradient)) in inputs.into_iter().zip([&one, &two, &last]).enumerate() {
                let (width, outputs) = (self.widths[layer], self.widths[layer + 1]);
                let (mut weight, mut bias) = (vec![0.0; width * outputs], vec![0.0; outputs]);
                layers[layer].learn((x, 0), gradient, count, (&mut weight, &mut bias), instructions);
                found.layers[layer] = (weight, bias);
            }
        }
        found
    }
}

/// Gradients of the sum of a perceptron's outputs: those of the input and of all weights and biases, where they are wanted.
#[cfg(test)]
pub(super) fn gradients(x: &[f32], layers: &[LayerWeights; 3], [wants_x, wants_weights]: [bool; 2]) -> [Vec<f32>; 7] {
    let widths = [0, 1, 2].map(|layer| layers[layer].0.dims());
    let [[input, first], [_, second], [_, output]] = widths;
    let rows = x.len() / input;
    let perceptron = Perceptron { rows, widths: [input, first, second, output], instructions: Instructions::best() };
    let held = |tensor: &Tensor<2>| flex::unfollowed(tensor.clone()).expect("a constant");
    let bias = |tensor: &Tensor<1>| flex::unfollowed(tensor.clone()).expect("a constant");
    let [(w1, b1), (w2, b2), (w3, b3)] = layers;
    let x = flex::tensor(x.to_vec(), [rows, input]);
    let tensors = [x, held(w1), bias(b1), held(w2), bias(b2), held(w3), bias(b3)];
    let (_, kept) = perceptron.forward(&tensors, true).expect("an output");
    let mut wanted = [wants_weights; 7];
    wanted[0] = wants_x;
    perceptron.backward(&tensors, &kept, &vec![1.0; rows * output], wanted)
}
