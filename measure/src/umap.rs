//! UMAP: a map of the latents in which neighbours stay neighbours (`McInnes`, Healy and Melville, 2018).
//!
//! In: a neighbour graph (ours, or any) and a random generator. Out: `[rows, 2]` positions. The steps are the paper's, one file each: `fuzzy`
//! turns distances into a weighted graph, `spectral` gives the start, `curve` and `lanes` the forces, `layout` lets them act, and `transform` puts
//! new points on an old map. The result depends on the data and the generator only, never on the number of threads, and all cores are used.

mod curve;
mod fuzzy;
mod lanes;
mod layout;
mod spectral;
mod transform;

pub use curve::Curve;
pub use fuzzy::FuzzyGraph;
pub use lanes::Position;
pub use transform::{among_neighbours, transform};

use rand::Rng;

use crate::neighbours::{Exclude, Neighbours, Space, graph};
use crate::pca::pca;
use crate::{Error, Table};
use layout::Descent;

/// Where the layout starts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Start {
    /// The smoothest functions on the graph; principal components where these cannot be found.
    #[default]
    Spectral,
    /// The two leading principal components.
    Pca,
}

/// The options of the reference implementation, at its defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UmapOptions {
    /// Size of a neighbourhood, the point itself included: more shows coarser structure; by default 15, or all rows where there are fewer.
    pub neighbours: Option<usize>,
    /// How close points may lie on the map.
    pub min_dist: f64,
    /// Scale of the map.
    pub spread: f64,
    /// Rounds of the layout; by default 500, above 10,000 points 200.
    pub epochs: Option<usize>,
    /// Random points that repel, for each attraction.
    pub negative_samples: usize,
    /// Where the layout starts.
    pub start: Start,
}

impl Default for UmapOptions {
    fn default() -> Self {
        Self { neighbours: None, min_dist: 0.1, spread: 1.0, epochs: None, negative_samples: 5, start: Start::Spectral }
    }
}

impl UmapOptions {
    fn epochs(&self, rows: usize) -> usize {
        self.epochs.unwrap_or(if rows <= 10_000 { 500 } else { 200 })
    }

    /// Size of a neighbourhood on a table of so many rows.
    #[must_use]
    pub fn neighbourhood(&self, rows: usize) -> usize {
        const USUAL: usize = 15;
        self.neighbours.unwrap_or(USUAL.min(rows).max(2))
    }

    /// Neighbours each row of a table of so many rows needs in the graph: a neighbourhood without the point itself.
    ///
    /// # Errors
    /// Options out of range.
    pub fn graph_size(&self, rows: usize) -> Result<usize, Error> {
        self.check()?;
        Ok(self.neighbourhood(rows) - 1)
    }

    fn check(&self) -> Result<(), Error> {
        let refuse = |option, value: String, must| Err(Error::Option { option, value, must });
        if let Some(neighbours) = self.neighbours.filter(|neighbours| *neighbours < 2) {
            return refuse("neighbours", neighbours.to_string(), "at least 2");
        }
        if !(self.spread > 0.0 && self.spread.is_finite()) {
            return refuse("spread", self.spread.to_string(), "above 0");
        }
        if !(0.0..=self.spread).contains(&self.min_dist) {
            return refuse("min-dist", self.min_dist.to_string(), "between 0 and the spread");
        }
        Ok(())
    }
}

/// The neighbour graph UMAP uses: every row's nearest others, from any trajectory. Compute it once, lay it out often.
///
/// # Errors
/// As [`graph`].
pub fn neighbour_graph(space: &Space<'_>, options: UmapOptions) -> Result<Neighbours, Error> {
    graph(space, options.graph_size(space.table().rows())?, Exclude::Itself)
}

/// A map of the space's rows.
///
/// # Errors
/// Options out of range, fewer rows than neighbours.
pub fn umap(space: &Space<'_>, options: UmapOptions, rng: &mut impl Rng) -> Result<Vec<Position>, Error> {
    let neighbours = neighbour_graph(space, options)?;
    umap_of_graph(space.table(), &neighbours, options, rng)
}

/// A map from a neighbour graph that is already there (one query per row of the table, in order).
///
/// # Errors
/// Options out of range, or a graph of another length than the table.
pub fn umap_of_graph(
    table: &Table<'_>,
    neighbours: &Neighbours,
    options: UmapOptions,
    rng: &mut impl Rng,
) -> Result<Vec<Position>, Error> {
    options.check()?;
    let rows = table.rows();
    if neighbours.queries() != rows {
        return Err(Error::Length { what: "neighbour graph", expected: rows, found: neighbours.queries() });
    }
    let graph = FuzzyGraph::new(neighbours);
    let mut positions = start(table, &graph, options.start, rng)?;
    let descent = Descent {
        curve: Curve::fit(options.min_dist, options.spread),
        epochs: options.epochs(rows),
        rate: 1.0,
        negative_samples: options.negative_samples,
        seed: rng.random(),
    };
    descent.run(&graph, &mut positions);
    Ok(positions)
}

/// Start positions, stretched to `[0, 10]` along each axis, with a little noise so that no two coincide.
fn start(table: &Table<'_>, graph: &FuzzyGraph, start: Start, rng: &mut impl Rng) -> Result<Vec<Position>, Error> {
    let components = || pca(table).map(|map| map.positions);
    let spectral = match start {
        Start::Spectral => spectral::start(graph, || components().ok(), rng),
        Start::Pca => None,
    };
    let mut positions = match spectral {
        Some(positions) => positions,
        None => components()?,
    };
    for axis in 0..2 {
        let (low, high) = positions
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), at| (low.min(at[axis]), high.max(at[axis])));
        let scale = if high > low { 10.0 / (high - low) } else { 0.0 };
        for at in &mut positions {
            at[axis] = (at[axis] - low) * scale + rng.random_range(-1e-3..1e-3);
        }
    }
    Ok(positions)
}

#[cfg(test)]
mod tests;
