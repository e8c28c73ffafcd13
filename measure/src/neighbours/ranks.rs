//! Ranks of given rows: how many rows are nearer to a query. By matrix products in single precision, as the sieve of `search`, and then by comparing whole
//! runs of scores with one row in question after the other, which processors do many at a time; only rows whose distance is within the rounding error
//! of a row in question are compared by themselves.
#![allow(unsafe_code, reason = "wider instructions are called once the processor is known to have them")]

use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use super::Space;

/// Queries in a block.
const QUERIES: usize = 64;
/// Rows in a block.
const ROWS: usize = 1024;
/// Scores in a run: they stay in the first-level cache while every row in question is compared with them.
const RUN: usize = 256;

impl Space<'_> {
    /// The rank of each of `rows[q]` among all rows by distance to `queries[q]` (1 for the nearest; the query itself does not count), in single precision:
    /// `[queries]` lists, sorted by rank.
    #[must_use]
    pub fn ranks(&self, queries: &[usize], rows: &[Vec<u32>]) -> Vec<Vec<u64>> {
        let norms = self.squared_lengths();
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
            let largest = norms[first..last].iter().copied().fold(0.0, f32::max);
            for (line, list) in scores.chunks_exact(width).zip(&mut lists) {
                for (run, scores) in line.chunks(RUN).enumerate() {
                    list.count(self, scores, first + run * RUN, largest);
                }
            }
        }
        lists.into_iter().map(List::finish).collect()
    }
}

/// The rows in question of one query.
struct List {
    query: usize,
    /// Their squared distances, rising.
    squared: Vec<f32>,
    /// The query's squared norm, which scores lack.
    norm: f32,
    /// Relative error of a score.
    error: f32,
    /// How many rows are nearer than each of them.
    nearer: Vec<u64>,
}

impl List {
    fn new(space: &Space<'_>, query: usize, rows: &[u32], norms: &[f32]) -> Self {
        let mut squared: Vec<f32> = rows.iter().map(|&row| space.squared_prepared(query, row as usize)).collect();
        squared.sort_unstable_by(f32::total_cmp);
        let error = (space.table().dims() as f32 + 16.0) * f32::EPSILON;
        Self { query, norm: norms[query], error, nearer: vec![0; squared.len()], squared }
    }

    /// Counts the rows of a run that are nearer than each row in question; `largest` is at least the largest squared norm among them.
    fn count(&mut self, space: &Space<'_>, scores: &[f32], first: usize, largest: f32) {
        let slack = 2.0 * self.error * (largest + self.norm);
        let least = scores.iter().fold(f32::INFINITY, |least, &score| if score < least { score } else { least });
        // From the farthest on: where no score is near enough, none is for those before it.
        for (squared, nearer) in self.squared.iter().zip(&mut self.nearer).rev() {
            let (low, high) = (squared - self.norm - slack, squared - self.norm + slack);
            if least > high {
                return;
            }
            let (surely, perhaps) = below(scores, low, high);
            *nearer += u64::from(surely);
            if surely == perhaps {
                continue;
            }
            let close = scores.iter().enumerate().filter(|&(_, &score)| score >= low && score <= high);
            let is_nearer = |at: usize| space.squared_prepared(self.query, first + at) < *squared;
            *nearer += close.filter(|&(at, _)| is_nearer(at)).count() as u64;
        }
    }

    /// The ranks. The query was counted as a row at no distance.
    fn finish(self) -> Vec<u64> {
        let itself = |squared: f32| u64::from(0.0 < squared);
        self.nearer.iter().zip(&self.squared).map(|(nearer, &squared)| nearer - itself(squared) + 1).collect()
    }
}

/// How many scores are below `low`, and how many are not above `high`.
fn below(scores: &[f32], low: f32, high: f32) -> (u32, u32) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function asks for.
        return unsafe { below_avx2(scores, low, high) };
    }
    below_portable(scores, low, high)
}

#[inline(always)]
fn below_portable(scores: &[f32], low: f32, high: f32) -> (u32, u32) {
    scores
        .iter()
        .fold((0, 0), |(surely, perhaps), &score| (surely + u32::from(score < low), perhaps + u32::from(score <= high)))
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn below_avx2(scores: &[f32], low: f32, high: f32) -> (u32, u32) {
    below_portable(scores, low, high)
}
