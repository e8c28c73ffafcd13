//! The sieve: which rows could be among a query's `k` nearest, by matrix products in single precision.
//!
//! With prepared points, `|x - q|² - |q|² = |x|² - 2 x·q`: one matrix product per block of queries and block of rows.
//! The computed value differs from the true one by at most `e(|x|² + |q|²)` with `e = 2 (dims + 16) u`, `u` the unit
//! roundoff. A row is kept while its lower bound is no more than the `k`-th smallest upper bound.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use super::Space;
use crate::Error;

/// Queries in a block.
const QUERIES: usize = 64;
/// Rows in a block: with `QUERIES`, the scores stay in the second-level cache.
const ROWS: usize = 1024;
/// Few queries are spread over the cores by cutting the rows into slabs of this many.
const SLAB: usize = 16 * ROWS;

/// The `k` nearest rows of each prepared query point `[queries, dims]`, or all admissible ones if they are fewer.
///
/// A row whose entry in `labels` equals the query's in `barred` is left out. `distance(query, row)` is the exact one.
pub(super) fn nearest(
    space: &Space<'_>,
    points: &[f32],
    barred: &[Option<u32>],
    labels: &[u32],
    k: usize,
    distance: impl Fn(usize, usize) -> f64 + Sync,
) -> Result<Vec<Vec<(f64, u32)>>, Error> {
    if k == 0 {
        return Err(Error::Option { option: "neighbours", value: k.to_string(), must: "at least 1" });
    }
    let (rows, dims) = (space.table().rows(), space.table().dims());
    let mut sieve = Sieve::new(space, labels, k);
    if barred.len() >= MANY {
        sieve.equals = equals(space);
    }
    let slab = if barred.len() >= 16 * QUERIES { rows } else { SLAB };
    let slabs: Vec<(usize, usize)> = (0..rows).step_by(slab).map(|from| (from, rows.min(from + slab))).collect();
    let blocks: Vec<usize> = (0..barred.len()).step_by(QUERIES).collect();
    let found = blocks.par_iter().flat_map_iter(|&first| {
        let last = barred.len().min(first + QUERIES);
        let sift = |&(from, to): &(usize, usize)| {
            sieve.sift(&points[first * dims..last * dims], &barred[first..last], from, to)
        };
        let mut kept: Vec<Vec<Vec<u32>>> = slabs.par_iter().map(sift).collect();
        let distance = &distance;
        (first..last)
            .map(move |query| {
                let candidates = kept.iter_mut().flat_map(|slab| std::mem::take(&mut slab[query - first]));
                let mut near: Vec<(f64, u32)> = candidates.map(|row| (distance(query, row as usize), row)).collect();
                near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                near.truncate(k);
                // A query among many equal rows had as many candidates: their memory is not kept.
                near.shrink_to_fit();
                near
            })
            .collect::<Vec<_>>()
    });
    Ok(found.collect())
}

/// What one search needs of the rows.
struct Sieve<'s> {
    points: &'s [f32],
    labels: &'s [u32],
    dims: usize,
    k: usize,
    /// Relative error `e`.
    error: f32,
    /// `|x|²` less its share of the error, per row.
    lower_norm: Vec<f32>,
    /// What rows that equal another have in common, 0 for all others; empty if nobody looked.
    equals: Vec<u32>,
}

/// Queries from which on rows that equal each other are looked for: half of the rows of a collapsed encoder may be one point, and every query among them would
/// otherwise have them all as candidates.
const MANY: usize = 1000;

impl<'s> Sieve<'s> {
    fn new(space: &'s Space<'_>, labels: &'s [u32], k: usize) -> Self {
        let dims = space.table().dims();
        let error = (dims as f32 + 16.0) * f32::EPSILON;
        let lower_norm = space.squared_lengths().into_iter().map(|squared| squared * (1.0 - error)).collect();
        Self { points: space.points(), labels, dims, k, error, lower_norm, equals: Vec::new() }
    }

    /// The rows of `from..to` that could be among the `k` nearest of each query in a block.
    fn sift(&self, queries: &[f32], barred: &[Option<u32>], from: usize, to: usize) -> Vec<Vec<u32>> {
        let count = barred.len();
        let doubled: Vec<f32> = queries.iter().map(|x| -2.0 * x).collect();
        let doubled = ArrayView2::from_shape((count, self.dims), &doubled);
        let mut candidates: Vec<Candidates> = (0..count)
            .map(|query| {
                let point = &queries[query * self.dims..(query + 1) * self.dims];
                Candidates::new(self.k, self.error, point.iter().map(|x| x * x).sum())
            })
            .collect();
        let mut scores = vec![0.0_f32; count * ROWS];
        for first in (from..to).step_by(ROWS) {
            let last = to.min(first + ROWS);
            let width = last - first;
            let lower_norm = &self.lower_norm[first..last];
            let scores = &mut scores[..count * width];
            scores.chunks_exact_mut(width).for_each(|line| line.copy_from_slice(lower_norm));
            let block = ArrayView2::from_shape((width, self.dims), &self.points[first * self.dims..last * self.dims]);
            let product = ArrayViewMut2::from_shape((count, width), &mut *scores);
            if let (Ok(doubled), Ok(block), Ok(mut product)) = (&doubled, block, product) {
                general_mat_mul(1.0, doubled, &block.t(), 1.0, &mut product);
            }
            for ((line, candidates), barred) in scores.chunks_exact(width).zip(&mut candidates).zip(barred) {
                self.scan(line, first, *barred, candidates);
            }
        }
        candidates.into_iter().map(Candidates::finish).collect()
    }

