//! Forward through time.
//!
//! In: inputs. Out: all hidden states, and each lane's values for the backward pass.

use rayon::prelude::*;

use super::weights::packed;
use super::{Inputs, Lane, Sizes, for_each_panel, padded, place};
use crate::kernels::recurrence::gates::{logistic, tanh};
use crate::kernels::{
    instructions::Instructions,
    memory::Buffer,
    product::{Left, PANEL},
};

/// All hidden states `[length, batch, hidden]`, and the lanes for the pass backward.
pub(in crate::kernels::recurrence) fn forward(
    sizes: Sizes,
    inputs: Inputs<'_>,
    instructions: Instructions,
) -> (Vec<f32>, Vec<Lane>) {
    let weights = packed(sizes, inputs.weight);
    let lanes: Vec<Lane> =
        sizes.lanes().into_par_iter().map(|lane| run_lane(sizes, inputs, &weights, lane, instructions)).collect();
    let mut states = vec![0.0; sizes.length * sizes.batch * sizes.hidden];
    for lane in &lanes {
        for_each_panel(sizes, lane, |t, row, panel, at| {
            let states = &mut states[sizes.state(t, lane.first + row, panel)];
            states.copy_from_slice(&lane.after[at..at + states.len()]);
        });
    }
    (states, lanes)
}

fn run_lane(
    sizes: Sizes,
    inputs: Inputs<'_>,
    weights: &[f32],
    [first, rows]: [usize; 2],
    instructions: Instructions,
) -> Lane {
    let stale = || Buffer::stale(sizes.panels() * sizes.length * rows * PANEL);
    let mut lane = Lane {
        first,
        rows,
        before: stale(),
        reset: stale(),
        update: stale(),
        candidate: stale(),
        inner: stale(),
        after: stale(),
    };
    let mut shares = Buffer::stale(3 * sizes.panels() * rows * PANEL);
    for t in 0..sizes.length {
        enter_step(sizes, inputs, &mut lane, t);
        let before = &lane.before[t * rows * PANEL..];
        let before = Left::<PANEL, 1>::lines(before, sizes.panels(), sizes.length * rows * PANEL, PANEL);
        for (weights, share) in weights.chunks_exact(sizes.padded() * PANEL).zip(shares.chunks_exact_mut(rows * PANEL))
        {
            before.times(weights, rows, share, false, instructions);
        }
        instructions.run(
            #[inline(always)]
            || step(sizes, inputs, &shares, &mut lane, t),
        );
    }
    lane
}

/// The state before step `t`: the one after the last step, or nothing where an episode starts.
fn enter_step(sizes: Sizes, inputs: Inputs<'_>, lane: &mut Lane, t: usize) {
    for row in 0..lane.rows {
        let keep = inputs.keep.map_or(1.0, |keep| keep[t * sizes.batch + lane.first + row]);
        for panel in 0..sizes.panels() {
            let last = match t {
                0 => padded(&inputs.initial[sizes.state(0, lane.first + row, panel)]),
                _ => super::panel(&lane.after, place(sizes, lane.rows, t - 1, row, panel)),
            };
            let at = place(sizes, lane.rows, t, row, panel);
            for (before, last) in lane.before[at..at + PANEL].iter_mut().zip(last) {
                // A product with 0 would carry on a NaN of the episode before.
                *before = if keep == 0.0 { 0.0 } else { keep * last };
            }
        }
    }
}

/// Gates and new states of step `t`; `shares` are the states' shares of the three gates.
#[inline(always)]
fn step(sizes: Sizes, inputs: Inputs<'_>, shares: &[f32], lane: &mut Lane, t: usize) {
    for row in 0..lane.rows {
        for panel in 0..sizes.panels() {
            let at = place(sizes, lane.rows, t, row, panel);
            let given = [0, 1, 2].map(|gate| padded(&inputs.gates[sizes.gate(t, lane.first + row, gate, panel)]));
            let bias = [0, 1, 2].map(|gate| {
                let start = gate * sizes.hidden + panel * PANEL;
                padded(&inputs.bias[start..start + sizes.width(panel)])
            });
            let share =
                [0, 1, 2].map(|gate| super::panel(shares, ((gate * sizes.panels() + panel) * lane.rows + row) * PANEL));
            let before = super::panel(&lane.before, at);
            let mut made = [[0.0; PANEL]; 5];
            for i in 0..PANEL {
                let reset = logistic(given[0][i] + share[0][i] + bias[0][i]);
                let update = logistic(given[1][i] + share[1][i] + bias[1][i]);
                let inner = share[2][i] + bias[2][i];
                let candidate = tanh(given[2][i] + reset * inner);
                made[0][i] = reset;
                made[1][i] = update;
                made[2][i] = inner;
                made[3][i] = candidate;
                made[4][i] = candidate + update * (before[i] - candidate);
            }
            let places = [&mut lane.reset, &mut lane.update, &mut lane.inner, &mut lane.candidate, &mut lane.after];
            for (place, made) in places.into_iter().zip(&made) {
                place[at..at + PANEL].copy_from_slice(made);
            }
        }
    }
}
