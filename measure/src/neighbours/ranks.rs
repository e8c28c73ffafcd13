//! Ranks of given rows: how many rows are nearer to a query. By matrix products in single precision, as the sieve of `search`; only rows whose distance is within
//! its rounding error of a row in question are compared by themselves.

use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use super::Space;

/// Queries in a block.
const QUERIES: usize = 64;
/// Rows in a block.
const ROWS: usize = 1024;
/// Numbers compared at once.
const LANES: usize = 8;

impl Space<'_> {
    /// The rank of each of `rows[q]` among all rows by distance to `queries[q]` (1 for the nearest; the query itself does not count), in single precision:
    /// `[queries]` lists, sorted by rank.
    #[must_use]
    pub fn ranks(&self, queries: &[usize], rows: &[Vec<u32>]) -> Vec<Vec<u64>> {
        let norms: Vec<f32> = self.points().par_chunks(self.table().dims()).map(norm).collect();
        let blocks = queries.par_chunks(QUERIES).zip(rows.par_chunks(QUERIES));
        blocks.flat_map_iter(|(queries, rows)| self.ranks_of_block(queries, rows, &norms)).collect()
    }

    fn ranks_of_block(&self, queries: &[usize], wanted: &[Vec<u32>], norms: &[f32]) -> Vec<Vec<u64>> {
        let (dims, all) = (self.table().dims(), self.table().rows());
        let doubled: Vec<f32> = queries.iter().flat_map(|&row| self.prepared(row)).map(|x| -2.0 * x).collect();
        let mut lists: Vec<List> =
            queries.iter().zip(wanted).map(|(&query, rows)| List::new(self, query, rows, norms)).collect();
        let mut scores = vec![0.0_f32; queries.len() * ROWS];
        for first in (0..all).step_by(ROWS) {
            let last = all.min(first + ROWS);
            let width = last - first;
            let scores = &mut scores[..queries.len() * width];
            scores.chunks_exact_mut(width).for_each(|line| line.copy_from_slice(&norms[first..last]));
            let left = ArrayView2::from_shape((queries.len(), dims), &doubled);
            let block = ArrayView2::from_shape((width, dims), &self.points()[first * dims..last * dims]);
            let product = ArrayViewMut2::from_shape((queries.len(), width), &mut *scores);
            if let (Ok(left), Ok(block), Ok(mut product)) = (left, block, product) {
                general_mat_mul(1.0, &left, &block.t(), 1.0, &mut product);
            }
            for (line, list) in scores.chunks_exact(width).zip(&mut lists) {
                list.count(self, line, first, norms);
            }
        }
        lists.into_iter().map(List::finish).collect()
    }
}

fn norm(point: &[f32]) -> f32 {
    point.iter().map(|x| x * x).sum()
}

/// The rows in question of one query.
struct List {
    query: usize,
    /// Their squared distances, rising, and infinities up to a whole number of lanes.
    squared: Vec<f32>,
    /// The largest that is finite.
    farthest: f32,
    /// The query's squared norm, which scores lack.
    norm: f32,
    /// Relative error of a score.
    error: f32,
    /// How many rows are nearer than the i-th but not than the one before it.
    nearer: Vec<u64>,
}

impl List {
    fn new(space: &Space<'_>, query: usize, rows: &[u32], norms: &[f32]) -> Self {
        let mut squared: Vec<f32> = rows.iter().map(|&row| space.squared_prepared(query, row as usize)).collect();
        squared.sort_unstable_by(f32::total_cmp);
        let error = (space.table().dims() as f32 + 16.0) * f32::EPSILON;
        let (nearer, farthest) = (vec![0; squared.len()], squared.last().copied().unwrap_or(f32::NEG_INFINITY));
        squared.resize(squared.len().next_multiple_of(LANES), f32::INFINITY);
        Self { query, norm: norms[query], error, nearer, squared, farthest }
    }

    /// Count the rows of a block that are nearer than one in question.
    fn count(&mut self, space: &Space<'_>, scores: &[f32], first: usize, norms: &[f32]) {
        for (at, &score) in scores.iter().enumerate() {
            let row = first + at;
            let slack = 2.0 * self.error * (norms[row] + self.norm);
            let squared = score + self.norm;
            if squared > self.farthest + slack || row == self.query {
                continue;
            }
            let (mut place, close) = self.place(squared, slack);
            if close {
                place = self.place(space.squared_prepared(self.query, row), 0.0).0;
            }
            if place < self.nearer.len() {
                self.nearer[place] += 1;
            }
        }
    }

    /// How many of the rows in question are as near or nearer, and whether one of them is within `slack`: over whole lanes, without a branch.
    fn place(&self, squared: f32, slack: f32) -> (usize, bool) {
        let (mut counts, mut close) = ([0_u32; LANES], [false; LANES]);
        for lanes in self.squared.chunks_exact(LANES) {
            for lane in 0..LANES {
                counts[lane] += u32::from(lanes[lane] <= squared);
                close[lane] |= (lanes[lane] - squared).abs() <= slack;
            }
        }
        (counts.iter().sum::<u32>() as usize, close.contains(&true))
    }

    fn finish(self) -> Vec<u64> {
        let ranks = self.nearer.iter().scan(0, |rank, nearer| {
            *rank += nearer;
            Some(*rank + 1)
        });
        ranks.collect()
    }
}
