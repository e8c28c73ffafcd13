//! What stands before the matches of queries that have all rows under other distractors as candidates.
//!
//! Which rows match is known beforehand, and so is how far off the first matches are. A sieve as that of `neighbours::search` (its scores, and its bound of
//! their rounding) passes over all rows that are farther in single precision, and knows most of those that are nearer; only where the rounding leaves it
//! open the distance itself is computed. A query that no longer finds its state, whatever is left out, is asked no further.

use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use super::without::{Cell, Place, Query};
use crate::invariance::Grid;
use crate::neighbours::Space;

/// Queries in a block.
const QUERIES: usize = 32;
/// Rows in a block.
const ROWS: usize = 1024;
/// Scores that are passed over at once where none of them is low enough.
const RUN: usize = 32;

/// The rows of a grid's cut: what is asked of them.
pub(super) struct Sieve<'s> {
    space: &'s Space<'s>,
    /// The steps' numbers, as the recording has them.
    steps: &'s [u32],
    states: usize,
    distractors: usize,
    k: usize,
    tolerance: u32,
    /// The relative error `e` of a score: it is off by at most `e(|x|² + |q|²)`.
    error: f64,
    /// `|x|²` of every row, less its share of the error.
    lower_norms: Vec<f32>,
}

/// A query on its way through the rows.
struct Asked {
    /// Its row.
    at: usize,
    query: Query,
    is_lost: bool,
    /// The error that comes from the query, `e |q|²`.
    slack: f64,
    /// What a candidate must score less than to stand before the first match, and before the second: their squared distances less `|q|²`.
    limits: [f64; 2],
    /// No candidate with a higher score stands before any match.
    bound: f32,
}

impl<'s> Sieve<'s> {
    pub(super) fn new(space: &'s Space<'s>, grid: &'s Grid<'_>, k: usize, tolerance: u32) -> Self {
        let (states, distractors) = (grid.states().len(), grid.distractors().len());
        let error = (space.table().dims() as f32 + 16.0) * f32::EPSILON;
        let lower_norm = |row: usize| space.prepared(row).iter().map(|x| x * x).sum::<f32>() * (1.0 - error);
        let lower_norms = (0..space.table().rows()).into_par_iter().map(lower_norm).collect();
        Self { space, steps: grid.steps(), states, distractors, k, tolerance, error: f64::from(error), lower_norms }
    }

    /// The steps that are near enough to a step, by their places.
    pub(super) fn in_reach(&self, step: usize) -> impl Iterator<Item = usize> {
        let own = self.steps[step];
        (0..self.steps.len()).filter(move |&other| self.steps[other].abs_diff(own) <= self.tolerance)
    }

    /// What stands before the matches of each query, a row each.
    pub(super) fn ask(&self, queries: &[usize]) -> impl ParallelIterator<Item = Query> {
        queries.par_chunks(QUERIES).flat_map_iter(move |queries| self.ask_block(queries))
    }

    fn ask_block(&self, queries: &[usize]) -> Vec<Query> {
        let (rows, dims) = (self.space.table().rows(), self.space.table().dims());
        let doubled: Vec<f32> = queries.iter().flat_map(|&row| self.space.prepared(row)).map(|x| -2.0 * x).collect();
        let mut asked: Vec<Asked> = queries.iter().map(|&row| self.asked(row)).collect();
        let (mut points, mut scores) = (Vec::<f32>::with_capacity(ROWS * dims), vec![0.0_f32; queries.len() * ROWS]);
        for first in (0..rows).step_by(ROWS) {
            let last = rows.min(first + ROWS);
            points.clear();
            (first..last).for_each(|row| points.extend_from_slice(self.space.prepared(row)));
            let scores = &mut scores[..queries.len() * (last - first)];
            self.score(&doubled, &points, first, scores);
            for (asked, scores) in asked.iter_mut().zip(scores.chunks_exact(last - first)) {
                self.scan(asked, scores, first);
            }
            if asked.iter().all(|asked| asked.is_lost) {
                break;
            }
        }
        asked.into_iter().map(|asked| asked.query).collect()
    }

