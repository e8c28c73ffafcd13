//! Principal components: the plainest map, and where UMAP starts when the graph's spectrum will not do.
//!
//! In: a table. Out: `[rows, 2]` positions on the two directions of largest variance, and each one's share of it.
//!
//! Everything follows from the covariance matrix, one pass over the rows. Its leading directions come from linfa-reduction where there are ten dimensions
//! or more, and from linfa-linalg's full decomposition where there are fewer (linfa's iteration cannot begin there) or where the iteration has not
//! arrived, as with directions that are equally strong.

use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_linalg::cholesky::Cholesky;
use linfa_linalg::eigh::{EigSort, Eigh};
use linfa_reduction::Pca;
use ndarray::{Array1, Array2, Axis, concatenate};
use rayon::prelude::*;

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
    let mean = mean(table);
    let covariance = covariance(table, &mean);
    let total: f64 = covariance.diag().sum();
    if total == 0.0 {
        return Err(Error::Constant { what: "PCA", rows });
    }
    let components = match iterated(&covariance, total) {
        Some(components) => components,
        None => decomposed(&covariance)?,
    };
    // Directions without variance are not components.
    let used = |axis: usize| components.get(axis).is_some_and(|component| component.0 > 1e-12 * total);
    let direction = |axis: usize| -> Vec<f64> {
        let column: Vec<f64> = if used(axis) { components[axis].1.to_vec() } else { vec![0.0; dims] };
        let largest =
            column.iter().copied().fold(0.0_f64, |largest, x| if x.abs() > largest.abs() { x } else { largest });
        column.iter().map(|x| x * largest.signum()).collect()
    };
    let directions = [direction(0), direction(1)];
    let at = |row: &[f32]| {
        directions.each_ref().map(|direction| {
            let parts = row.iter().zip(&mean).zip(direction);
            parts.map(|((&x, mean), d)| (f64::from(x) - mean) * d).sum::<f64>() as f32
        })
    };
    let positions = table.values().par_chunks(dims).map(at).collect();
    let share = |axis: usize| if used(axis) { components[axis].0 / total } else { 0.0 };
    Ok(PcaMap { positions, shares: [share(0), share(1)] })
}

/// The leading directions and their variances by linfa-reduction; none where it cannot begin or has not arrived at the answer.
///
/// It takes rows and not a covariance `C = L Lᵀ`: those of `±Lᵀ` have that covariance, and are as few as twice the dimensions whatever the table's length.
fn iterated(covariance: &Array2<f64>, total: f64) -> Option<Vec<(f64, Array1<f64>)>> {
    const LEAST: usize = 10;
    let dims = covariance.nrows();
    if dims < LEAST {
        return None;
    }
    // Scaled to a total of 1, and a little more along every axis so that flat directions are no obstacle.
    let flat = Array2::<f64>::eye(dims) * 1e-14;
    let root = (covariance / total + flat).cholesky().ok()?.t().to_owned();
    let rows = concatenate(Axis(0), &[root.view(), (-&root).view()]).ok()?;
    let found = Pca::params(2).fit(&DatasetBase::from(rows)).ok()?;
    let component = |direction: &Array1<f64>| {
        let image = covariance.dot(direction) / total;
        let variance = direction.dot(&image);
        let off = (&image - &(direction * variance)).mapv(|x| x * x).sum().sqrt();
        (off < 1e-9).then(|| (variance * total, direction.clone()))
    };
    let norm = |direction: Array1<f64>| {
        let length = direction.dot(&direction).sqrt();
        direction / length
    };
    let directions = found.components().outer_iter().map(|direction| norm(direction.to_owned()));
    let components: Vec<(f64, Array1<f64>)> = directions.map(|d| component(&d)).collect::<Option<_>>()?;
    (components.len() == 2 && components[0].0 >= components[1].0).then_some(components)
}

/// All directions by rising weakness, with their variances.
fn decomposed(covariance: &Array2<f64>) -> Result<Vec<(f64, Array1<f64>)>, Error> {
    let failed = |source: linfa_linalg::LinalgError| Error::Linear { what: "PCA", reason: source.to_string() };
    let (variances, vectors) = covariance.eigh().map_err(failed)?.sort_eig_desc();
    Ok(variances.iter().zip(vectors.columns()).map(|(&variance, vector)| (variance, vector.to_owned())).collect())
}

/// Rows that are summed before their sum is added to the others': fixed, so that the result does not depend on the threads.
const BLOCK: usize = 4096;

