//! Same-state retrieval: is a latent's nearest one of the same state under another distractor?
//!
//! Two questions that are never called by one name. Distances are standardized L2 with the standard deviations of the whole grid, ties go to the earlier
//! row, and a query counts as found if one of its `k` nearest candidates shows its state.
//!
//! | name | candidates of cell (i, j) at step t | found |
//! |---|---|---|
//! | `retrieval_same_step@k` | all other cells at step t | state i |
//! | `retrieval_any_step@k` | all rows of all cells with another distractor, whatever their state and step | state i, at most 2 steps from t |
//!
//! For the interval each state and each distractor is left out in turn, as query and as candidate (see `without`), with the standard deviations as they are.

mod sieve;
mod tally;
mod without;

use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;
use serde::Serialize;

use self::sieve::Sieve;
use self::tally::Tally;
use self::without::{Cell, Place, Query};
use super::Grid;
use crate::intervals::Interval;
use crate::neighbours::{Metric, Space, bounded_queries};
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
    /// Share of queries with a row of the same state among their `k` nearest. The interval is over state and distractor trajectories, each left out in
    /// turn, as query and as candidate (see [`crate::intervals::crossed`]); none with fewer than three of either kind, nor where `k` are all that is left.
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
    let size @ [states, distractors, steps] = size(grid);
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
    let asked = queries.par_iter().map(|&query| ask_same_step(&space, size, k, query));
    let left = [(states - 1) * distractors - 1, states * (distractors - 1) - 1];
    let found = Tally::of([states, distractors], asked).interval(k, left);
    let chance = blind(distractors as f64 - 1.0, cells as f64 - 1.0, k);
    Ok(Retrieval { k, found, chance, queries: queries.len() })
}

/// What stands before the matches of one query, a position in the cut, among all other cells at its step. Positions go by cell and then step.
fn ask_same_step(space: &Space<'_>, [states, distractors, steps]: [usize; 3], k: usize, query: usize) -> Query {
    let (own, step) = (query / steps, query % steps);
    let cell = Cell { state: own / distractors, distractor: own % distractors };
    // The cell itself is no candidate: it stands behind them all.
    let place = |row: usize| {
        if row == own { Place::NOWHERE } else { Place { distance: space.distance(query, row * steps + step), row } }
    };
    let places: Vec<Place> = (0..states * distractors).map(place).collect();
    let same = &places[cell.state * distractors..(cell.state + 1) * distractors];
    let matches: Vec<(Place, usize)> =
        same.iter().copied().zip(0..).filter(|&(_, distractor)| distractor != cell.distractor).collect();
    let mut asked = Query::new(k, cell, [states, distractors], &matches);
    for (state, places) in places.chunks(distractors).enumerate() {
        for (distractor, &place) in places.iter().enumerate() {
            asked.count(place, Cell { state, distractor });
        }
    }
    asked
}

/// `retrieval_any_step@k`: rows of the grid, at most `options.queries`, ask for the `k` nearest among all rows under another distractor.
///
/// # Errors
/// No neighbours asked for, more than there are rows under other distractors, or latents that do not vary.
pub fn retrieval_any_step(grid: &Grid<'_>, options: RetrievalOptions, rng: &mut impl Rng) -> Result<Retrieval, Error> {
    let [states, distractors, steps] = size(grid);
    let (all, k) = (grid.rows.len(), options.k);
    let candidates = states * (distractors - 1) * steps;
    if k == 0 || k > candidates {
        return Err(Error::Option {
            option: "k",
            value: k.to_string(),
            must: "at least 1 and at most the number of rows under other distractors",
        });
    }
    let queries = drawn(bounded_queries(options.queries, all), all, rng);
    let cut = Cut::new(grid);
    let space = cut.space()?;
    let sieve = Sieve::new(&space, grid, k, options.tolerance);
    let left = [candidates - (distractors - 1) * steps, candidates - states * steps];
    let found = Tally::of([states, distractors], sieve.ask(&queries)).interval(k, left);
    let blindly = |&query: &usize| {
        let in_reach = sieve.in_reach(query % steps).count();
        blind(((distractors - 1) * in_reach) as f64, candidates as f64, k)
    };
    let chance = queries.iter().map(blindly).sum::<f64>() / queries.len() as f64;
    Ok(Retrieval { k, found, chance, queries: queries.len() })
}

/// States, distractors and steps.
fn size(grid: &Grid<'_>) -> [usize; 3] {
    [grid.states().len(), grid.distractors().len(), grid.steps().len()]
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
}

impl Cut {
    pub(super) fn new(grid: &Grid<'_>) -> Self {
        let (table, rows) = (grid.table(), &grid.rows);
        Self {
            dims: table.dims(),
            values: rows.iter().flat_map(|&row| table.row(row)).copied().collect(),
            keys: (0..rows.len() as u32).collect(),
        }
    }

    pub(super) fn table(&self) -> Result<Table<'_>, Error> {
        Table::new(self.dims, &self.values, &self.keys, &self.keys)
    }

    pub(super) fn space(&self) -> Result<Space<'_>, Error> {
        Space::new(self.table()?, Metric::Standardized)
    }
}