    /// `scores[q, x] = |x|² - 2 x·q` of the rows from `first` on, `points`, for queries that are `doubled` already, less the rows' share of the error.
    fn score(&self, doubled: &[f32], points: &[f32], first: usize, scores: &mut [f32]) {
        let dims = self.space.table().dims();
        let (queries, width) = (doubled.len() / dims, points.len() / dims);
        let lower_norms = &self.lower_norms[first..first + width];
        scores.chunks_exact_mut(width).for_each(|line| line.copy_from_slice(lower_norms));
        let left = ArrayView2::from_shape((queries, dims), doubled);
        let right = ArrayView2::from_shape((width, dims), points);
        let product = ArrayViewMut2::from_shape((queries, width), scores);
        if let (Ok(left), Ok(right), Ok(mut product)) = (left, right, product) {
            general_mat_mul(1.0, &left, &right.t(), 1.0, &mut product);
        }
    }

    fn asked(&self, at: usize) -> Asked {
        let query = Query::new(self.k, self.cell(at), [self.states, self.distractors], &self.matches(at));
        let norm: f64 = self.space.prepared(at).iter().map(|&x| f64::from(x) * f64::from(x)).sum();
        let slack = self.error * norm;
        let (first, second) = query.matches();
        let limits = [first, second.unwrap_or(first)].map(|place| place.distance * place.distance - norm);
        // The second match is never before the first.
        let bound = ((limits[1] + slack) as f32).next_up();
        Asked { at, query, is_lost: false, slack, limits, bound }
    }

    /// The rows that match the row of a query, and their distractors.
    fn matches(&self, at: usize) -> Vec<(Place, usize)> {
        let (own, steps) = (self.cell(at), self.steps.len());
        let others = (0..self.distractors).filter(|&other| other != own.distractor);
        let matches = others.flat_map(move |other| self.in_reach(at % steps).map(move |step| (other, step)));
        let place = |(distractor, step): (usize, usize)| {
            let row = (own.state * self.distractors + distractor) * steps + step;
            (Place { distance: self.space.distance(at, row), row }, distractor)
        };
        matches.map(place).collect()
    }

    /// Counts those of a block's rows that stand before a match; most runs hold none and are passed over at once.
    fn scan(&self, asked: &mut Asked, scores: &[f32], first: usize) {
        if asked.is_lost {
            return;
        }
        let bound = asked.bound;
        for (run, scores) in scores.chunks(RUN).enumerate() {
            let least = scores.iter().fold(f32::INFINITY, |least, &score| if score < least { score } else { least });
            if least > bound {
                continue;
            }
            for (at, &score) in scores.iter().enumerate().filter(|(_, score)| **score <= bound) {
                self.count(asked, first + run * RUN + at, f64::from(score));
            }
        }
        asked.is_lost = asked.query.is_lost();
    }

    fn count(&self, asked: &mut Asked, row: usize, score: f64) {
        let cell = self.cell(row);
        if cell.distractor == asked.query.cell().distractor {
            return;
        }
        let low = score - asked.slack;
        let high = score + asked.slack + 2.02 * self.error * f64::from(self.lower_norms[row]);
        if high < asked.limits[0] {
            asked.query.count_as(cell, true, true);
        } else if low > asked.limits[0] && high < asked.limits[1] {
            asked.query.count_as(cell, false, true);
        } else if low <= asked.limits[1] {
            asked.query.count(Place { distance: self.space.distance(asked.at, row), row }, cell);
        }
    }

    /// The cell of a row of the cut.
    fn cell(&self, row: usize) -> Cell {
        let cell = row / self.steps.len();
        Cell { state: cell / self.distractors, distractor: cell % self.distractors }
    }
}

#[cfg(test)]
mod tests;
