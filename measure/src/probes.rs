//! What can be read from the latent? Probes from latents to known quantities, judged on trajectories they have not seen.
//!
//! In: tables with quantities, one value per row: task quantities, distractor parameters, the video shown. Out: for each quantity and each probe a score
//! with a 95% interval over state and distractor trajectories: R² of numbers, `1 - Σ (y - ŷ)² / Σ (y - ȳ)²` over the judged rows, and the
//! accuracy of classes. A good latent scores high on the task and at chance on the distractors.
//!
//! | probe | numbers | classes |
//! |---|---|---|
//! | linear | ridge regression, its penalty chosen by cross-validation over the trajectories it is fitted on | multinomial logistic regression |
//! | kNN | the mean of the ten nearest rows (standardized L2) | the most frequent class among them |
//!
//! Probes of numbers are fitted on other recordings where those are at hand ([`Fit::On`], the training recordings) and judged on every row of the table in
//! question: ten state trajectories are too few to fit on. Otherwise, and always for classes (another recording shows other videos), the table's own
//! trajectories are cut into five folds and every row is judged by a probe fitted on the other folds ([`Fit::HeldOut`]). A score says which it was ([`Fitting`]).
//!
//! Beside each score stands the same probe's on shuffled quantities (fitted on each trajectory's latents with another's quantities; on each cell's with another cell's
//! where the quantity may be the distractor's): what the number is worth. The action-only control is the same call on the table of
//! [`past_action_features`](crate::past_actions::past_action_features).

mod deal;
mod held_out;
mod knn;
mod logistic;
mod quantity;
mod ridge;
mod score;

pub use quantity::{HoldOut, Quantity, Values};

use rand::Rng;
use serde::Serialize;

use crate::intervals::Interval;
use crate::{Error, Table};

/// The two probes: what a linear reader finds, and what any smooth one could.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Probe {
    /// Ridge regression of numbers, logistic regression of classes.
    Linear,
    /// The mean, or the most frequent class, of the nearest rows.
    Knn,
}

/// What a probe was fitted on. Numbers that were fitted differently have different names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fitting {
    /// Other recordings than the judged one, those that were trained on.
    OtherRecordings,
    /// The judged table's own other trajectories, fold by fold.
    CrossValidation,
}

/// A table and what is to be read from it.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// The latents.
    pub table: Table<'a>,
    /// The quantities, one value per row of the table.
    pub quantities: &'a [Quantity],
}

/// What the probes of numbers are fitted on.
#[derive(Debug, Clone, Copy)]
pub enum Fit<'a> {
    /// The other trajectories of the same table.
    HeldOut,
    /// Another recording, with the same quantities in the same order.
    On(Sample<'a>),
}

/// How to probe.
#[derive(Debug, Clone, Copy)]
pub struct ProbeOptions {
    /// Folds; fewer if there are fewer trajectories.
    pub folds: usize,
    /// Neighbours of the kNN probe.
    pub neighbours: usize,
    /// Most rows the kNN probe predicts; more are drawn from (above 100,000 rows fewer, see [`bounded_queries`](crate::neighbours::bounded_queries)).
    pub knn_rows: usize,
    /// Most rows the logistic probe is fitted on; more are drawn from.
    pub logistic_rows: usize,
}

impl Default for ProbeOptions {
    fn default() -> Self {
        Self { folds: 5, neighbours: 10, knn_rows: 5000, logistic_rows: 5000 }
    }
}

/// How well a probe reads a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbeScore {
    /// Name of the quantity.
    pub quantity: String,
    /// Which probe.
    pub probe: Probe,
    /// What it was fitted on.
    pub fitting: Fitting,
    /// "R²" or "accuracy".
    pub measure: &'static str,
    /// On trajectories that the probe was not fitted on; interval over state and distractor trajectories.
    pub score: Interval,
    /// The same probe fitted on shuffled quantities.
    pub shuffled: Interval,
    /// What needs no latent: 0 for R², the share of the most frequent class for accuracy.
    pub chance: f64,
    /// Trajectories that were held out together, one after the other; the number of judged cells or episodes if the probe was fitted elsewhere.
    pub groups: usize,
}

