//! Where the layout starts: the two smoothest functions on the graph.
//!
//! In: the fuzzy graph and where its parts should go. Out: positions in `[0, 10]²`. The functions are the eigenvectors of the
//! normalized Laplacian `1 - D^{-1/2} W D^{-1/2}` with the smallest eigenvalues above 0 (the paper's algorithm 4), found per
//! connected component by Lanczos iteration with a bounded number of steps, so that a graph that almost falls apart
//! costs no more than any other.

use linfa_linalg::eigh::{EigSort, Eigh};
use ndarray::Array2;
use rand::Rng;
use rayon::prelude::*;

use super::{FuzzyGraph, Position};

/// Steps between restarts, and restarts.
const STEPS: usize = 80;
const RESTARTS: usize = 4;
/// Residual at which an eigenvector is good, and above which it is useless.
const GOOD: f64 = 1e-4;
const USELESS: f64 = 2e-2;
/// Components with fewer vertices are scattered about their centre.
const SMALL: usize = 6;

/// Start positions, or `None` if the iteration found no smooth functions. `elsewhere` `[rows]` says where the
/// components of a graph in several parts go: each about the mean of its vertices.
pub(super) fn start(
    graph: &FuzzyGraph,
    elsewhere: impl FnOnce() -> Option<Vec<Position>>,
    rng: &mut impl Rng,
) -> Option<Vec<Position>> {
    let (component, count) = graph.components();
    if count == 1 {
        let all: Vec<u32> = (0..graph.vertices() as u32).collect();
        return eigenvectors(graph, &all, rng);
    }
    let elsewhere = elsewhere()?;
    let mut members = vec![Vec::new(); count];
    for (vertex, &component) in component.iter().enumerate() {
        members[component as usize].push(vertex as u32);
    }
    let centres: Vec<Position> = members.iter().map(|members| mean(members, &elsewhere)).collect();
    let mut positions = vec![[0.0; 2]; graph.vertices()];
    for (at, members) in members.iter().enumerate() {
        let radius = 0.5 * nearest_other(&centres, at);
        let scatter = |rng: &mut _| members.iter().map(|_| [uniform(rng), uniform(rng)]).collect();
        let local = if members.len() < SMALL {
            scatter(rng)
        } else {
            eigenvectors(graph, members, rng).unwrap_or_else(|| scatter(rng))
        };
        let local = boxed(&local, radius);
        for (&vertex, local) in members.iter().zip(local) {
            positions[vertex as usize] = [centres[at][0] + local[0], centres[at][1] + local[1]];
        }
    }
    Some(positions)
}

fn uniform(rng: &mut impl Rng) -> f32 {
    rng.random_range(-1.0..1.0)
}

fn mean(members: &[u32], positions: &[Position]) -> Position {
    let sum = |axis: usize| members.iter().map(|&vertex| f64::from(positions[vertex as usize][axis])).sum::<f64>();
    [0, 1].map(|axis| (sum(axis) / members.len() as f64) as f32)
}

/// Distance to the nearest other centre, no less than a hundredth of the whole extent.
fn nearest_other(centres: &[Position], at: usize) -> f32 {
    let distance = |other: &Position| (other[0] - centres[at][0]).hypot(other[1] - centres[at][1]);
    let others = centres.iter().enumerate().filter(|(other, _)| *other != at);
    let (near, far) = others
        .map(|(_, other)| distance(other))
        .fold((f32::INFINITY, 0.0_f32), |(near, far), d| (near.min(d), far.max(d)));
    near.max(0.01 * far).max(1e-3)
}

/// Centred and scaled so that the largest coordinate is `radius`.
fn boxed(positions: &[Position], radius: f32) -> Vec<Position> {
    let all: Vec<u32> = (0..positions.len() as u32).collect();
    let centre = mean(&all, positions);
    let centred = positions.iter().map(|at| [at[0] - centre[0], at[1] - centre[1]]);
    let largest = centred.clone().flatten().fold(f32::MIN_POSITIVE, |largest, x| largest.max(x.abs()));
    centred.map(|at| at.map(|x| x * radius / largest)).collect()
}

/// The two smoothest functions on one component.
fn eigenvectors(graph: &FuzzyGraph, members: &[u32], rng: &mut impl Rng) -> Option<Vec<Position>> {
    let operator = Operator::new(graph, members);
    let size = members.len();
    let steps = STEPS.min(size - 1);
    let mut start: Vec<f64> = (0..size).map(|_| rng.random_range(-1.0..1.0)).collect();
    // Led by a thread of the pool: one outside would wait for it to wake up in each of hundreds of short products.
    let vectors = rayon::scope(|_| {
        let mut best = None;
        for _ in 0..RESTARTS {
            let (vectors, residual) = lanczos(&operator, start, steps)?;
            start = vectors[0].iter().zip(&vectors[1]).map(|(a, b)| a + b).collect();
            best = (residual < USELESS).then_some(vectors);
            if residual < GOOD {
                break;
            }
        }
        best
    })?;
    Some((0..size).map(|vertex| [vectors[0][vertex] as f32, vectors[1][vertex] as f32]).collect())
}

