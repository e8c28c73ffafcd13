//! Principal components: the plainest map, and where UMAP starts when the graph's spectrum will not do.
//!
//! In: a table. Out: `[rows, 2]` positions on the two directions of largest variance, and each one's share of it.

use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_reduction::Pca;
use ndarray::{Array2, Axis};

use crate::{Error, Table};

/// A table projected on its two leading principal components.
#[derive(Debug, Clone, PartialEq)]
pub struct PcaMap {
    /// `[rows, 2]`, centred.
    pub positions: Vec<[f32; 2]>,
    /// Share of the total variance along each.
    pub shares: [f64; 2],
}

/// Project a table. The sign of a component is free: its largest loading is made positive.
///
/// # Errors
/// Fewer than two rows, or rows all equal. With a single varying direction the second coordinate is 0.
pub fn pca(table: &Table<'_>) -> Result<PcaMap, Error> {
    let (rows, dims) = (table.rows(), table.dims());
    if rows < 2 {
        return Err(Error::TooFewRows {
            what: "PCA",
            needed: 2,
            found: rows,
        });
    }
    let values: Vec<f64> = table.values().iter().map(|&x| f64::from(x)).collect();
    let records = Array2::from_shape_vec((rows, dims), values);
    let mut records = records.map_err(|_shape| Error::Length {
        what: "latent",
        expected: rows * dims,
        found: table.values().len(),
    })?;
    let mean = records.sum_axis(Axis(0)) / rows as f64;
    records -= &mean;
    let total: f64 = records.iter().map(|x| x * x).sum();
    if total == 0.0 {
        return Err(Error::Constant { what: "PCA", rows });
    }
    let components = dims.min(2);
    let dataset = DatasetBase::from(records);
    let fitted = Pca::params(components)
        .fit(&dataset)
        .map_err(|source| Error::Linear {
            what: "PCA",
            reason: source.to_string(),
        })?;
    let mut directions = fitted.components().to_owned();
    for mut direction in directions.outer_iter_mut() {
        let largest = direction.iter().copied().fold(0.0_f64, |largest, x| {
            if x.abs() > largest.abs() { x } else { largest }
        });
        direction *= largest.signum();
    }
    let projected = dataset.records().dot(&directions.t());
    let coordinate = |row: usize, axis: usize| {
        if axis < components {
            projected[[row, axis]] as f32
        } else {
            0.0
        }
    };
    let positions = (0..rows)
        .map(|row| [coordinate(row, 0), coordinate(row, 1)])
        .collect();
    let share = |axis: usize| {
        fitted
            .singular_values()
            .get(axis)
            .map_or(0.0, |sigma| sigma * sigma / total)
    };
    Ok(PcaMap {
        positions,
        shares: [share(0), share(1)],
    })
}
