//! Ridge regression in closed form, `B = (XᵀX + λ n I)⁻¹ XᵀY` on latents of mean 0 and deviation 1.
//!
//! `λ` is chosen for each column from powers of ten between 1e-6 and 10, by the squared error over five parts of the trajectories that are fitted on, each
//! predicted from the others; then all are fitted on. Products are summed per part once, so neither the choice nor the fit reads the latents again.

use linfa_linalg::cholesky::SolveCInplace;
use ndarray::{Array1, Array2, Axis, s};
use rayon::prelude::*;

use super::deal::{Deal, PARTS};
use super::inverse_deviation;
use super::quantity::Targets;
use crate::{Error, Table};

/// Candidates for `λ`.
const LAMBDAS: [f64; 8] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
/// `λ` where there is one trajectory to fit on and nothing to choose by.
const PLAIN: f64 = 1e-3;

/// Every row's targets as predicted by the folds it is not in, `[rows, columns]`.
pub(super) fn predict(table: &Table<'_>, targets: &Targets, deal: &Deal) -> Result<Vec<f64>, Error> {
    let sums = sums(table, targets, deal);
    let of_fold = |out: usize| {
        let part = |part: usize| {
            let kept = (0..deal.folds).filter(|&fold| fold != out).map(|fold| &sums[fold * PARTS + part]);
            Moments::sum(kept, &sums[0].centre, targets.columns)
        };
        fit(&(0..PARTS).map(part).collect::<Vec<_>>())
    };
    let fits: Result<Vec<Linear>, Error> = (0..deal.folds).into_par_iter().map(of_fold).collect();
    let fits = fits?;
    let rows = (0..table.rows()).into_par_iter();
    Ok(rows.flat_map_iter(|row| fits[deal.fold[row] as usize].predict(table.row(row))).collect())
}

/// Every row of `judged` as predicted by a regression on all of `table`, `[rows, columns]`.
pub(super) fn predict_elsewhere(
    table: &Table<'_>,
    targets: &Targets,
    deal: &Deal,
    judged: &Table<'_>,
) -> Result<Vec<f64>, Error> {
    let sums = sums(table, targets, deal);
    let part = |part: usize| {
        let all = (0..deal.folds).map(|fold| &sums[fold * PARTS + part]);
        Moments::sum(all, &sums[0].centre, targets.columns)
    };
    let fit = fit(&(0..PARTS).map(part).collect::<Vec<_>>())?;
    Ok((0..judged.rows()).into_par_iter().flat_map_iter(|row| fit.predict(judged.row(row))).collect())
}

/// The moments of every fold and part about the table's mean, `[folds, PARTS]`. About the origin, what tells far latents apart would drown in the products.
fn sums(table: &Table<'_>, targets: &Targets, deal: &Deal) -> Vec<Moments> {
    let mut centre = vec![0.0; table.dims()];
    for row in 0..table.rows() {
        centre.iter_mut().zip(table.row(row)).for_each(|(sum, &x)| *sum += f64::from(x));
    }
    centre.iter_mut().for_each(|sum| *sum /= table.rows() as f64);
    let mut rows = vec![Vec::new(); deal.folds * PARTS];
    for row in 0..table.rows() {
        rows[deal.fold[row] as usize * PARTS + deal.part[row] as usize].push(row);
    }
    rows.par_iter().map(|rows| Moments::of(table, targets, rows, &centre)).collect()
}

/// The regression on all parts, with the penalty that predicts each part best from the others.
fn fit(parts: &[Moments]) -> Result<Linear, Error> {
    let (centre, columns) = (&parts[0].centre, parts[0].squares.len());
    let filled: Vec<&Moments> = parts.iter().filter(|part| part.rows() > 0.0).collect();
    let all = Moments::sum(filled.iter().copied(), centre, columns);
    if filled.len() < 2 {
        return all.fit(PLAIN);
    }
    let mut least = vec![f64::INFINITY; columns];
    let mut chosen = all.fit(PLAIN)?;
    for lambda in LAMBDAS {
        let mut errors = Array1::zeros(columns);
        for out in 0..filled.len() {
            let others = filled.iter().enumerate().filter(|(at, _)| *at != out).map(|(_, part)| *part);
            errors += &Moments::sum(others, centre, columns).fit(lambda)?.errors(filled[out]);
        }
        let fit = all.fit(lambda)?;
        for (column, least) in least.iter_mut().enumerate() {
            if errors[column] < *least {
                *least = errors[column];
                chosen.take(&fit, column);
            }
        }
    }
    Ok(chosen)
}

/// Sums over some rows of products of `(1, latent, target)`: `[1 + dims + columns]²`, the part a fit needs.
struct Moments {
    /// What is taken from every latent first, `[dims]`.
    centre: Vec<f64>,
    /// `[1 + dims, 1 + dims + columns]`: `Σ (1, x)ᵀ (1, x, y)`.
    products: Array2<f64>,
    /// `Σ y²`, `[columns]`.
    squares: Array1<f64>,
}

