//! Same-state retrieval: is the nearest latent under another distractor one of the same state?

use rand::Rng;
use rand::seq::index;
use serde::Serialize;

use super::Grid;
use crate::intervals::{Interval, bootstrap};
use crate::neighbours::{Exclude, Metric, Space, bounded_queries, nearest};
use crate::{Error, Table};

/// How to ask.
#[derive(Debug, Clone, Copy)]
pub struct RetrievalOptions {
    /// Neighbours looked at.
    pub k: usize,
    /// A neighbour of the same state trajectory counts if its step is at most this far from the query's.
    pub tolerance: u32,
    /// Most rows to ask for; more are drawn from.
    pub queries: usize,
    /// The measure of nearness.
    pub metric: Metric,
}

impl Default for RetrievalOptions {
    fn default() -> Self {
        Self { k: 1, tolerance: 2, queries: 2000, metric: Metric::Standardized }
    }
}

/// How often the same state was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Retrieval {
    /// Neighbours looked at.
    pub k: usize,
    /// Share of queries with a row of the same state among their `k` nearest; interval over state trajectories.
    pub found: Interval,
    /// The share if neighbours were drawn blindly.
    pub chance: f64,
    /// Rows asked for.
    pub queries: usize,
}

/// Retrieval over whole trajectories. Query: any row of the grid, cell (i, j) at step t. Candidates: all rows of cells with
/// another distractor, whatever their state and step. Found: one of the `k` nearest is of state i, within `tolerance` steps of t.
///
/// # Errors
/// Latents that do not vary.
pub fn retrieval(grid: &Grid<'_>, options: RetrievalOptions, rng: &mut impl Rng) -> Result<Retrieval, Error> {
    let (distractors, steps) = (grid.distractors().len(), grid.steps().len());
    let all = grid.rows.len();
    let most = bounded_queries(options.queries, all);
    let mut queries = if all > most { index::sample(rng, all, most).into_vec() } else { (0..all).collect() };
    queries.sort_unstable();
    let state = |at: usize| at / (distractors * steps);
    let step = |at: usize| grid.steps()[at % steps];
    let matches = |query: usize, near: usize| {
        state(query) == state(near) && step(query).abs_diff(step(near)) <= options.tolerance
    };
    let labels: Vec<u32> = (0..all).map(|at| (at / steps % distractors) as u32).collect();
    let near = steps_of(grid, 0..steps).nearest(&queries, &labels, options)?;
    let hits: Vec<bool> =
        queries.iter().zip(&near).map(|(&query, near)| near.iter().any(|&row| matches(query, row as usize))).collect();
    let in_reach =
        |query: usize| grid.steps().iter().filter(|other| other.abs_diff(step(query)) <= options.tolerance).count();
    let candidates = ((distractors - 1) * steps * grid.states().len()) as f64;
    let reach: f64 = queries.iter().map(|&query| in_reach(query) as f64).sum::<f64>() / queries.len() as f64;
    let chance = blind((distractors - 1) as f64 * reach, candidates, options.k);
    let of_state: Vec<usize> = queries.iter().map(|&query| state(query)).collect();
    Ok(Retrieval {
        k: options.k,
        found: share(&hits, &of_state, grid.states().len(), rng),
        chance,
        queries: queries.len(),
    })
}

/// Retrieval at one step (position in the grid's steps; the middle by default). Query: a cell's row at that step. Candidates: the other
/// cells' rows at the same step, of any state and distractor. Found: one of the `k` nearest is of the same state.
///
/// # Errors
/// A step past the last, or latents that do not vary.
pub fn retrieval_at_step(
    grid: &Grid<'_>,
    step: Option<usize>,
    options: RetrievalOptions,
    rng: &mut impl Rng,
) -> Result<Retrieval, Error> {
    let step = step.unwrap_or(grid.steps().len() / 2);
    if step >= grid.steps().len() {
        return Err(Error::NoSuchRow { row: step, rows: grid.steps().len() });
    }
    let (states, distractors) = (grid.states().len(), grid.distractors().len());
    let queries: Vec<usize> = (0..states * distractors).collect();
    let own: Vec<u32> = queries.iter().map(|&at| at as u32).collect();
    let near = steps_of(grid, step..step + 1).nearest(&queries, &own, options)?;
    let hit =
        |(&query, near): (&usize, &Vec<u32>)| near.iter().any(|&row| row as usize / distractors == query / distractors);
    let hits: Vec<bool> = queries.iter().zip(&near).map(hit).collect();
    let chance = blind(distractors as f64 - 1.0, (states * distractors) as f64 - 1.0, options.k);
    let of_state: Vec<usize> = queries.iter().map(|query| query / distractors).collect();
    Ok(Retrieval { k: options.k, found: share(&hits, &of_state, states, rng), chance, queries: queries.len() })
}

/// The chance that `k` of `candidates` drawn without replacement hold one of `matching`.
fn blind(matching: f64, candidates: f64, k: usize) -> f64 {
    let miss = |drawn: usize| ((candidates - matching - drawn as f64) / (candidates - drawn as f64)).max(0.0);
    1.0 - (0..k).map(miss).product::<f64>()
}

fn share(hits: &[bool], of_state: &[usize], states: usize, rng: &mut impl Rng) -> Interval {
    bootstrap(states, rng, |counts| {
        let weighed = |wanted: &dyn Fn(bool) -> bool| -> f64 {
            hits.iter().zip(of_state).filter(|(hit, _)| wanted(**hit)).map(|(_, &state)| counts[state]).sum()
        };
        weighed(&|hit| hit) / weighed(&|_| true)
    })
}

/// Latents of some of the grid's steps, in the grid's own order.
struct Cut {
    dims: usize,
    values: Vec<f32>,
}

fn steps_of(grid: &Grid<'_>, steps: std::ops::Range<usize>) -> Cut {
    let rows = grid.rows.chunks_exact(grid.steps().len()).flat_map(|cell| &cell[steps.clone()]);
    Cut { dims: grid.table().dims(), values: rows.flat_map(|&row| grid.table().row(row)).copied().collect() }
}

impl Cut {
    fn nearest(&self, queries: &[usize], labels: &[u32], options: RetrievalOptions) -> Result<Vec<Vec<u32>>, Error> {
        let keys: Vec<u32> = (0..labels.len() as u32).collect();
        let space = Space::new(Table::new(self.dims, &self.values, &keys, &keys)?, options.metric)?;
        let near = nearest(&space, queries, options.k, Exclude::Group(labels))?;
        Ok((0..queries.len()).map(|query| near.rows(query).to_vec()).collect())
    }
}
