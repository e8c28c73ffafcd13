//! From distances to neighbours to how strongly two points attract: `p_ij = (p_j|i + p_i|j) / 2n`.
//!
//! `p_j|i` falls off as a Gaussian over a point's neighbours, its width chosen so that the distribution's perplexity (two to its entropy
//! in bits) is the one asked for.

use rayon::prelude::*;

use crate::neighbours::Neighbours;

/// A symmetric sparse matrix that adds up to 1, as compressed sparse rows.
pub(super) struct Affinities {
    offsets: Vec<usize>,
    edges: Vec<(u32, f32)>,
}

impl Affinities {
    pub(super) fn new(neighbours: &Neighbours, perplexity: f64) -> Self {
        let (rows, k) = (neighbours.queries(), neighbours.k());
        let one_way: Vec<f64> =
            (0..rows).into_par_iter().flat_map_iter(|row| conditional(neighbours.distances(row), perplexity)).collect();
        let half = 0.5 / rows as f64;
        let mut both: Vec<Vec<(u32, f32)>> = vec![Vec::with_capacity(2 * k); rows];
        for row in 0..rows {
            for (&other, p) in neighbours.rows(row).iter().zip(&one_way[row * k..]) {
                both[row].push((other, (p * half) as f32));
                both[other as usize].push((row as u32, (p * half) as f32));
            }
        }
        both.par_iter_mut().for_each(merge);
        let mut offsets = vec![0];
        offsets.extend(both.iter().scan(0, |end, edges| {
            *end += edges.len();
            Some(*end)
        }));
        Self { offsets, edges: both.into_iter().flatten().collect() }
    }

    /// A point's partners and affinities.
    pub(super) fn edges(&self, row: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        self.edges[self.offsets[row]..self.offsets[row + 1]].iter().map(|&(other, affinity)| (other as usize, affinity))
    }
}

/// Sort by partner and add up the two directions of an edge.
fn merge(edges: &mut Vec<(u32, f32)>) {
    edges.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    edges.dedup_by(|later, earlier| {
        let same = later.0 == earlier.0;
        if same {
            earlier.1 += later.1;
        }
        same
    });
}

/// `p_j|i` over a point's neighbours, `[k]`, by bisection for the width.
fn conditional(distances: &[f64], perplexity: f64) -> Vec<f64> {
    let target = perplexity.min(distances.len() as f64).ln();
    let nearest = distances.first().map_or(0.0, |d| d * d);
    // Measured from the nearest, so that no exponential is below range for all.
    let squared: Vec<f64> = distances.iter().map(|d| d * d - nearest).collect();
    let scale = squared.iter().sum::<f64>() / squared.len() as f64;
    if scale == 0.0 {
        return vec![1.0 / distances.len() as f64; distances.len()];
    }
    let weights = |precision: f64| squared.iter().map(|d| (-precision * d / scale).exp()).collect::<Vec<f64>>();
    let entropy = |precision: f64| {
        let weights = weights(precision);
        let total: f64 = weights.iter().sum();
        let mean: f64 = weights.iter().zip(&squared).map(|(weight, d)| weight * d / scale).sum::<f64>() / total;
        total.ln() + precision * mean
    };
    let (mut low, mut high, mut precision) = (0.0, f64::INFINITY, 1.0);
    for _ in 0..64 {
        if entropy(precision) > target {
            low = precision;
            precision = if high.is_infinite() { 2.0 * precision } else { f64::midpoint(low, high) };
        } else {
            high = precision;
            precision = f64::midpoint(low, high);
        }
    }
    let weights = weights(precision);
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / total).collect()
}
