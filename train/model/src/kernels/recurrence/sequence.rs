//! The GRU's arithmetic over a whole sequence, forward and backward through time.
//!
//! In: slices as documented at [`gru`](super::gru). Out: hidden states and what the backward pass needs; gradients.
//!
//! The batch is cut into lanes of at most [`ROWS`] sequences. A lane runs through all of time by itself, on one core, with the recurrent
//! weights in that core's cache; no step waits for another core. The weights' gradient is one product over all steps at the end.

use rayon::prelude::*;

use super::gates::{logistic, tanh};
use crate::kernels::{
    instructions::Instructions,
    memory::Buffer,
    product::{Left, PANEL},
};

/// Sequences of one lane: enough rows to keep the arithmetic units busy, few enough that a small batch uses all cores.
const ROWS: usize = 8;

/// Sizes of one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sizes {
    pub(super) length: usize,
    pub(super) batch: usize,
    pub(super) hidden: usize,
}

impl Sizes {
    fn panels(self) -> usize {
        self.hidden.div_ceil(PANEL)
    }

    fn padded(self) -> usize {
        self.panels() * PANEL
    }

    /// Numbers of `panel` that are not padding.
    fn width(self, panel: usize) -> usize {
        PANEL.min(self.hidden - panel * PANEL)
    }

    /// Where gate `gate` of `panel` lies in a `[length, batch, 3·hidden]` array.
    fn gate(self, t: usize, sequence: usize, gate: usize, panel: usize) -> std::ops::Range<usize> {
        let start = ((t * self.batch + sequence) * 3 + gate) * self.hidden + panel * PANEL;
        start..start + self.width(panel)
    }

    /// Where `panel` lies in a `[length, batch, hidden]` array.
    fn state(self, t: usize, sequence: usize, panel: usize) -> std::ops::Range<usize> {
        let start = (t * self.batch + sequence) * self.hidden + panel * PANEL;
        start..start + self.width(panel)
    }

    /// First sequence and number of sequences of each lane.
    fn lanes(self) -> Vec<[usize; 2]> {
        (0..self.batch).step_by(ROWS).map(|first| [first, ROWS.min(self.batch - first)]).collect()
    }
}

/// What a GRU computes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inputs<'a> {
    pub(super) gates: &'a [f32],
    pub(super) weight: &'a [f32],
    pub(super) bias: &'a [f32],
    pub(super) initial: &'a [f32],
    pub(super) keep: Option<&'a [f32]>,
}

/// Everything one lane computed: panels `[panels][length·rows, PANEL]`, row `t·rows + sequence`.
#[derive(Debug)]
pub(super) struct Lane {
    first: usize,
    rows: usize,
    /// States before each step, after `keep`.
    before: Buffer,
    reset: Buffer,
    update: Buffer,
    candidate: Buffer,
    /// The recurrent share of the candidate, `h·W_n + b_n`.
    inner: Buffer,
    after: Buffer,
}

/// Gradients, in the shapes of [`Inputs`].
#[derive(Debug)]
pub(super) struct Gradients {
    pub(super) gates: Vec<f32>,
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
    pub(super) initial: Vec<f32>,
}

type Vector = [f32; PANEL];

#[inline(always)]
fn padded(from: &[f32]) -> Vector {
    let mut vector = [0.0; PANEL];
    vector[..from.len()].copy_from_slice(from);
    vector
}

#[inline(always)]
fn panel(from: &[f32], at: usize) -> Vector {
    let mut vector = [0.0; PANEL];
    vector.copy_from_slice(&from[at..at + PANEL]);
    vector
}

/// All hidden states `[length, batch, hidden]`, and the lanes for [`backward`].
pub(super) fn forward(sizes: Sizes, inputs: Inputs<'_>, instructions: Instructions) -> (Vec<f32>, Vec<Lane>) {
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

/// Calls `visit(t, row, panel, place in the lane's panels)` for all of a lane.
fn for_each_panel(sizes: Sizes, lane: &Lane, mut visit: impl FnMut(usize, usize, usize, usize)) {
    for t in 0..sizes.length {
        for row in 0..lane.rows {
            for panel in 0..sizes.panels() {
                visit(t, row, panel, place(sizes, lane.rows, t, row, panel));
            }
        }
    }
}

#[inline(always)]
fn place(sizes: Sizes, rows: usize, t: usize, row: usize, panel: usize) -> usize {
    (panel * sizes.length * rows + t * rows + row) * PANEL
}

/// Recurrent weights in panels: `[3·panels][padded, PANEL]`.
fn packed(sizes: Sizes, weight: &[f32]) -> Buffer {
    let plane = sizes.padded() * PANEL;
    let mut packed = Buffer::zeros(3 * sizes.panels() * plane);
    packed.par_chunks_exact_mut(plane).enumerate().for_each(|(index, packed)| {
        let (gate, panel) = (index / sizes.panels(), index % sizes.panels());
        for (packed, weight) in packed.chunks_exact_mut(PANEL).zip(weight.chunks_exact(3 * sizes.hidden)) {
            let start = gate * sizes.hidden + panel * PANEL;
            packed[..sizes.width(panel)].copy_from_slice(&weight[start..start + sizes.width(panel)]);
        }
    });
    packed
}

/// The same turned round: `[panels][3·padded, PANEL]`.
fn packed_turned(sizes: Sizes, weight: &[f32]) -> Buffer {
    let plane = 3 * sizes.padded() * PANEL;
    let mut packed = Buffer::zeros(sizes.panels() * plane);
    packed.par_chunks_exact_mut(plane).enumerate().for_each(|(panel, packed)| {
        for lane in 0..sizes.width(panel) {
            let weight = &weight[(panel * PANEL + lane) * 3 * sizes.hidden..];
            for gate in 0..3 {
                for n in 0..sizes.hidden {
                    packed[(gate * sizes.padded() + n) * PANEL + lane] = weight[gate * sizes.hidden + n];
                }
            }
        }
    });
    packed
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
        let before = Left::<PANEL, 1> {
            data: &lane.before[t * rows * PANEL..],
            outer: sizes.panels(),
            outer_step: sizes.length * rows * PANEL,
            inner: PANEL,
        };
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
                _ => self::panel(&lane.after, place(sizes, lane.rows, t - 1, row, panel)),
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
                [0, 1, 2].map(|gate| self::panel(shares, ((gate * sizes.panels() + panel) * lane.rows + row) * PANEL));
            let before = self::panel(&lane.before, at);
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

/// Gradients from those of all hidden states, `[length, batch, hidden]`.
pub(super) fn backward(
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
        let shares = Left::<PANEL, 1> {
            data: &found.shares[t * rows * PANEL..],
            outer: 3 * sizes.panels(),
            outer_step: sizes.length * rows * PANEL,
            inner: PANEL,
        };
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
            let [before, reset, update, candidate, inner] = values.map(|values| self::panel(values, at));
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
