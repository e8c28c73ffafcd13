//! Nearest neighbours in the latent space, exact and the same every time.
//!
//! In: a [`Table`], a [`Metric`], the query rows, and which rows may not be neighbours (by default those of the
//! query's own trajectory). Out: for each query its `k` nearest rows, nearest first, ties by row.
//!
//! A sieve in single precision (blocks of matrix products, `search`) leaves the few rows that could be among the
//! `k` nearest once its rounding error is allowed for; their distances are then computed in double precision from the
//! table's own values. So the answer is exact, and does not depend on the machine or the number of threads.

mod ranks;
mod search;
mod space;

pub use space::{Metric, Space};

use rayon::prelude::*;

use crate::{Error, Table};

/// Which rows cannot be a query's neighbours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Exclude<'a> {
    /// Only the query itself.
    Itself,
    /// Every row of the query's own episode: otherwise a step's neighbours are the steps before and after it.
    #[default]
    Trajectory,
    /// Every row with the query's label, one label per row of the table.
    Group(&'a [u32]),
}

/// The `k` nearest rows of each query, `[queries, k]`, nearest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Neighbours {
    k: usize,
    rows: Vec<u32>,
    distances: Vec<f64>,
}

impl Neighbours {
    /// Neighbours that were found earlier: `rows` and `distances` `[queries, k]`, nearest first.
    ///
    /// # Errors
    /// Columns of unequal length, or not a whole number of queries long.
    pub fn from_parts(k: usize, rows: Vec<u32>, distances: Vec<f64>) -> Result<Self, Error> {
        let queries = rows.len().checked_div(k).unwrap_or(0);
        for found in [rows.len(), distances.len()] {
            if found != queries * k || found == 0 {
                return Err(Error::Length { what: "neighbour graph", expected: queries * k, found });
            }
        }
        Ok(Self { k, rows, distances })
    }

    /// The rows of all queries, `[queries, k]`.
    #[must_use]
    pub fn all_rows(&self) -> &[u32] {
        &self.rows
    }

    /// The distances of all queries, `[queries, k]`.
    #[must_use]
    pub fn all_distances(&self) -> &[f64] {
        &self.distances
    }

    /// Neighbours per query.
    #[must_use]
    pub fn k(&self) -> usize {
        self.k
    }

    /// Number of queries.
    #[must_use]
    pub fn queries(&self) -> usize {
        self.rows.len() / self.k
    }

    /// The rows nearest to a query, `[k]`.
    #[must_use]
    pub fn rows(&self, query: usize) -> &[u32] {
        &self.rows[query * self.k..(query + 1) * self.k]
    }

    /// Their distances, `[k]`.
    #[must_use]
    pub fn distances(&self, query: usize) -> &[f64] {
        &self.distances[query * self.k..(query + 1) * self.k]
    }

    /// The share of these neighbours that another search for the same queries found too, over all queries.
    #[must_use]
    pub fn shared_with(&self, other: &Self) -> f64 {
        let queries = self.queries().min(other.queries());
        let shared = |query: usize| self.rows(query).iter().filter(|row| other.rows(query).contains(row)).count();
        (0..queries).map(shared).sum::<usize>() as f64 / (queries * self.k) as f64
    }

    /// The same queries with only their `k` nearest.
    #[must_use]
    pub fn truncated(&self, k: usize) -> Self {
        let k = k.min(self.k);
        let keep = |query: usize| query * self.k..query * self.k + k;
        let rows = (0..self.queries()).flat_map(|query| self.rows[keep(query)].iter().copied()).collect();
        let distances = (0..self.queries()).flat_map(|query| self.distances[keep(query)].iter().copied()).collect();
        Self { k, rows, distances }
    }
}

/// The `k` nearest rows of each row in `queries`.
///
/// # Errors
/// `k` of zero, a query past the table, or fewer than `k` rows that may be its neighbours.
pub fn nearest(space: &Space<'_>, queries: &[usize], k: usize, exclude: Exclude<'_>) -> Result<Neighbours, Error> {
    let table = space.table();
    if let Some(&row) = queries.iter().find(|&&row| row >= table.rows()) {
        return Err(Error::NoSuchRow { row, rows: table.rows() });
    }
    let own: Vec<u32>;
    let labels = match exclude {
        Exclude::Itself => {
            own = (0..table.rows() as u32).collect();
            &own
        }
        Exclude::Trajectory => table.episode(),
        Exclude::Group(labels) if labels.len() == table.rows() => labels,
        Exclude::Group(labels) => {
            return Err(Error::Length { what: "group", expected: table.rows(), found: labels.len() });
        }
    };
    let points: Vec<f32> = queries.iter().flat_map(|&row| space.prepared(row)).copied().collect();
    let barred: Vec<Option<u32>> = queries.iter().map(|&row| Some(labels[row])).collect();
    let found = search::nearest(space, &points, &barred, labels, k, |query, row| space.distance(queries[query], row))?;
    complete(found, k, |query, found| {
        let excluded = match exclude {
            Exclude::Itself => "the row itself does not count",
            Exclude::Trajectory => "rows of its own trajectory do not count",
            Exclude::Group(_) => "rows of its own group do not count",
        };
        let row = queries[query];
        Error::TooFewNeighbours { episode: table.episode()[row], step: table.step()[row], needed: k, found, excluded }
    })
}

/// How many queries of at most `most` a measure asks for in a table of `rows` rows: their product stays bounded, so that a million rows
/// take as long as a hundred thousand.
#[must_use]
pub fn bounded_queries(most: usize, rows: usize) -> usize {
    const PAIRS: usize = 500_000_000;
    most.min((PAIRS / rows.max(1)).max(200))
}

/// The neighbour graph: the `k` nearest rows of every row.
///
/// # Errors
/// As [`nearest`].
pub fn graph(space: &Space<'_>, k: usize, exclude: Exclude<'_>) -> Result<Neighbours, Error> {
    let queries: Vec<usize> = (0..space.table().rows()).collect();
    nearest(space, &queries, k, exclude)
}

/// The `k` rows of `space` nearest to each latent of another table with the same dimensions, nothing excluded.
///
/// # Errors
/// Tables of unequal dimensions, or fewer than `k` rows.
pub fn nearest_to(space: &Space<'_>, others: &Table<'_>, k: usize) -> Result<Neighbours, Error> {
    let (table, dims) = (space.table(), space.table().dims());
    if others.dims() != dims {
        return Err(Error::Length { what: "latent dimensions", expected: dims, found: others.dims() });
    }
    let points: Vec<f32> = others.values().par_chunks(dims).flat_map_iter(|latent| space.prepare(latent)).collect();
    let barred = vec![None; others.rows()];
    let distance = |query: usize, row: usize| space.distance_between(others.row(query), table.row(row));
    let found = search::nearest(space, &points, &barred, table.episode(), k, distance)?;
    complete(found, k, |_, found| Error::TooFewRows { what: "the neighbour search", needed: k, found })
}

/// Flatten, or report the first query that has fewer than `k` neighbours.
fn complete(found: Vec<Vec<(f64, u32)>>, k: usize, short: impl Fn(usize, usize) -> Error) -> Result<Neighbours, Error> {
    if let Some(query) = found.iter().position(|near| near.len() < k) {
        return Err(short(query, found[query].len()));
    }
    let rows = found.iter().flatten().map(|&(_, row)| row).collect();
    let distances = found.iter().flatten().map(|&(distance, _)| distance).collect();
    Ok(Neighbours { k, rows, distances })
}

#[cfg(test)]
mod tests;
