//! From nearest neighbours to a weighted graph: how much each point belongs to another's neighbourhood.
//!
//! In: the neighbour graph (distances). Out: a symmetric sparse graph with weights in (0, 1]: the fuzzy simplicial
//! set of the paper's sections 3.1 and 4 (algorithms 2 and 3).

use rayon::prelude::*;

use crate::neighbours::Neighbours;

/// A symmetric weighted graph as compressed sparse rows: the edges of vertex `v` are `offsets[v]..offsets[v + 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct FuzzyGraph {
    pub(super) offsets: Vec<usize>,
    pub(super) targets: Vec<u32>,
    pub(super) weights: Vec<f32>,
}

impl FuzzyGraph {
    /// Memberships of the neighbours, made symmetric by the probabilistic union `w + wᵀ - w wᵀ`.
    #[must_use]
    pub fn new(neighbours: &Neighbours) -> Self {
        let memberships = memberships(neighbours);
        let rows = neighbours.queries();
        let mut incoming: Vec<Vec<(u32, f32)>> = vec![Vec::new(); rows];
        for row in 0..rows {
            for (&target, &weight) in neighbours.rows(row).iter().zip(&memberships[row * neighbours.k()..]) {
                incoming[target as usize].push((row as u32, weight));
            }
        }
        let outgoing =
            |row: usize| neighbours.rows(row).iter().copied().zip(memberships[row * neighbours.k()..].iter().copied());
        let edges: Vec<Vec<(u32, f32)>> =
            (0..rows).into_par_iter().map(|row| union(outgoing(row), &incoming[row])).collect();
        Self::from_edges(&edges)
    }

    fn from_edges(edges: &[Vec<(u32, f32)>]) -> Self {
        let mut offsets = vec![0];
        offsets.extend(edges.iter().scan(0, |end, edges| {
            *end += edges.len();
            Some(*end)
        }));
        let targets = edges.iter().flatten().map(|&(target, _)| target).collect();
        let weights = edges.iter().flatten().map(|&(_, weight)| weight).collect();
        Self { offsets, targets, weights }
    }

    /// Number of points.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The neighbours of a vertex and the weights of the edges to them, by rising neighbour.
    pub fn edges(&self, vertex: usize) -> impl Iterator<Item = (u32, f32)> + '_ {
        let span = self.offsets[vertex]..self.offsets[vertex + 1];
        self.targets[span.clone()].iter().copied().zip(self.weights[span].iter().copied())
    }

    /// The connected component of each vertex (numbered by first vertex), and how many there are.
    #[must_use]
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut component = vec![u32::MAX; self.vertices()];
        let mut count = 0;
        let mut stack = Vec::new();
        for start in 0..self.vertices() {
            if component[start] != u32::MAX {
                continue;
            }
            component[start] = count;
            stack.push(start);
            while let Some(vertex) = stack.pop() {
                for &target in &self.targets[self.offsets[vertex]..self.offsets[vertex + 1]] {
                    if component[target as usize] == u32::MAX {
                        component[target as usize] = count;
                        stack.push(target as usize);
                    }
                }
            }
            count += 1;
        }
        (component, count as usize)
    }
}

/// One row of the union, sorted by target.
fn union(outgoing: impl Iterator<Item = (u32, f32)>, incoming: &[(u32, f32)]) -> Vec<(u32, f32)> {
    let mut edges: Vec<(u32, f32)> = outgoing.chain(incoming.iter().copied()).collect();
    edges.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    edges.dedup_by(|later, earlier| {
        let both = later.0 == earlier.0;
        if both {
            earlier.1 = earlier.1 + later.1 - earlier.1 * later.1;
        }
        both
    });
    edges.retain(|&(_, weight)| weight > 0.0);
    edges
}

/// How strongly each neighbour belongs to its query's neighbourhood, `[queries, k]`:
/// `exp(-(d - rho) / sigma)`, `rho` the distance to the nearest neighbour that is not a duplicate, `sigma` such that
/// the memberships add up to `log2(k + 1)` (the point itself is the first of its `k + 1` neighbours).
pub(super) fn memberships(neighbours: &Neighbours) -> Vec<f32> {
    let k = neighbours.k();
    let all = (0..neighbours.queries()).flat_map(|query| neighbours.distances(query)).sum::<f64>();
    let mean = all / (neighbours.queries() * (k + 1)) as f64;
    (0..neighbours.queries())
        .into_par_iter()
        .flat_map_iter(|query| {
            let distances = neighbours.distances(query);
            let rho = distances.iter().copied().find(|&d| d > 0.0).unwrap_or(0.0);
            let sigma = bandwidth(distances, rho, mean);
            distances.iter().map(
                move |d| {
                    if d - rho <= 0.0 || sigma == 0.0 { 1.0 } else { (-(d - rho) / sigma).exp() as f32 }
                },
            )
        })
        .collect()
}

/// Bisection for `sigma`; never below a thousandth of the mean distance, of the point's own or (for a point among its
/// duplicates) of all.
fn bandwidth(distances: &[f64], rho: f64, mean_of_all: f64) -> f64 {
    let target = ((distances.len() + 1) as f64).log2();
    let total =
        |sigma: f64| distances.iter().map(|d| if d > &rho { (-(d - rho) / sigma).exp() } else { 1.0 }).sum::<f64>();
    // Begins at the distances' own scale, so that any unit of the latents is as good.
    let own_mean = distances.iter().sum::<f64>() / (distances.len() + 1) as f64;
    let (mut low, mut high, mut sigma) = (0.0, f64::INFINITY, if own_mean > 0.0 { own_mean } else { 1.0 });
    for _ in 0..64 {
        let sum = total(sigma);
        if (sum - target).abs() < 1e-5 {
            break;
        }
        if sum > target {
            high = sigma;
            sigma = f64::midpoint(low, high);
        } else {
            low = sigma;
            sigma = if high.is_infinite() { sigma * 2.0 } else { f64::midpoint(low, high) };
        }
    }
    sigma.max(1e-3 * if rho > 0.0 { own_mean } else { mean_of_all })
}
