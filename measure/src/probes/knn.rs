//! The kNN probe: what nearby rows of other trajectories say.

use rand::Rng;
use rand::seq::index;

use super::ProbeOptions;
use super::quantity::{Predictions, Targets};
use crate::neighbours::{Exclude, Metric, Neighbours, Space, bounded_queries, nearest, nearest_to};
use crate::{Error, Table};

/// Rows to predict, and their neighbours among the rows the probe is fitted on: found once for all quantities.
pub(super) struct Neighbourhoods {
    rows: Vec<usize>,
    near: Neighbours,
}

impl Neighbourhoods {
    /// Neighbours of some rows in the folds they are not in.
    pub(super) fn held_out(
        table: &Table<'_>,
        fold: &[u32],
        options: ProbeOptions,
        rng: &mut impl Rng,
    ) -> Result<Self, Error> {
        let rows = drawn(table.rows(), table.rows(), options, rng);
        let space = Space::new(*table, Metric::Standardized)?;
        // Every fold leaves at least one row in the others; few rows leave fewer than are asked for.
        let folds = fold.iter().max().map_or(0, |&last| last as usize + 1);
        let largest = (0..folds).map(|one| fold.iter().filter(|&&other| other as usize == one).count()).max();
        let k = options.neighbours.min(table.rows() - largest.unwrap_or(0)).max(1);
        let near = nearest(&space, &rows, k, Exclude::Group(fold))?;
        Ok(Self { rows, near })
    }

    /// Neighbours of some rows in another table.
    pub(super) fn elsewhere(
        fitted: &Table<'_>,
        judged: &Table<'_>,
        options: ProbeOptions,
        rng: &mut impl Rng,
    ) -> Result<Self, Error> {
        let rows = drawn(judged.rows(), fitted.rows(), options, rng);
        let values: Vec<f32> = rows.iter().flat_map(|&row| judged.row(row)).copied().collect();
        let keys: Vec<u32> = rows.iter().map(|&row| row as u32).collect();
        let some = Table::new(judged.dims(), &values, &keys, &keys)?;
        let near =
            nearest_to(&Space::new(*fitted, Metric::Standardized)?, &some, options.neighbours.min(fitted.rows()))?;
        Ok(Self { rows, near })
    }

    /// Mean target of each row's neighbours; for a class, the share of neighbours that have it.
    pub(super) fn predict(&self, targets: &Targets) -> Predictions {
        let mean = |query: usize| {
            let mut mean = vec![0.0; targets.columns];
            for &row in self.near.rows(query) {
                mean.iter_mut().zip(targets.row(row as usize)).for_each(|(mean, y)| *mean += y / self.near.k() as f64);
            }
            mean
        };
        Predictions { rows: self.rows.clone(), values: (0..self.rows.len()).flat_map(mean).collect() }
    }
}

/// The rows to predict, rising.
fn drawn(rows: usize, among: usize, options: ProbeOptions, rng: &mut impl Rng) -> Vec<usize> {
    let most = bounded_queries(options.knn_rows, among);
    let mut drawn = if rows > most { index::sample(rng, rows, most).into_vec() } else { (0..rows).collect() };
    drawn.sort_unstable();
    drawn
}
