//! Backward through time.
//!
//! In: what the forward pass kept, and the gradient of all hidden states. Out: gradients of everything the GRU reads.

use rayon::prelude::*;

use super::weights::packed_turned;
use super::{Gradients, Inputs, Lane, Sizes, for_each_panel, padded, place};
use crate::kernels::{
    instructions::Instructions,
    memory::Buffer,
    product::{Left, PANEL},
};

/// Gradients from those of all hidden states, `[length, batch, hidden]`.
pub(in crate::kernels::recurrence) fn backward(
    sizes: Sizes,
    inputs: Inputs<'_>,
    lanes: &[Lane],
    states: &[f32],
    instructions: Instructions,
) -> Gradients {
    let weights = packed_turned(sizes, inputs.weight);
    let found: Vec<LaneGradients> =
        lanes.par_iter().map(|lane| unroll_lane(sizes, inputs.keep, &weights, lane, states, instructions)).collect();
    let mut gradients = Gradients {
        gates: vec![0.0; inputs.gates.len()],
        weight: weight_gradient(sizes, lanes, &found, instructions),
        bias: vec![0.0; inputs.bias.len()],
        initial: vec![0.0; inputs.initial.len()],
    };
    for (lane, found) in lanes.iter().zip(&found) {
        collect(sizes, lane, found, &mut gradients);
    }
    gradients
}

/// One lane's gradients: of the three recurrent shares `[3·panels][length·rows, PANEL]`, of the candidate's pre-activation
/// `[panels][…]`, and of the initial state `[panels][rows, PANEL]`.
struct LaneGradients {
    shares: Buffer,
    candidate: Buffer,
    initial: Buffer,
}

fn unroll_lane(
    sizes: Sizes,
    keep: Option<&[f32]>,
    weights: &[f32],
    lane: &Lane,
    states: &[f32],
    instructions: Instructions,
) -> LaneGradients {
    let rows = lane.rows;
    let whole = sizes.panels() * sizes.length * rows * PANEL;
    let mut found = LaneGradients {
        shares: Buffer::stale(3 * whole),
        candidate: Buffer::stale(whole),
        initial: Buffer::zeros(sizes.panels() * rows * PANEL),
    };
    for t in (0..sizes.length).rev() {
        instructions.run(
            #[inline(always)]
            || unstep(sizes, lane, states, &mut found, t),
        );
        let shares = &found.shares[t * rows * PANEL..];
        let shares = Left::<PANEL, 1>::lines(shares, 3 * sizes.panels(), sizes.length * rows * PANEL, PANEL);
        let panels = weights.chunks_exact(3 * sizes.padded() * PANEL).zip(found.initial.chunks_exact_mut(rows * PANEL));
        for (weights, carried) in panels {
            shares.times(weights, rows, carried, true, instructions);
            for (row, carried) in carried.chunks_exact_mut(PANEL).enumerate() {
                let keep = keep.map_or(1.0, |keep| keep[t * sizes.batch + lane.first + row]);
                carried.iter_mut().for_each(|carried| *carried = if keep == 0.0 { 0.0 } else { keep * *carried });
            }
        }
    }
    found
}

/// Step `t` backward. `found.initial` holds the gradient carried from the step after, and then this step's direct share of
/// the gradient of the state before it.
#[inline(always)]
fn unstep(sizes: Sizes, lane: &Lane, states: &[f32], found: &mut LaneGradients, t: usize) {
    let whole = sizes.panels() * sizes.length * lane.rows * PANEL;
    for row in 0..lane.rows {
        for panel in 0..sizes.panels() {
            let at = place(sizes, lane.rows, t, row, panel);
            let arriving = padded(&states[sizes.state(t, lane.first + row, panel)]);
            let values = [&lane.before, &lane.reset, &lane.update, &lane.candidate, &lane.inner];
            let [before, reset, update, candidate, inner] = values.map(|values| super::panel(values, at));
            let carried_at = (panel * lane.rows + row) * PANEL;
            let carried = &mut found.initial[carried_at..carried_at + PANEL];
            let mut made = [[0.0; PANEL]; 4];
            for i in 0..PANEL {
                let state = arriving[i] + carried[i];
                let d_candidate = state * (1.0 - update[i]) * (1.0 - candidate[i] * candidate[i]);
                made[0][i] = d_candidate * inner[i] * reset[i] * (1.0 - reset[i]);
                made[1][i] = state * (before[i] - candidate[i]) * update[i] * (1.0 - update[i]);
                made[2][i] = d_candidate * reset[i];
                made[3][i] = d_candidate;
                carried[i] = state * update[i];
            }
            let [reset, update, inner, candidate] = made;
            for (gate, made) in [reset, update, inner].iter().enumerate() {
                found.shares[gate * whole + at..][..PANEL].copy_from_slice(made);
            }
            found.candidate[at..at + PANEL].copy_from_slice(&candidate);
        }
    }
}

/// `[hidden, 3·hidden]`: states before each step, turned round, times gradients of their shares.
fn weight_gradient(sizes: Sizes, lanes: &[Lane], found: &[LaneGradients], instructions: Instructions) -> Vec<f32> {
    let columns: Vec<Buffer> = (0..3 * sizes.panels())
        .into_par_iter()
        .map(|column| {
            let mut sums = Buffer::zeros(sizes.padded() * PANEL);
            for (lane, found) in lanes.iter().zip(found) {
                let rows = sizes.length * lane.rows;
                let shares = &found.shares[column * rows * PANEL..][..rows * PANEL];
                for (before, sums) in lane.before.chunks_exact(rows * PANEL).zip(sums.chunks_exact_mut(PANEL * PANEL)) {
                    Left::turned(before, rows).times(shares, PANEL, sums, true, instructions);
                }
            }
            sums
        })
        .collect();
    let mut weight = vec![0.0; sizes.hidden * 3 * sizes.hidden];
    for (k, weight) in weight.chunks_exact_mut(3 * sizes.hidden).enumerate() {
        for (index, column) in columns.iter().enumerate() {
            let (gate, panel) = (index / sizes.panels(), index % sizes.panels());
            let width = sizes.width(panel);
            weight[gate * sizes.hidden + panel * PANEL..][..width]
                .copy_from_slice(&column[k * PANEL..k * PANEL + width]);
        }
    }
    weight
}

/// Puts a lane's gradients where they belong in the whole.
fn collect(sizes: Sizes, lane: &Lane, found: &LaneGradients, into: &mut Gradients) {
    let whole = sizes.panels() * sizes.length * lane.rows * PANEL;
    for_each_panel(sizes, lane, |t, row, panel, at| {
        let width = sizes.width(panel);
        for gate in 0..3 {
            let share = &found.shares[gate * whole + at..][..width];
            let given = if gate == 2 { &found.candidate[at..at + width] } else { share };
            into.gates[sizes.gate(t, lane.first + row, gate, panel)].copy_from_slice(given);
            let bias = &mut into.bias[gate * sizes.hidden + panel * PANEL..][..width];
            bias.iter_mut().zip(share).for_each(|(bias, share)| *bias += share);
        }
        if t == 0 {
            let carried = &found.initial[(panel * lane.rows + row) * PANEL..][..width];
            into.initial[sizes.state(0, lane.first + row, panel)].copy_from_slice(carried);
        }
    });
}
