//! How many dimensions a cloud of latents fills: the eigenvalues of its covariance.

use linfa_linalg::eigh::EigValsh;
use ndarray::{Array1, Array2, Axis};

use crate::Error;
use crate::intervals::{Interval, Range, crossed};
use crate::invariance::Grid;

/// Effective rank of a cloud and its total variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spectrum {
    /// `exp(-Σ p ln p)` over the covariance's eigenvalues divided by their sum (Roy and Vetterli, 2007): 1 for a line, the number of dimensions for a
    /// ball, 0 for a cloud without extent.
    pub effective_rank: f64,
    /// The eigenvalues' sum.
    pub variance: f64,
}

/// The spectrum of rows.
///
/// # Shapes
/// - `rows`: `[count, dims]`, row-major
///
/// # Errors
/// The eigenvalues were not found, as with values that are not finite.
pub fn spectrum(rows: &[f32], dims: usize) -> Result<Spectrum, Error> {
    let mut moments = Moments::zero(dims);
    rows.chunks_exact(dims.max(1)).for_each(|row| moments.add(row, &rows[..dims.min(rows.len())]));
    moments.spectrum()
}

/// The effective rank of a grid's latents over all rows, with an interval over state and distractor trajectories (see [`crossed`]).
///
/// # Errors
/// The eigenvalues were not found.
pub fn effective_rank(grid: &Grid<'_>) -> Result<Interval, Error> {
    let table = grid.table();
    let (states, distractors) = (grid.states().len(), grid.distractors().len());
    let zeros = |count: usize| vec![Moments::zero(table.dims()); count];
    let (mut whole, mut of_state, mut of_distractor) = (Moments::zero(table.dims()), zeros(states), zeros(distractors));
    let centre = table.row(grid.row(0, 0, 0));
    for (state, own) in of_state.iter_mut().enumerate() {
        for (distractor, of_distractor) in of_distractor.iter_mut().enumerate() {
            let mut cell = Moments::zero(table.dims());
            (0..grid.steps().len()).for_each(|step| cell.add(table.row(grid.row(state, distractor, step)), centre));
            own.merge(&cell, 1.0);
            of_distractor.merge(&cell, 1.0);
        }
        whole.merge(own, 1.0);
    }
    let without = |parts: &[Moments]| -> Result<Vec<f64>, Error> {
        let one = |part: &Moments| {
            let mut left = whole.clone();
            left.merge(part, -1.0);
            Ok(left.spectrum()?.effective_rank)
        };
        parts.iter().map(one).collect()
    };
    let (by_state, by_distractor) = (without(&of_state)?, without(&of_distractor)?);
    let rank = crossed(whole.spectrum()?.effective_rank, [&by_state, &by_distractor], Range::Positive);
    // No rank is below 1 or above the number of dimensions.
    let (low, high) = (rank.low.max(rank.estimate.min(1.0)), rank.high.min((table.dims() as f64).max(rank.estimate)));
    Ok(Interval { low, high, ..rank })
}

/// Sums over rows, less a point among them so that the squares keep their digits.
#[derive(Debug, Clone)]
struct Moments {
    count: f64,
    sum: Array1<f64>,
    /// `[dims, dims]`.
    products: Array2<f64>,
}

impl Moments {
    fn zero(dims: usize) -> Self {
        Self { count: 0.0, sum: Array1::zeros(dims), products: Array2::zeros((dims, dims)) }
    }

    fn add(&mut self, row: &[f32], centre: &[f32]) {
        let row: Array1<f64> = row.iter().zip(centre).map(|(&x, &centre)| f64::from(x) - f64::from(centre)).collect();
        self.count += 1.0;
        for (&x, mut products) in row.iter().zip(self.products.outer_iter_mut()) {
            products.scaled_add(x, &row);
        }
        self.sum += &row;
    }

    fn merge(&mut self, other: &Self, sign: f64) {
        self.count += sign * other.count;
        self.sum.scaled_add(sign, &other.sum);
        self.products.scaled_add(sign, &other.products);
    }

    fn spectrum(&self) -> Result<Spectrum, Error> {
        let failed = |reason: String| Error::Linear { what: "the effective rank", reason };
        let count = self.count.max(1.0);
        let mean = &self.sum / count;
        let column = mean.view().insert_axis(Axis(1));
        let covariance = &self.products / count - column.dot(&column.t());
        let variance: f64 = covariance.diag().sum();
        if !covariance.iter().all(|value| value.is_finite()) {
            return Err(failed("values that are not finite".to_owned()));
        }
        // Beside the size of the values, whatever their unit is: what is left is rounding.
        if variance <= 1e-14 * (&self.products.diag() / count).sum() {
            return Ok(Spectrum { effective_rank: 0.0, variance: 0.0 });
        }
        let values = covariance.eigvalsh().map_err(|source| failed(source.to_string()))?;
        let shares = values.iter().map(|value| value / variance).filter(|share| *share > 1e-12);
        Ok(Spectrum { effective_rank: shares.map(|share| -share * share.ln()).sum::<f64>().exp(), variance })
    }
}

#[cfg(test)]
mod tests {
    use super::spectrum;

    #[test]
    fn rank_counts_the_directions_that_vary() {
        let line: Vec<f32> = (0..10).flat_map(|i| [i as f32, 2.0 * i as f32, 0.5]).collect();
        assert!((spectrum(&line, 3).unwrap().effective_rank - 1.0).abs() < 1e-6);
        // The same directions in another unit.
        let small: Vec<f32> = line.iter().map(|value| value * 1e-9).collect();
        assert!((spectrum(&small, 3).unwrap().effective_rank - 1.0).abs() < 1e-6);
        assert_eq!(spectrum(&[0.3, 0.5].repeat(7), 2).unwrap().effective_rank, 0.0, "nothing varies");
        let square = [1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0];
        let found = spectrum(&square, 2).unwrap();
        assert!((found.effective_rank - 2.0).abs() < 1e-9 && (found.variance - 1.0).abs() < 1e-9);
        assert_eq!(spectrum(&[0.3; 12], 3).unwrap().effective_rank, 0.0);
        assert_eq!(spectrum(&[], 3).unwrap().effective_rank, 0.0);
    }

    /// Corners of a box have the covariance `diag(1, 4, 9)`, turned by 30 degrees the same eigenvalues.
    #[test]
    fn rank_of_known_eigenvalues_is_the_formula_whatever_the_axes() {
        let (sin, cos) = 30_f32.to_radians().sin_cos();
        let corner = |at: u32| {
            let [x, y, z] = [1.0, 2.0, 3.0_f32].map(|side| side);
            let sign = |bit: u32| if at >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let (x, y) = (x * sign(0), y * sign(1));
            [cos * x - sin * y, sin * x + cos * y, z * sign(2)]
        };
        let rows: Vec<f32> = (0..8).flat_map(corner).collect();
        let entropy: f64 = [1.0, 4.0, 9.0_f64].iter().map(|v| -(v / 14.0) * (v / 14.0).ln()).sum();
        let found = spectrum(&rows, 3).unwrap();
        assert!((found.effective_rank - entropy.exp()).abs() < 1e-6 && (found.variance - 14.0).abs() < 1e-5);
    }

    #[test]
    fn values_that_are_not_finite_are_an_error() {
        assert!(spectrum(&[f32::NAN, 1.0, 2.0, f32::INFINITY, 0.0, 3.0], 2).is_err());
    }
}
