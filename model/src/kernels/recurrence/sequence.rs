//! The GRU's arithmetic over a whole sequence, forward and backward through time.
//!
//! In: slices as documented at [`gru`](super::gru). Out: hidden states and what the backward pass needs; gradients.
//!
//! The batch is cut into lanes of at most [`ROWS`] sequences. A lane runs through all of time by itself, on one core, with the recurrent
//! weights in that core's cache; no step waits for another core. The weights' gradient is one product over all steps at the end.

use crate::kernels::memory::Buffer;
use crate::kernels::product::PANEL;

mod backward;
mod forward;
mod weights;

pub(super) use backward::backward;
pub(super) use forward::forward;

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
