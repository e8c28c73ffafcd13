//! t-SNE beside UMAP: the other map readers expect (van der Maaten and Hinton, 2008; Barnes-Hut, 2014).
//!
//! In: a neighbour graph and a random generator. Out: `[rows, 2]` positions. Attraction along the graph's edges (`affinities`), repulsion from everyone
//! else, far points taken together (`quadtree`). Every point's forces are gathered on their own, so all cores are used and
//! the result depends on the data and the generator only.

mod affinities;
mod quadtree;

use rand::Rng;
use rayon::prelude::*;

use crate::neighbours::{Exclude, Neighbours, Space, graph};
use crate::pca::pca;
use crate::{Error, Table};
use affinities::Affinities;
use quadtree::Quadtree;

/// Options, at the usual defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TsneOptions {
    /// About how many neighbours a point attends to; by default 30, or a third of the other rows where there are fewer than 91.
    pub perplexity: Option<f64>,
    /// Steps of gradient descent.
    pub iterations: usize,
    /// Cells narrower than this times their distance act as one point: 0 is exact, more is faster.
    pub theta: f32,
}

impl Default for TsneOptions {
    fn default() -> Self {
        Self { perplexity: None, iterations: 1000, theta: 0.5 }
    }
}

/// Attraction is this much stronger in the first quarter of the iterations, so that clusters can pass each other.
const EXAGGERATION: f32 = 12.0;

impl TsneOptions {
    fn check(&self) -> Result<(), Error> {
        let refuse = |option, value: String, must| Err(Error::Option { option, value, must });
        if let Some(perplexity) = self.perplexity.filter(|perplexity| !(*perplexity >= 1.0 && perplexity.is_finite())) {
            return refuse("perplexity", perplexity.to_string(), "at least 1");
        }
        if !(0.0..=1.0).contains(&self.theta) {
            return refuse("theta", self.theta.to_string(), "between 0 and 1");
        }
        Ok(())
    }

    /// The perplexity for a table of so many rows.
    fn perplexity(&self, rows: usize) -> f64 {
        const USUAL: f64 = 30.0;
        self.perplexity.unwrap_or_else(|| (rows.saturating_sub(1) as f64 / 3.0).clamp(1.0, USUAL))
    }

    /// Neighbours each row of a table of so many rows needs in the graph: three times the perplexity, as everywhere.
    ///
    /// # Errors
    /// Options out of range, or fewer than four rows, or fewer than a given perplexity needs.
    pub fn graph_size(&self, rows: usize) -> Result<usize, Error> {
        self.check()?;
        let size = (3.0 * self.perplexity(rows)) as usize;
        match self.perplexity {
            None if rows < 4 => Err(Error::TooFewRows { what: "t-SNE", needed: 4, found: rows }),
            Some(perplexity) if size >= rows => Err(Error::Option {
                option: "perplexity",
                value: perplexity.to_string(),
                must: "below a third of the number of rows",
            }),
            _ => Ok(size),
        }
    }
}

/// A map of the space's rows.
///
/// # Errors
/// Options out of range, no more rows than three times the perplexity, or latents that do not vary.
pub fn tsne(space: &Space<'_>, options: TsneOptions, rng: &mut impl Rng) -> Result<Vec<[f32; 2]>, Error> {
    let neighbours = graph(space, options.graph_size(space.table().rows())?, Exclude::Itself)?;
    tsne_of_graph(space.table(), &neighbours, options, rng)
}

