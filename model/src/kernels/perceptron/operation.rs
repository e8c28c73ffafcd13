//! The perceptron as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor with a hand-written backward pass, or `None` where the custom path does not apply. Rows are cut into lanes of a fixed
//! number, each on one core; gradients of weights are added up lane by lane, so that they do not depend on the number of threads.

use std::sync::Arc;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;
use rayon::prelude::*;

use super::LayerWeights;
use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;
use crate::kernels::sheet::{Activation, Dense, Sheet, panels, through_elu};

/// Rows of one lane, where there are many.
const ROWS: usize = 240;

/// Rows of one lane of so many: a few are cut in two, so that a single batch of windows keeps two cores busy. It depends on the rows alone, never on the cores.
fn lane_rows(rows: usize) -> usize {
    if rows > 2 * ROWS { ROWS } else { rows.div_ceil(2).max(32) }
}

/// Widths of input, hidden layers and output.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    rows: usize,
    widths: [usize; 4],
}

/// What one lane computed.
#[derive(Debug)]
struct Lane {
    at: usize,
    count: usize,
    x: Sheet,
    hidden: [Sheet; 2],
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    sizes: Sizes,
    /// `x`, then weight and bias of each layer; only their shapes are needed.
    tensors: [FlexTensor; 7],
    layers: Arc<[Dense; 3]>,
    lanes: Arc<Vec<Lane>>,
    instructions: Instructions,
}

/// See [`perceptron`](super::perceptron()); with given instructions.
pub(super) fn perceptron(x: Tensor<2>, layers: &[LayerWeights; 3], instructions: Instructions) -> Option<Tensor<2>> {
    let [rows, input] = x.dims();
    let widths = [input, layers[0].0.dims()[1], layers[1].0.dims()[1], layers[2].0.dims()[1]];
    for (layer, pair) in layers.iter().zip(widths.windows(2)) {
        assert_eq!(layer.0.dims(), [pair[0], pair[1]], "weights [input, output] that follow one another");
        assert_eq!(layer.1.dims(), [pair[1]], "a bias for every output");
    }
    let sizes = Sizes { rows, widths };
    let [(w1, b1), (w2, b2), (w3, b3)] = layers.clone();
    let devices = [x.device(), w1.device(), b1.device(), w2.device(), b2.device(), w3.device(), b3.device()];
    if devices.iter().any(burn::tensor::Device::is_autodiff) {
        let tensors = [
            flex::followed(x)?,
            flex::followed(w1)?,
            flex::followed(b1)?,
            flex::followed(w2)?,
            flex::followed(b2)?,
            flex::followed(w3)?,
            flex::followed(b3)?,
        ];
        return Some(Tensor::from_primitive::<Autodiff<Flex>>(record(sizes, tensors, instructions)));
    }
    let tensors = [
        flex::unfollowed(x)?,
        flex::unfollowed(w1)?,
        flex::unfollowed(b1)?,
        flex::unfollowed(w2)?,
        flex::unfollowed(b2)?,
        flex::unfollowed(w3)?,
        flex::unfollowed(b3)?,
    ];
    let layers = pack(sizes, &tensors, false);
    let (out, _) = forward(sizes, &tensors[0], &layers, instructions);
    Some(Tensor::from_primitive::<Flex>(out))
}

fn pack(Sizes { widths, .. }: Sizes, tensors: &[FlexTensor; 7], with_backward: bool) -> [Dense; 3] {
    [0, 1, 2].map(|layer| {
        let [weight, bias] = [1, 2].map(|offset| flex::numbers(&tensors[2 * layer + offset]));
        Dense::pack(weight, bias, &widths[layer..=layer], &widths[layer + 1..layer + 2], with_backward)
    })
}

fn forward(sizes: Sizes, x: &FlexTensor, layers: &[Dense; 3], instructions: Instructions) -> (FlexTensor, Vec<Lane>) {
    let x = flex::numbers(x);
    let [input, first, second, output] = sizes.widths;
    let mut out = vec![0.0; sizes.rows * output];
    let lanes = out
        .par_chunks_mut(lane_rows(sizes.rows) * output)
        .enumerate()
        .map(|(lane, out)| {
            let (at, count) = (lane * lane_rows(sizes.rows), out.len() / output);
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
        })
        .collect();
    (flex::tensor(out, [sizes.rows, output]), lanes)
}

/// Runs forward and records the backward step.
fn record(sizes: Sizes, tensors: [Followed; 7], instructions: Instructions) -> Followed {
    let nodes = tensors.each_ref().map(Followed::node);
    let tensors = tensors.map(|tensor| tensor.into_primitive().to_contiguous());
    let layers = pack(sizes, &tensors, true);
    let (out, lanes) = forward(sizes, &tensors[0], &layers, instructions);
    match Perceptron.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let (layers, lanes) = (Arc::new(layers), Arc::new(lanes));
            prepared.finish(Kept { sizes, tensors, layers, lanes, instructions }, out)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(out),
    }
}

/// The backward step.
#[derive(Debug)]
struct Perceptron;

/// What one lane finds.
struct Found {
    x: Vec<f32>,
    layers: [(Vec<f32>, Vec<f32>); 3],
}

impl Backward<Flex, 7> for Perceptron {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 7>, gradients: &mut grads::Gradients, _: &mut Checkpointer) {
        let kept = ops.state;
        let out = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let is_wanted = |parent: usize| ops.parents[parent].is_some();
        let wanted = [is_wanted(0), (1..7).any(is_wanted)];
        let found: Vec<Found> =
            kept.lanes.par_iter().map(|lane| lane_backward(&kept, lane, flex::numbers(&out), wanted)).collect();
        let mut lanes = found.into_iter();
        let Some(mut all) = lanes.next() else { return };
        for lane in lanes {
            all.x.extend(lane.x);
            for ((weight, bias), (more_weight, more_bias)) in all.layers.iter_mut().zip(lane.layers) {
                weight.iter_mut().zip(more_weight).for_each(|(sum, more)| *sum += more);
                bias.iter_mut().zip(more_bias).for_each(|(sum, more)| *sum += more);
            }
        }
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        let [one, two, three] = all.layers;
        flex::register(gradients, parents, &kept.tensors, [all.x, one.0, one.1, two.0, two.1, three.0, three.1]);
    }
}

fn lane_backward(kept: &Kept, lane: &Lane, out: &[f32], [wants_x, wants_weights]: [bool; 2]) -> Found {
    let Kept { sizes, layers, instructions, .. } = kept;
    let (instructions, count, [input, first, second, output]) = (*instructions, lane.count, sizes.widths);
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
            let (width, outputs) = (sizes.widths[layer], sizes.widths[layer + 1]);
            let (mut weight, mut bias) = (vec![0.0; width * outputs], vec![0.0; outputs]);
            layers[layer].learn((x, 0), gradient, count, (&mut weight, &mut bias), instructions);
            found.layers[layer] = (weight, bias);
        }
    }
    found
}