fn mean(table: &Table<'_>) -> Vec<f64> {
    let mut mean = vec![0.0; table.dims()];
    for row in table.values().chunks_exact(table.dims()) {
        mean.iter_mut().zip(row).for_each(|(mean, &x)| *mean += f64::from(x));
    }
    mean.iter().map(|sum| sum / table.rows() as f64).collect()
}

/// Sums of products of the centred dimensions, `[dims, dims]`. A table has many rows and few dimensions, so that its decomposition costs one pass
/// over the rows and nothing else, and works where components are equally strong, on which iterative solvers founder.
fn covariance(table: &Table<'_>, mean: &[f64]) -> Array2<f64> {
    let dims = table.dims();
    let of_block = |block: &[f32]| {
        let centred: Vec<f64> = block.iter().enumerate().map(|(at, &x)| f64::from(x) - mean[at % dims]).collect();
        let rows = ndarray::ArrayView2::from_shape((block.len() / dims, dims), &centred);
        rows.map_or_else(|_shape| Array2::zeros((dims, dims)), |rows| rows.t().dot(&rows))
    };
    let blocks: Vec<Array2<f64>> = table.values().par_chunks(BLOCK * dims).map(of_block).collect();
    blocks.into_iter().fold(Array2::zeros((dims, dims)), |sum, block| sum + block)
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use ndarray::{Array1, Array2};

    use super::{decomposed, iterated, pca};
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

    /// linfa's PCA, by another algorithm, on directions it can tell apart.
    #[test]
    fn agrees_with_linfa_where_that_finds_the_components() {
        use linfa::traits::{Fit, Predict};
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let values: Vec<f32> =
            (0..500 * 6).map(|at| 3.0_f32.powi(2 - at % 6) * rng.random_range(-1.0..1.0) + 7.0).collect();
        let records = Array2::from_shape_fn((500, 6), |(row, dim)| f64::from(values[row * 6 + dim]));
        let dataset = linfa::DatasetBase::from(records.clone());
        let theirs = linfa_reduction::Pca::params(2).fit(&dataset).unwrap().predict(&records);
        table(&values, 6, |table| {
            let ours = pca(table).unwrap().positions;
            // The sign of a component is free.
            for axis in 0..2 {
                let sign = (theirs[[0, axis]] * f64::from(ours[0][axis])).signum();
                for (row, at) in ours.iter().enumerate() {
                    assert!((f64::from(at[axis]) - sign * theirs[[row, axis]]).abs() < 1e-3, "row {row}, axis {axis}");
                }
            }
        });
    }

    /// Both ways to the components agree where the first arrives, and it says so where it does not: with directions that are exactly as strong as each other, any two
    /// of them would do, and with one that is alone the second is among equals.
    #[test]
    fn the_iteration_agrees_with_the_decomposition_or_says_that_it_has_not_arrived() {
        let diagonal = |variance: &dyn Fn(usize) -> f64| Array2::from_diag(&Array1::from_shape_fn(16, variance));
        let (first, second) = (diagonal(&|at| 0.5_f64.powi(at as i32)), diagonal(&|at| 16.0 - at as f64));
        for covariance in [first, second] {
            let found = iterated(&covariance, covariance.diag().sum()).expect("distinct directions");
            for (one, other) in found.iter().zip(decomposed(&covariance).unwrap()) {
                assert!((one.0 - other.0).abs() < 1e-9 && (one.1.dot(&other.1).abs() - 1.0).abs() < 1e-9);
            }
        }
        for equal in [
            diagonal(&|_| 1.0),
            diagonal(&|at| if at == 0 { 4.0 } else { 1.0 }),
            diagonal(&|at| f64::from(u8::from(at < 2))),
        ] {
            if let Some(found) = iterated(&equal, equal.diag().sum()) {
                for ((variance, direction), exact) in found.iter().zip(decomposed(&equal).unwrap()) {
                    assert!((variance - exact.0).abs() < 1e-9 && (direction.dot(direction) - 1.0).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn equally_strong_directions_are_no_trouble() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let values: Vec<f32> = (0..20_000 * 16).map(|_| rng.random_range(-1.0..1.0)).collect();
        table(&values, 16, |table| {
            let map = pca(table).unwrap();
            assert!(map.positions.iter().flatten().all(|x| x.is_finite()));
            assert!(map.shares.iter().all(|share| (share - 1.0 / 16.0).abs() < 0.01), "{:?}", map.shares);
        });
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
