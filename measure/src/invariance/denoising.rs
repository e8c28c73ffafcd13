//! The denoising factor: how much farther other states are than other views of the same state (Luo et al., 2025, arXiv 2506.00563).
//!
//! ```text
//! (d_neg - d_pos) / (d_neg + d_pos)
//! ```
//!
//! There an anchor is compared with some re-noised copies of its state and with some other states; a grid holds all of them, so that the number is exact:
//! at every step, `d_pos` is the mean L2 distance of a cell to the cells of the same state under the other distractors, `d_neg` to all cells of
//! other states, both means over all cells and steps, of the latents as they are (not standardized). 1 for a latent that ignores distractors, 0 for
//! one that ignores the state or is noise, below 0 for one that holds the distractors alone.
//!
//! A trajectory is one end of a pair as often as the other, so that for the interval its cells are left out as anchors and as what anchors are compared with.
//! Three sums for each cell are enough for that, whatever the size of the grid: distances are the same in both directions, so that those to a line of cells
//! are those from it, and only pairs within a left-out distractor are counted on both sides.

use rayon::prelude::*;

use super::Grid;
use super::retrieval::Cut;
use crate::Error;
use crate::intervals::{Interval, Range, crossed};
use crate::neighbours::{Metric, Space};

/// Pairs of latents compared at most; of a larger grid every so many-th step is taken.
const PAIRS: usize = 200_000_000;

/// What is left of a sum without one of its parts is more than this share of it, or nothing at all.
const ROUNDING: f64 = 1e-12;

/// The denoising factor, with an interval over state and distractor trajectories: each is left out in turn, as anchor and as what anchors are compared with
/// (see [`crossed`]). None with fewer than three of either kind.
///
/// # Errors
/// Latents that do not vary.
pub fn denoising_factor(grid: &Grid<'_>) -> Result<Interval, Error> {
    let (states, distractors, steps) = (grid.states().len(), grid.distractors().len(), grid.steps().len());
    let cells = states * distractors;
    let cut = Cut::new(grid);
    let space = Space::new(cut.table()?, Metric::Euclidean)?;
    let every = (cells * cells * steps).div_ceil(PAIRS);
    let anchors: Vec<usize> = (0..cells * steps).filter(|at| at % steps % every == 0).collect();
    let size = [states, distractors, steps];
    let sums: Vec<Sums> = anchors.par_iter().map(|&anchor| Sums::of(&space, size, anchor)).collect();
    let of_cells: Vec<&[Sums]> = sums.chunks(steps.div_ceil(every)).collect();
    let estimate = estimate(&of_cells, (distractors - 1) as f64, (cells - distractors) as f64);
    let of_cells: Vec<Sums> = of_cells.iter().map(|steps| total(steps.iter())).collect();
    let [by_state, by_distractor] = without(&of_cells, [states, distractors]);
    Ok(crossed(estimate, [&by_state, &by_distractor], Range::Signed))
}

/// Of one anchor or of many: sums of distances to cells at the same step.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// To those of the same state.
    same: f64,
    /// To those of other states.
    other: f64,
    /// To those of other states under the anchor's own distractor.
    along: f64,
}

impl Sums {
    /// Of the anchor at this position among `[states, distractors, steps]`.
    fn of(space: &Space<'_>, [states, distractors, steps]: [usize; 3], anchor: usize) -> Self {
        let (cell, step) = (anchor / steps, anchor % steps);
        let mut sums = Self::default();
        for state in 0..states {
            for distractor in 0..distractors {
                let candidate = state * distractors + distractor;
                if candidate == cell {
                    continue;
                }
                let distance = space.distance(anchor, candidate * steps + step);
                if state == cell / distractors {
                    sums.same += distance;
                    continue;
                }
                sums.other += distance;
                if distractor == cell % distractors {
                    sums.along += distance;
                }
            }
        }
        sums
    }
}

fn total<'s>(sums: impl Iterator<Item = &'s Sums>) -> Sums {
    sums.fold(Sums::default(), |all, one| Sums {
        same: all.same + one.same,
        other: all.other + one.other,
        along: all.along + one.along,
    })
}

/// The number itself, of the anchors of each cell: an anchor has so many others of its state, and of other states.
fn estimate(of_cells: &[&[Sums]], of_same: f64, of_other: f64) -> f64 {
    let over = |sign: f64| {
        let of_anchor = |sums: &Sums| sums.other / of_other + sign * (sums.same / of_same);
        let of_cell = |anchors: &&[Sums]| anchors.iter().fold(0.0, |sum, anchor| sum + of_anchor(anchor));
        of_cells.iter().map(of_cell).sum::<f64>()
    };
    over(-1.0) / over(1.0)
}

/// The factor of the grid without each state, and without each distractor, from the sums of each cell.
fn without(of_cells: &[Sums], [states, distractors]: [usize; 2]) -> [Vec<f64>; 2] {
    let all = total(of_cells.iter());
    let (n, m) = (states as f64, distractors as f64);
    let left = |whole: f64, out: f64| if whole - out > ROUNDING * whole { whole - out } else { 0.0 };
    let factor = |positive: f64, negative: f64| (negative - positive) / (negative + positive);
    // Pairs of one state are its own. Of pairs of two states it is the anchor in as many as it is not.
    let without_state = |state: usize| {
        let out = total(of_cells[state * distractors..(state + 1) * distractors].iter());
        factor(left(all.same, out.same) / (m - 1.0), left(all.other, 2.0 * out.other) / ((n - 2.0) * m))
    };
    // A distractor is never both ends of a pair of one state, but is both ends of the pairs along it, which are taken off once.
    let without_distractor = |distractor: usize| {
        let out = total(of_cells.iter().skip(distractor).step_by(distractors));
        let negative = left(all.other, 2.0 * out.other - out.along) / ((n - 1.0) * (m - 1.0));
        factor(left(all.same, 2.0 * out.same) / (m - 2.0), negative)
    };
    [(0..states).map(without_state).collect(), (0..distractors).map(without_distractor).collect()]
}