/// `D^{-1/2} W D^{-1/2}` on one component, with its known leading eigenvector `√degree` taken out.
struct Operator {
    offsets: Vec<usize>,
    targets: Vec<u32>,
    weights: Vec<f64>,
    /// `√degree`, of unit length.
    trivial: Vec<f64>,
}

impl Operator {
    fn new(graph: &FuzzyGraph, members: &[u32]) -> Self {
        let mut local = vec![u32::MAX; graph.vertices()];
        members.iter().enumerate().for_each(|(at, &vertex)| local[vertex as usize] = at as u32);
        let degree: Vec<f64> = members
            .iter()
            .map(|&vertex| graph.edges(vertex as usize).map(|(_, weight)| f64::from(weight)).sum())
            .collect();
        let (mut offsets, mut targets, mut weights) = (vec![0], Vec::new(), Vec::new());
        for (at, &vertex) in members.iter().enumerate() {
            for (target, weight) in graph.edges(vertex as usize) {
                let target = local[target as usize];
                targets.push(target);
                weights.push(f64::from(weight) / (degree[at] * degree[target as usize]).sqrt());
            }
            offsets.push(targets.len());
        }
        let total: f64 = degree.iter().sum();
        let trivial = degree.iter().map(|degree| (degree / total).sqrt()).collect();
        Self { offsets, targets, weights, trivial }
    }

    fn apply(&self, vector: &[f64]) -> Vec<f64> {
        let row = |at: usize| {
            let edges = self.offsets[at]..self.offsets[at + 1];
            let terms = self.targets[edges.clone()].iter().zip(&self.weights[edges]);
            terms.map(|(&target, weight)| weight * vector[target as usize]).sum()
        };
        (0..vector.len()).into_par_iter().with_min_len(512).map(row).collect()
    }
}

/// The two leading eigenvectors within a Krylov space, and the larger of their residuals.
fn lanczos(operator: &Operator, start: Vec<f64>, steps: usize) -> Option<([Vec<f64>; 2], f64)> {
    // The trivial eigenvector heads the basis, so that orthogonalization keeps it out.
    let mut basis = vec![operator.trivial.clone()];
    let mut projected = Array2::<f64>::zeros((steps, steps));
    let mut vector = start;
    let mut rest = 0.0;
    for step in 0..steps {
        orthogonalize(&mut vector, &basis);
        let length = dot(&vector, &vector).sqrt();
        if length < 1e-10 {
            return finish(&basis, projected, step, 0.0);
        }
        vector.iter_mut().for_each(|x| *x /= length);
        if step > 0 {
            projected[[step, step - 1]] = length;
            projected[[step - 1, step]] = length;
        }
        let mut image = operator.apply(&vector);
        projected[[step, step]] = dot(&vector, &image);
        basis.push(vector);
        orthogonalize(&mut image, &basis);
        rest = dot(&image, &image).sqrt();
        vector = image;
    }
    finish(&basis, projected, steps, rest)
}

/// Ritz vectors from the projected (tridiagonal) matrix.
fn finish(basis: &[Vec<f64>], projected: Array2<f64>, steps: usize, rest: f64) -> Option<([Vec<f64>; 2], f64)> {
    if steps < 2 {
        return None;
    }
    let projected = projected.slice_move(ndarray::s![..steps, ..steps]).as_standard_layout().to_owned();
    let (_, coefficients) = projected.eigh().ok()?.sort_eig_desc();
    let size = basis[0].len();
    let ritz = |which: usize| {
        let mut vector = vec![0.0; size];
        for (step, basis) in basis[1..].iter().enumerate() {
            let coefficient = coefficients[[step, which]];
            vector.iter_mut().zip(basis).for_each(|(x, b)| *x += coefficient * b);
        }
        vector
    };
    let residual = |which: usize| rest * coefficients[[steps - 1, which]].abs();
    Some(([ritz(0), ritz(1)], residual(0).max(residual(1))))
}

/// Take out every basis vector, twice: once leaves rounding that grows over the steps.
fn orthogonalize(vector: &mut [f64], basis: &[Vec<f64>]) {
    const CHUNK: usize = 2048;
    for _ in 0..2 {
        let shared: Vec<f64> = basis.par_iter().map(|b| dot(vector, b)).collect();
        vector.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, x)| {
            for (b, share) in basis.iter().zip(&shared) {
                let b = &b[chunk * CHUNK..chunk * CHUNK + x.len()];
                x.iter_mut().zip(b).for_each(|(x, b)| *x -= share * b);
            }
        });
    }
}

/// Eight running sums, which the compiler keeps in vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (runs_a, runs_b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = runs_a.remainder().iter().zip(runs_b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 8];
    for (a, b) in runs_a.zip(runs_b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}
