//! The kNN probe: what rows of other trajectories nearby say. Neighbours come from the other folds, so the folds are the exclusion.

use rand::Rng;
use rand::seq::index;

use super::ProbeOptions;
use super::quantity::Targets;
use crate::neighbours::{Exclude, Neighbours, Space, bounded_queries, nearest};
use crate::{Error, Table};

/// Rows to predict, and their neighbours in other folds: found once for all quantities.
pub(super) struct Neighbourhoods {
    pub rows: Vec<usize>,
    near: Neighbours,
}

impl Neighbourhoods {
    pub(super) fn new(
        table: &Table<'_>,
        fold: &[u32],
        options: ProbeOptions,
        rng: &mut impl Rng,
    ) -> Result<Self, Error> {
        let count = table.rows();
        let most = bounded_queries(options.knn_rows, count);
        let mut rows = if count > most { index::sample(rng, count, most).into_vec() } else { (0..count).collect() };
        rows.sort_unstable();
        let space = Space::new(*table, options.metric)?;
        let near = nearest(&space, &rows, options.neighbours, Exclude::Group(fold))?;
        Ok(Self { rows, near })
    }

    /// Mean target of each row's neighbours, `[rows to predict, columns]`; for a class, the share of neighbours that have it.
    pub(super) fn predict(&self, targets: &Targets) -> Vec<f64> {
        let mean = |query: usize| {
            let mut mean = vec![0.0; targets.columns];
            for &row in self.near.rows(query) {
                mean.iter_mut().zip(targets.row(row as usize)).for_each(|(mean, y)| *mean += y / self.near.k() as f64);
            }
            mean
        };
        (0..self.rows.len()).flat_map(mean).collect()
    }
}
