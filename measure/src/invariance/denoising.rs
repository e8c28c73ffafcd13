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

use rand::Rng;
use rayon::prelude::*;

use super::Grid;
use super::retrieval::Cut;
use crate::Error;
use crate::intervals::Interval;
use crate::neighbours::{Metric, Space};

/// Pairs of latents compared at most; of a larger grid every so many-th step is taken.
const PAIRS: usize = 200_000_000;

/// The denoising factor, with an interval over state and distractor trajectories (of the anchors).
///
/// # Errors
/// Latents that do not vary.
pub fn denoising_factor(grid: &Grid<'_>, rng: &mut impl Rng) -> Result<Interval, Error> {
    let (distractors, steps) = (grid.distractors().len(), grid.steps().len());
    let cells = grid.states().len() * distractors;
    let cut = Cut::new(grid);
    let space = Space::new(cut.table()?, Metric::Euclidean)?;
    let every = (cells * cells * steps).div_ceil(PAIRS);
    let anchors: Vec<usize> = (0..cells * steps).filter(|at| at % steps % every == 0).collect();
    let distances = |&anchor: &usize| {
        let (cell, step) = (anchor / steps, anchor % steps);
        let (mut same, mut other) = (0.0, 0.0);
        for candidate in (0..cells).filter(|&candidate| candidate != cell) {
            let distance = space.distance(anchor, candidate * steps + step);
            if candidate / distractors == cell / distractors { same += distance } else { other += distance }
        }
        (same / (distractors - 1) as f64, other / (cells - distractors) as f64)
    };
    let (positive, negative): (Vec<f64>, Vec<f64>) = anchors.par_iter().map(distances).unzip();
    let above: Vec<f64> = negative.iter().zip(&positive).map(|(negative, positive)| negative - positive).collect();
    let below: Vec<f64> = negative.iter().zip(&positive).map(|(negative, positive)| negative + positive).collect();
    Ok(cut.table()?.trajectories().ratio(&anchors, &above, &below, rng))
}