/// The factor that makes a dimension's standard deviation 1; 0 where it does not vary: beside its own mean, a ten-millionth is what single precision leaves of a constant.
fn inverse_deviation(variance: f64, mean: f64) -> f64 {
    if variance > 1e-14 * (variance + mean * mean) { variance.sqrt().recip() } else { 0.0 }
}

/// How many trajectories of a table can be held out, one after the other, for a quantity of this kind; a probe that is cross-validated needs two.
///
/// # Errors
/// Distractors are to be held out, and the table is of no grid.
pub fn held_out_trajectories(table: &Table<'_>, hold_out: HoldOut) -> Result<usize, Error> {
    Ok(deal::count(&deal::groups(table, hold_out)?))
}

/// A score as its share of the way from chance to 1: an accuracy over chance, and an R², whose chance is 0, as it is.
#[must_use]
pub fn over_chance(score: f64, chance: f64) -> f64 {
    (score - chance) / (1.0 - chance).max(1e-12)
}

/// Probe a table for every quantity, linear and kNN.
///
/// # Errors
/// A quantity of another length or with a value that is not finite, fewer than two groups to hold out, no grid to hold out distractors of, another list of
/// quantities or other dimensions to fit on, latents that do not vary.
pub fn probe(
    judged: Sample<'_>,
    fit: Fit<'_>,
    options: ProbeOptions,
    rng: &mut impl Rng,
) -> Result<Vec<ProbeScore>, Error> {
    if let Fit::On(fitted) = fit {
        check_alike(judged, fitted)?;
    }
    let mut scores: Vec<Option<[ProbeScore; 2]>> = vec![None; judged.quantities.len()];
    // What the user asks for comes last, so that it changes nothing that is drawn for the others.
    for hold_out in [HoldOut::State, HoldOut::Episode, HoldOut::Distractor, HoldOut::StateOfUnknown] {
        for classes in [false, true] {
            let belongs = |quantity: &Quantity| {
                quantity.hold_out == hold_out && classes == matches!(quantity.values, Values::Classes(_))
            };
            let (places, own): (Vec<usize>, Vec<Quantity>) =
                judged.quantities.iter().enumerate().filter(|(_, q)| belongs(q)).map(|(at, q)| (at, q.clone())).unzip();
            if own.is_empty() {
                continue;
            }
            let own_judged = Sample { table: judged.table, quantities: &own };
            let found = match fit {
                Fit::On(fitted) if !classes => {
                    let theirs: Vec<Quantity> = places.iter().map(|&at| fitted.quantities[at].clone()).collect();
                    held_out::fitted_elsewhere(own_judged, Sample { quantities: &theirs, ..fitted }, options, rng)?
                }
                _ => held_out::within(own_judged, hold_out, options, rng)?,
            };
            places.into_iter().zip(found).for_each(|(place, pair)| scores[place] = Some(pair));
        }
    }
    let pairs: Vec<[ProbeScore; 2]> = scores.into_iter().flatten().collect();
    let of = |probe: usize| pairs.iter().map(move |pair| pair[probe].clone());
    Ok(of(0).chain(of(1)).collect())
}

fn check_alike(judged: Sample<'_>, fitted: Sample<'_>) -> Result<(), Error> {
    let (expected, found) = (judged.table.dims(), fitted.table.dims());
    if expected != found {
        return Err(Error::Length { what: "latent dimensions of the table to fit on", expected, found });
    }
    let (expected, found) = (judged.quantities.len(), fitted.quantities.len());
    let same = judged.quantities.iter().zip(fitted.quantities).all(|(a, b)| a.name == b.name);
    if expected != found || !same {
        return Err(Error::Length { what: "quantities of the table to fit on", expected, found });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
