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
        return Err(Error::TooFewRows { what: "PCA", needed: 2, found: rows });
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
    let dataset = DatasetBase::from(records);
    let fitted = Pca::params(dims.min(2))
        .fit(&dataset)
        .map_err(|source| Error::Linear { what: "PCA", reason: source.to_string() })?;
    // Directions without variance are not among them.
    let mut directions = fitted.components().to_owned();
    let components = directions.nrows();
    for mut direction in directions.outer_iter_mut() {
        let largest =
            direction.iter().copied().fold(0.0_f64, |largest, x| if x.abs() > largest.abs() { x } else { largest });
        direction *= largest.signum();
    }
    let projected = dataset.records().dot(&directions.t());
    let coordinate = |row: usize, axis: usize| {
        if axis < components { projected[[row, axis]] as f32 } else { 0.0 }
    };
    let positions = (0..rows).map(|row| [coordinate(row, 0), coordinate(row, 1)]).collect();
    let share = |axis: usize| fitted.singular_values().get(axis).map_or(0.0, |sigma| sigma * sigma / total);
    Ok(PcaMap { positions, shares: [share(0), share(1)] })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::pca;
    use crate::{Error, Table};

    fn table(values: &[f32], dims: usize, run: impl FnOnce(&Table<'_>)) {
        let keys = vec![0; values.len() / dims];
        run(&Table::new(dims, values, &keys, &keys).unwrap());
    }

    /// Dimensions of standard deviation 4, 2, 1, 1, … far from the origin: the first two are the components.
    #[test]
    fn finds_the_directions_of_largest_variance() {
        for dims in [2, 3, 4, 7, 32] {
            let mut rng = ChaCha8Rng::seed_from_u64(dims as u64);
            let scale = |dim: usize| {
                if dim == 0 {
                    4.0
                } else if dim == 1 {
                    2.0
                } else {
                    1.0_f32
                }
            };
            let values: Vec<f32> =
                (0..4000 * dims).map(|at| 50.0 + scale(at % dims) * rng.random_range(-1.0..1.0)).collect();
            table(&values, dims, |table| {
                let map = pca(table).unwrap();
                for (row, at) in map.positions.iter().enumerate() {
                    assert!((at[0] - (table.row(row)[0] - 50.0)).abs() < 0.4, "{dims} dims, row {row}: {at:?}");
                    assert!((at[1] - (table.row(row)[1] - 50.0)).abs() < 0.4, "{dims} dims, row {row}: {at:?}");
                }
                let total = 20.0 + (dims as f64 - 2.0);
                assert!((map.shares[0] - 16.0 / total).abs() < 0.03 && (map.shares[1] - 4.0 / total).abs() < 0.03);
            });
        }
    }

    #[test]
    fn flat_and_tiny_tables_have_a_map_too() {
        table(&[1.0, 2.0, 3.0, 4.0], 1, |table| {
            let map = pca(table).unwrap();
            assert!((map.positions[3][0] - 1.5).abs() < 1e-6 && map.positions.iter().all(|at| at[1] == 0.0));
        });
        // All on one line in eight dimensions.
        let line: Vec<f32> = (0..50).flat_map(|row| [row as f32; 8]).collect();
        table(&line, 8, |table| {
            let map = pca(table).unwrap();
            assert!(map.positions.iter().all(|at| at[0].is_finite() && at[1].abs() < 1e-3), "{:?}", map.positions);
            assert!((map.shares[0] - 1.0).abs() < 1e-6);
        });
        table(&[0.0, 0.0, 3.0, 4.0], 2, |table| assert!((pca(table).unwrap().positions[1][0] - 2.5).abs() < 1e-5));
        table(&[7.0; 12], 3, |table| assert!(matches!(pca(table), Err(Error::Constant { rows: 4, .. }))));
        table(&[7.0; 3], 3, |table| assert!(matches!(pca(table), Err(Error::TooFewRows { .. }))));
    }
}