impl Moments {
    fn zero(centre: &[f64], columns: usize) -> Self {
        let dims = centre.len();
        Self {
            centre: centre.to_vec(),
            products: Array2::zeros((1 + dims, 1 + dims + columns)),
            squares: Array1::zeros(columns),
        }
    }

    fn sum<'m>(of: impl Iterator<Item = &'m Self>, centre: &[f64], columns: usize) -> Self {
        of.fold(Self::zero(centre, columns), |mut sum, more| {
            sum.products += &more.products;
            sum.squares += &more.squares;
            sum
        })
    }

    fn rows(&self) -> f64 {
        self.products[[0, 0]]
    }

    fn of(table: &Table<'_>, targets: &Targets, rows: &[usize], centre: &[f64]) -> Self {
        const BLOCK: usize = 1024;
        let mut sums = Self::zero(centre, targets.columns);
        let width = 1 + table.dims() + targets.columns;
        for block in rows.chunks(BLOCK) {
            let mut wide = Array2::zeros((block.len(), width));
            for (mut line, &row) in wide.outer_iter_mut().zip(block) {
                line[0] = 1.0;
                table.row(row).iter().enumerate().for_each(|(dim, &x)| line[1 + dim] = f64::from(x) - centre[dim]);
                targets.row(row).iter().enumerate().for_each(|(column, &y)| line[1 + table.dims() + column] = y);
            }
            sums.products += &wide.slice(s![.., ..=table.dims()]).t().dot(&wide);
            sums.squares += &wide.slice(s![.., 1 + table.dims()..]).mapv(|y| y * y).sum_axis(Axis(0));
        }
        sums
    }

    fn fit(&self, lambda: f64) -> Result<Linear, Error> {
        let (dims, count) = (self.centre.len(), self.rows());
        let mean = &self.products.slice(s![0, ..]) / count;
        // Covariances: products less the means'.
        let mut centred = self.products.slice(s![1.., 1..]).to_owned() / count;
        for dim in 0..dims {
            let shift = &mean.slice(s![1..]) * mean[1 + dim];
            let mut line = centred.row_mut(dim);
            line -= &shift;
        }
        // A dimension that these rows do not vary in, and others do, lies off the table's mean: what products leave of its variance is rounding.
        let scale = Array1::from_shape_fn(dims, |dim| {
            let (variance, off) = (centred[[dim, dim]], mean[1 + dim]);
            if variance > 1e-12 * off * off { inverse_deviation(variance, self.centre[dim] + off) } else { 0.0 }
        });
        let mut gram = Array2::from_shape_fn((dims, dims), |(a, b)| centred[[a, b]] * scale[a] * scale[b]);
        gram.diag_mut().mapv_inplace(|x| x + lambda);
        let mut weights = centred.slice(s![.., dims..]).to_owned() * scale.view().insert_axis(Axis(1));
        let failed =
            |source: linfa_linalg::LinalgError| Error::Linear { what: "the ridge probe", reason: format!("{source}") };
        gram.solvec_inplace(&mut weights).map_err(failed)?;
        weights *= &scale.insert_axis(Axis(1));
        let shift: Array1<f64> = weights.t().dot(&mean.slice(s![1..=dims]));
        let offset = &mean.slice(s![1 + dims..]) - &shift;
        Ok(Linear { centre: self.centre.clone(), weights, offset })
    }
}

/// `y = offset + (x − centre) · weights`.
struct Linear {
    /// `[dims]`.
    centre: Vec<f64>,
    /// `[dims, columns]`.
    weights: Array2<f64>,
    offset: Array1<f64>,
}

impl Linear {
    fn predict(&self, latent: &[f32]) -> Vec<f64> {
        let mut y = self.offset.to_vec();
        for ((&x, centre), weights) in latent.iter().zip(&self.centre).zip(self.weights.outer_iter()) {
            y.iter_mut().zip(weights).for_each(|(y, weight)| *y += (f64::from(x) - centre) * weight);
        }
        y
    }

    /// Replace one column by another fit's.
    fn take(&mut self, other: &Self, column: usize) {
        self.weights.column_mut(column).assign(&other.weights.column(column));
        self.offset[column] = other.offset[column];
    }

    /// Squared error of each column on some rows, from their moments alone.
    fn errors(&self, on: &Moments) -> Array1<f64> {
        let mut full = Array2::zeros((1 + on.centre.len(), self.offset.len()));
        full.row_mut(0).assign(&self.offset);
        full.slice_mut(s![1.., ..]).assign(&self.weights);
        let cross = (&full * &on.products.slice(s![.., 1 + on.centre.len()..])).sum_axis(Axis(0));
        let quadratic = (&full * &on.products.slice(s![.., ..=on.centre.len()]).dot(&full)).sum_axis(Axis(0));
        &on.squares - 2.0 * &cross + &quadratic
    }
}
