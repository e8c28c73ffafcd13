//! Which class? Multinomial logistic regression with an L2 penalty (linfa-logistic), on latents of mean 0 and deviation 1.

use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_logistic::MultiLogisticRegression;
use ndarray::{Array1, Array2};
use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;

use super::inverse_deviation;
use super::quantity::{Predictions, Targets};
use crate::{Error, Table};

/// What one fold predicts: a row and its score of every class, `[classes]`.
type FoldScores = Vec<(usize, Vec<f64>)>;

/// Penalty on the squared weights, beside the summed log-loss: that of a standard normal prior.
const PENALTY: f64 = 1.0;
/// Steps of L-BFGS at most.
const STEPS: u64 = 200;

/// Class probabilities of rows (at most `most` of them, drawn) by regressions fitted on the folds they are not in (again at most `most` rows).
pub(super) fn predict(
    table: &Table<'_>,
    targets: &Targets,
    fold: &[u32],
    most: usize,
    rng: &mut impl Rng,
) -> Result<Predictions, Error> {
    let rows = table.rows();
    let mut drawn = if rows > most { index::sample(rng, rows, most).into_vec() } else { (0..rows).collect() };
    drawn.sort_unstable();
    let folds = fold.iter().max().map_or(0, |&last| last + 1);
    let mut values = vec![0.0; drawn.len() * targets.columns];
    for span in &targets.spans {
        let classes: Vec<usize> =
            drawn.iter().map(|&row| class(&targets.row(row)[span.first..][..span.columns])).collect();
        let per_fold: Result<Vec<FoldScores>, Error> = (0..folds)
            .into_par_iter()
            .map(|out| {
                let (apart, fitted): (Vec<usize>, Vec<usize>) =
                    (0..drawn.len()).partition(|&at| fold[drawn[at]] == out);
                let model = Model::fit(table, &drawn, &classes, &fitted, span.columns)?;
                Ok(apart.into_iter().map(|at| (at, model.probabilities(table.row(drawn[at])))).collect())
            })
            .collect();
        for (at, probabilities) in per_fold?.into_iter().flatten() {
            let place = at * targets.columns + span.first;
            values[place..place + span.columns].copy_from_slice(&probabilities);
        }
    }
    Ok(Predictions { rows: drawn, values })
}

/// The place of the one in an indicator.
fn class(indicator: &[f64]) -> usize {
    indicator.iter().position(|&x| x > 0.5).unwrap_or(0)
}

/// A fitted regression.
struct Model {
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// Weights of the classes that the fitted rows show, `[dims, classes]`, and their offsets.
    fitted: Option<(Array2<f64>, Array1<f64>)>,
    /// Which classes these are.
    classes: Vec<usize>,
    /// All classes.
    count: usize,
}

impl Model {
    /// On the rows `drawn[at]` for `at` in `fitted`.
    fn fit(
        table: &Table<'_>,
        drawn: &[usize],
        classes: &[usize],
        fitted: &[usize],
        count: usize,
    ) -> Result<Self, Error> {
        let latent = |at: usize, dim: usize| f64::from(table.row(drawn[fitted[at]])[dim]);
        let moments = |dim: usize| {
            let mean = (0..fitted.len()).map(|at| latent(at, dim)).sum::<f64>() / fitted.len() as f64;
            let square =
                (0..fitted.len()).map(|at| (latent(at, dim) - mean).powi(2)).sum::<f64>() / fitted.len() as f64;
            (mean, square)
        };
        let (mean, variance): (Vec<f64>, Vec<f64>) = (0..table.dims()).map(moments).unzip();
        let scale = variance.iter().zip(&mean).map(|(&variance, &mean)| inverse_deviation(variance, mean)).collect();
        let labels: Array1<usize> = fitted.iter().map(|&at| classes[at]).collect();
        let mut present = labels.to_vec();
        present.sort_unstable();
        present.dedup();
        let mut model = Self { mean, scale, fitted: None, classes: present, count };
        if model.classes.len() > 1 {
            let records = Array2::from_shape_fn((fitted.len(), table.dims()), |(at, dim)| {
                (latent(at, dim) - model.mean[dim]) * model.scale[dim]
            });
            let failed = |source: linfa_logistic::error::Error| Error::Linear {
                what: "the logistic probe",
                reason: source.to_string(),
            };
            let regression = MultiLogisticRegression::default().alpha(PENALTY).max_iterations(STEPS);
            let found = regression.fit(&DatasetBase::new(records, labels)).map_err(failed)?;
            model.fitted = Some((found.params().clone(), found.intercept().clone()));
        }
        Ok(model)
    }

    /// Of every class; 0 for one that no fitted row shows.
    fn probabilities(&self, latent: &[f32]) -> Vec<f64> {
        let mut all = vec![0.0; self.count];
        let Some((weights, offsets)) = &self.fitted else {
            self.classes.iter().for_each(|&class| all[class] = 1.0);
            return all;
        };
        let x: Array1<f64> = latent
            .iter()
            .zip(&self.mean)
            .zip(&self.scale)
            .map(|((&x, mean), scale)| (f64::from(x) - mean) * scale)
            .collect();
        let scores = x.dot(weights) + offsets;
        let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares = scores.mapv(|score| (score - largest).exp());
        let total = shares.sum();
        self.classes.iter().zip(&shares).for_each(|(&class, share)| all[class] = share / total);
        all
    }
}
