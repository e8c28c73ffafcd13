//! Same-state retrieval: is a latent's nearest one of the same state under another distractor?
//!
//! Two questions that are never called by one name. Distances are standardized L2 with the standard deviations of the whole grid, ties go to the earlier
//! row, and a query counts as found if one of its `k` nearest candidates shows its state.
//!
//! | name | candidates of cell (i, j) at step t | found |
//! |---|---|---|
//! | `retrieval_same_step@k` | all other cells at step t | state i |
//! | `retrieval_any_step@k` | all rows of all cells with another distractor, whatever their state and step | state i, at most 2 steps from t |

use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;
use serde::Serialize;

use super::Grid;
use crate::intervals::Interval;
use crate::neighbours::{Exclude, Metric, Space, bounded_queries, nearest};
use crate::{Error, Table};

/// How to ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetrievalOptions {
    /// Neighbours looked at.
    pub k: usize,
    /// `retrieval_any_step`: a neighbour of the same state trajectory counts if its step is at most this far from the query's.
    pub tolerance: u32,
    /// `retrieval_any_step`: most rows to ask for; more are drawn from.
    pub queries: usize,
}

impl Default for RetrievalOptions {
    fn default() -> Self {
        Self { k: 1, tolerance: 2, queries: 2000 }
    }
}

/// How often the same state was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Retrieval {
    /// Neighbours looked at.
    pub k: usize,
    /// Share of queries with a row of the same state among their `k` nearest; interval over state and distractor trajectories.
    pub found: Interval,
    /// The share if neighbours were drawn blindly.
    pub chance: f64,
    /// Rows asked for.
    pub queries: usize,
}

/// Pairs of latents that [`retrieval_same_step`] compares at most; a larger grid's queries are drawn.
const PAIRS: usize = 50_000_000;

/// `retrieval_same_step@k`: every cell at every step asks for the `k` nearest among all other cells at that step.
///
/// # Errors
/// No neighbours asked for, more than there are other cells, or latents that do not vary.
pub fn retrieval_same_step(grid: &Grid<'_>, k: usize, rng: &mut impl Rng) -> Result<Retrieval, Error> {
    let (states, distractors, steps) = (grid.states().len(), grid.distractors().len(), grid.steps().len());
    let cells = states * distractors;
    if k == 0 || k >= cells {
        return Err(Error::Option {
            option: "k",
            value: k.to_string(),
            must: "at least 1 and below the number of cells",
        });
    }
    let queries = drawn((PAIRS / cells).max(1), cells * steps, rng);
    let cut = Cut::new(grid);
    let space = cut.space()?;
    // Positions in the cut go by cell and then step.
    let hit = |&query: &usize| {
        let (cell, step) = (query / steps, query % steps);
        let others = (0..cells).filter(|&other| other != cell);
        let mut near: Vec<(f64, usize)> =
            others.map(|other| (space.distance(query, other * steps + step), other)).collect();
        near.select_nth_unstable_by(k - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        f64::from(u8::from(near[..k].iter().any(|&(_, other)| other / distractors == cell / distractors)))
    };
    let hits: Vec<f64> = queries.par_iter().map(hit).collect();
    let chance = blind(distractors as f64 - 1.0, cells as f64 - 1.0, k);
    cut.retrieval(k, &queries, &hits, chance, rng)
}

/// `retrieval_any_step@k`: rows of the grid, at most `options.queries`, ask for the `k` nearest among all rows under another distractor.
///
/// # Errors
/// No neighbours asked for, or latents that do not vary.
pub fn retrieval_any_step(grid: &Grid<'_>, options: RetrievalOptions, rng: &mut impl Rng) -> Result<Retrieval, Error> {
    let (distractors, steps) = (grid.distractors().len(), grid.steps().len());
    let all = grid.rows.len();
    let queries = drawn(bounded_queries(options.queries, all), all, rng);
    let state = |at: usize| at / (distractors * steps);
    let step = |at: usize| grid.steps()[at % steps];
    let labels: Vec<u32> = (0..all).map(|at| (at / steps % distractors) as u32).collect();
    let cut = Cut::new(grid);
    let near = nearest(&cut.space()?, &queries, options.k, Exclude::Group(&labels))?;
    let matches = |query: usize, near: usize| {
        state(query) == state(near) && step(query).abs_diff(step(near)) <= options.tolerance
    };
    let hit = |(at, &query): (usize, &usize)| near.rows(at).iter().any(|&row| matches(query, row as usize));
    let hits: Vec<f64> = queries.iter().enumerate().map(|query| f64::from(u8::from(hit(query)))).collect();
    let in_reach =
        |query: &usize| grid.steps().iter().filter(|other| other.abs_diff(step(*query)) <= options.tolerance).count();
    let candidates = ((distractors - 1) * steps * grid.states().len()) as f64;
    let blindly = |query: &usize| blind(((distractors - 1) * in_reach(query)) as f64, candidates, options.k);
    let chance = queries.iter().map(blindly).sum::<f64>() / queries.len() as f64;
    cut.retrieval(options.k, &queries, &hits, chance, rng)
}

/// At most `most` of `all` positions, rising.
fn drawn(most: usize, all: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut drawn = if all > most { index::sample(rng, all, most).into_vec() } else { (0..all).collect() };
    drawn.sort_unstable();
    drawn
}

/// The chance that `k` of `candidates` drawn without replacement hold one of `matching`.
fn blind(matching: f64, candidates: f64, k: usize) -> f64 {
    let miss = |drawn: usize| ((candidates - matching - drawn as f64) / (candidates - drawn as f64)).max(0.0);
    1.0 - (0..k).map(miss).product::<f64>()
}

/// The grid's rows in the grid's own order, by state, distractor and step.
pub(super) struct Cut {
    dims: usize,
    values: Vec<f32>,
    keys: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
}

impl Cut {
    pub(super) fn new(grid: &Grid<'_>) -> Self {
        let (table, rows) = (grid.table(), &grid.rows);
        let cell = |row: &usize| table.cell(*row);
        Self {
            dims: table.dims(),
            values: rows.iter().flat_map(|&row| table.row(row)).copied().collect(),
            keys: (0..rows.len() as u32).collect(),
            state: rows.iter().map(|row| cell(row).map(|cell| cell.0)).collect(),
            distractor: rows.iter().map(|row| cell(row).map(|cell| cell.1)).collect(),
        }
    }

    pub(super) fn table(&self) -> Result<Table<'_>, Error> {
        Table::new(self.dims, &self.values, &self.keys, &self.keys)?.with_grid(&self.state, &self.distractor)
    }

    pub(super) fn space(&self) -> Result<Space<'_>, Error> {
        Space::new(self.table()?, Metric::Standardized)
    }

    fn retrieval(
        &self,
        k: usize,
        queries: &[usize],
        hits: &[f64],
        chance: f64,
        rng: &mut impl Rng,
    ) -> Result<Retrieval, Error> {
        let found = self.table()?.trajectories().mean(queries, hits, rng);
        Ok(Retrieval { k, found, chance, queries: queries.len() })
    }
}