    /// Hand one query's scores to its candidates; most runs of rows hold none and are passed over at once.
    fn scan(&self, line: &[f32], first: usize, barred: Option<u32>, candidates: &mut Candidates) {
        const RUN: usize = 32;
        for (run, scores) in line.chunks(RUN).enumerate() {
            let least = scores.iter().fold(f32::INFINITY, |least, &score| if score < least { score } else { least });
            if least > candidates.bound {
                continue;
            }
            for (at, &score) in scores.iter().enumerate() {
                let row = first + run * RUN + at;
                let equals = self.equals.get(row).copied().unwrap_or(0);
                if score <= candidates.bound && barred != Some(self.labels[row]) && candidates.admits(equals) {
                    candidates.push(score, self.lower_norm[row], row as u32);
                }
            }
        }
    }
}

/// A number for each kind of equal rows, from 1 on; 0 for rows that equal no other.
fn equals(space: &Space<'_>) -> Vec<u32> {
    let latent = |row: u32| space.table().row(row as usize);
    let hash = |row: u32| {
        let mut hasher = DefaultHasher::new();
        latent(row).iter().for_each(|x| x.to_bits().hash(&mut hasher));
        (hasher.finish(), row)
    };
    let mut hashes: Vec<(u64, u32)> = (0..space.table().rows() as u32).into_par_iter().map(hash).collect();
    hashes.par_sort_unstable();
    let mut kinds = vec![0; hashes.len()];
    let mut kind = 0;
    for same in hashes.chunk_by(|a, b| a.0 == b.0) {
        // Rows of one hash that are not the same after all are taken as equal to none.
        let first = latent(same[0].1);
        let alike = |row: u32| latent(row).iter().zip(first).all(|(a, b)| a.to_bits() == b.to_bits());
        if same.len() > 1 {
            kind += 1;
            same.iter().filter(|(_, row)| alike(*row)).for_each(|&(_, row)| kinds[row as usize] = kind);
        }
    }
    kinds
}

/// One query's rows that may still be among its `k` nearest.
struct Candidates {
    k: usize,
    error: f32,
    /// Both sides' share of the error that comes from the query, `2 e |q|²`.
    slack: f32,
    /// No row with a score above this can be among the `k` nearest.
    bound: f32,
    /// `(lower bound, upper bound, row)`.
    rows: Vec<(f32, f32, u32)>,
    full: usize,
    /// How many rows of each kind of equals there are, the last kind seen first in `latest`.
    kinds: HashMap<u32, usize>,
    latest: (u32, usize),
}

impl Candidates {
    fn new(k: usize, error: f32, query_norm: f32) -> Self {
        // No more room at first than a usual k needs: whether there are k rows at all is known at the end.
        let full = k.saturating_mul(4).saturating_add(32);
        let slack = 2.0 * error * query_norm;
        let (kinds, latest) = (HashMap::new(), (0, 0));
        Self { k, error, slack, bound: f32::INFINITY, rows: Vec::with_capacity(full.min(1024)), full, kinds, latest }
    }

    /// Whether a row of a kind of equals can be among the `k` nearest: rows come in order, and ties go to the earlier ones, so no more than `k` of a kind can.
    fn admits(&mut self, kind: u32) -> bool {
        if kind == 0 {
            return true;
        }
        if self.latest.0 != kind {
            self.kinds.insert(self.latest.0, self.latest.1);
            self.latest = (kind, self.kinds.get(&kind).copied().unwrap_or(0));
        }
        self.latest.1 += 1;
        self.latest.1 <= self.k
    }

    fn push(&mut self, lower: f32, lower_norm: f32, row: u32) {
        self.rows.push((lower, lower + 2.0 * self.error * lower_norm * 1.01 + self.slack, row));
        if self.rows.len() == self.full {
            self.prune();
            self.full = self.full.max(2 * self.rows.len());
        }
    }

    fn prune(&mut self) {
        if self.rows.len() > self.k {
            let (_, kth, _) = self.rows.select_nth_unstable_by(self.k - 1, |a, b| a.1.total_cmp(&b.1));
            self.bound = kth.1;
            self.rows.retain(|row| row.0 <= self.bound);
        }
    }

    fn finish(mut self) -> Vec<u32> {
        self.prune();
        self.rows.into_iter().map(|(_, _, row)| row).collect()
    }
}