/// A map from a neighbour graph that is already there (one query per row of the table, in order).
///
/// # Errors
/// Options out of range, a graph of another length than the table, or latents that do not vary.
pub fn tsne_of_graph(
    table: &Table<'_>,
    neighbours: &Neighbours,
    options: TsneOptions,
    rng: &mut impl Rng,
) -> Result<Vec<[f32; 2]>, Error> {
    options.check()?;
    let rows = table.rows();
    if neighbours.queries() != rows {
        return Err(Error::Length { what: "neighbour graph", expected: rows, found: neighbours.queries() });
    }
    let affinities = Affinities::new(neighbours, options.perplexity(rows));
    let mut descent = Descent::new(start(table, rng)?);
    let rate = (rows as f32 / EXAGGERATION / 4.0).max(50.0);
    for iteration in 0..options.iterations {
        let early = iteration < options.iterations / 4;
        let (exaggeration, momentum) = if early { (EXAGGERATION, 0.5) } else { (1.0, 0.8) };
        let gradient = gradient(&affinities, &descent.positions, exaggeration, options.theta);
        descent.step(&gradient, rate, momentum);
    }
    Ok(descent.positions)
}

/// Principal components, shrunk to a deviation of 1e-4 along the first, with a little noise so that no two points coincide.
fn start(table: &Table<'_>, rng: &mut impl Rng) -> Result<Vec<[f32; 2]>, Error> {
    let mut positions = pca(table)?.positions;
    let deviation = (positions.iter().map(|at| f64::from(at[0]).powi(2)).sum::<f64>() / positions.len() as f64).sqrt();
    for x in positions.iter_mut().flatten() {
        *x = *x * (1e-4 / deviation) as f32 + rng.random_range(-1e-6..1e-6);
    }
    Ok(positions)
}

/// Gradient of the divergence at every point, `[rows, 2]`: `4 (Σ_j p_ij q_ij Z (y_i - y_j) - Σ_j q_ij² Z (y_i - y_j))`.
fn gradient(affinities: &Affinities, positions: &[[f32; 2]], exaggeration: f32, theta: f32) -> Vec<[f32; 2]> {
    let tree = Quadtree::new(positions);
    let repulsions: Vec<([f32; 2], f32)> = positions.par_iter().map(|&at| tree.repulsion(at, theta)).collect();
    // In order, in double precision: the same whatever the number of threads.
    let total: f64 = repulsions.iter().map(|(_, weight)| f64::from(*weight)).sum();
    let share = (1.0 / total.max(f64::MIN_POSITIVE)) as f32;
    let of = |row: usize| {
        let at = positions[row];
        let mut force = repulsions[row].0.map(|x| -x * share);
        for (other, affinity) in affinities.edges(row) {
            let difference = [at[0] - positions[other][0], at[1] - positions[other][1]];
            let weight =
                exaggeration * affinity / (1.0 + difference[0] * difference[0] + difference[1] * difference[1]);
            force = [force[0] + weight * difference[0], force[1] + weight * difference[1]];
        }
        force.map(|x| 4.0 * x)
    };
    (0..positions.len()).into_par_iter().with_min_len(64).map(of).collect()
}

/// Gradient descent with momentum and a gain for each coordinate, which grows while the gradient keeps its direction.
struct Descent {
    positions: Vec<[f32; 2]>,
    velocities: Vec<[f32; 2]>,
    gains: Vec<[f32; 2]>,
}

impl Descent {
    fn new(positions: Vec<[f32; 2]>) -> Self {
        let count = positions.len();
        Self { positions, velocities: vec![[0.0; 2]; count], gains: vec![[1.0; 2]; count] }
    }

    fn step(&mut self, gradient: &[[f32; 2]], rate: f32, momentum: f32) {
        let state = self.positions.iter_mut().zip(&mut self.velocities).zip(&mut self.gains);
        for (((at, velocity), gain), gradient) in state.zip(gradient) {
            for axis in 0..2 {
                let turned = gradient[axis] * velocity[axis] > 0.0;
                gain[axis] = if turned { (gain[axis] * 0.8).max(0.01) } else { gain[axis] + 0.2 };
                velocity[axis] = momentum * velocity[axis] - rate * gain[axis] * gradient[axis];
                at[axis] += velocity[axis];
            }
        }
    }
}

#[cfg(test)]
mod tests;
