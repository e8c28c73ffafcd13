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

/// The effective rank of a grid's latents over all rows, with an interval over state and distractor trajectories (see [`crossed`]). As everywhere there is none
/// with fewer than three states or distractors, nor where nothing varies without one of them.
///
/// # Errors
/// The eigenvalues were not found.
pub fn effective_rank(grid: &Grid<'_>) -> Result<Interval, Error> {
    let [of_state, of_distractor] = moments(grid);
    let mut whole = Moments::zero(grid.table().dims());
    of_state.iter().for_each(|own| whole.merge(own, 1.0));
    let rounding = ROUNDING * whole.squares();
    let one = |part: &Moments| -> Result<f64, Error> {
        let mut left = whole.clone();
        left.merge(part, -1.0);
        let found = left.spectrum()?;
        // Nothing has no rank, and what rounding leaves of nothing has one of anything.
        Ok(if found.variance > rounding { found.effective_rank } else { f64::NAN })
    };
    let without = |parts: &[Moments]| parts.iter().map(one).collect::<Result<Vec<f64>, Error>>();
    let (by_state, by_distractor) = (without(&of_state)?, without(&of_distractor)?);
    let rank = crossed(whole.spectrum()?.effective_rank, [&by_state, &by_distractor], Range::Positive);
    Ok(within_bounds(rank, grid.table().dims()))
}

/// What is left of a grid without one of its trajectories varies by more than this share of the whole's squares, or not at all.
const ROUNDING: f64 = 1e-12;

/// The sums of each state trajectory, and those of each distractor trajectory.
fn moments(grid: &Grid<'_>) -> [Vec<Moments>; 2] {
    let table = grid.table();
    let zeros = |count: usize| vec![Moments::zero(table.dims()); count];
    let (mut of_state, mut of_distractor) = (zeros(grid.states().len()), zeros(grid.distractors().len()));
    let centre = table.row(grid.row(0, 0, 0));
    for (state, own) in of_state.iter_mut().enumerate() {
        for (distractor, of_distractor) in of_distractor.iter_mut().enumerate() {
            let mut cell = Moments::zero(table.dims());
            (0..grid.steps().len()).for_each(|step| cell.add(table.row(grid.row(state, distractor, step)), centre));
            own.merge(&cell, 1.0);
            of_distractor.merge(&cell, 1.0);
        }
    }
    [of_state, of_distractor]
}

/// No rank is below 1 or above the number of dimensions. No interval stays none: `max` and `min` would make an end of one that is not a number.
fn within_bounds(rank: Interval, dims: usize) -> Interval {
    if rank.low.is_nan() || rank.high.is_nan() {
        return rank;
    }
    let (least, most) = (rank.estimate.min(1.0), rank.estimate.max(dims as f64));
    Interval { low: rank.low.max(least), high: rank.high.min(most), ..rank }
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

    /// The mean square of a row about the point that was taken off.
    fn squares(&self) -> f64 {
        self.products.diag().sum() / self.count.max(1.0)
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
        if variance <= 1e-14 * self.squares() {
            return Ok(Spectrum { effective_rank: 0.0, variance: 0.0 });
        }
        let values = covariance.eigvalsh().map_err(|source| failed(source.to_string()))?;
        let shares = values.iter().map(|value| value / variance).filter(|share| *share > 1e-12);
        Ok(Spectrum { effective_rank: shares.map(|share| -share * share.ln()).sum::<f64>().exp(), variance })
    }
}

#[cfg(test)]
mod tests {
    use super::{effective_rank, spectrum};
    use crate::Table;
    use crate::intervals::Interval;
    use crate::invariance::Grid;

    /// The effective rank of a grid of four steps whose latent is `latent(state, distractor, step)`.
    fn rank(states: u32, distractors: u32, latent: impl Fn(u32, u32, u32) -> [f32; 3]) -> Interval {
        let rows = 0..states * distractors * 4;
        let keys: Vec<[u32; 3]> = rows.map(|row| [row / (distractors * 4), row / 4 % distractors, row % 4]).collect();
        let values: Vec<f32> = keys.iter().flat_map(|&[i, j, t]| latent(i, j, t)).collect();
        let episode: Vec<u32> = keys.iter().map(|&[i, j, _]| i * distractors + j).collect();
        let step: Vec<u32> = keys.iter().map(|key| key[2]).collect();
        let [state, distractor] = [0, 1].map(|part| keys.iter().map(|key| Some(key[part])).collect::<Vec<_>>());
        let table = Table::new(3, &values, &episode, &step).unwrap().with_grid(&state, &distractor).unwrap();
        effective_rank(&Grid::new(table).unwrap()).unwrap()
    }

    /// A latent in which state, distractor and step each move a dimension, and a little of the others.
    fn mixed(i: u32, j: u32, t: u32) -> [f32; 3] {
        let [i, j, t] = [i, j, t].map(|x| x as f32);
        [(1.3 * i).sin() + 0.1 * j, (2.1 * j).cos() - 0.1 * i * t, (0.7 * t + i).sin() + 0.2 * j]
    }

    #[test]
    fn a_rank_of_two_states_or_distractors_has_no_interval() {
        for (states, distractors) in [(2, 3), (3, 2), (2, 2), (2, 9)] {
            let found = rank(states, distractors, mixed);
            assert!(found.estimate > 1.0 && found.estimate < 3.0, "{found:?}");
            assert!(found.low.is_nan() && found.high.is_nan(), "{states} x {distractors}: {found:?}");
        }
        let found = rank(5, 4, mixed);
        assert!(1.0 <= found.low && found.low < found.estimate, "{found:?}");
        assert!(found.estimate < found.high && found.high <= 3.0, "{found:?}");
    }

    /// In a unit that single precision has exactly and in one of which the sums leave rounding.
    #[test]
    fn a_rank_that_rests_on_one_trajectory_has_no_interval() {
        for unit in [1.0_f32, 0.1] {
            let of_state =
                rank(4, 4, |i, j, t| if i == 1 { mixed(j, i, t).map(|x| unit * x) } else { [0.7 * unit; 3] });
            let of_distractor = rank(4, 4, |i, j, t| if j == 0 { mixed(i, j, t) } else { [unit, 0.3, -unit] });
            for found in [of_state, of_distractor] {
                assert!(found.estimate > 1.0 && found.low.is_nan() && found.high.is_nan(), "{unit}: {found:?}");
            }
        }
    }

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
