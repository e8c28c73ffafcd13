//! What can be read from the latent? Probes from latents to known quantities, judged on trajectories they have not seen.
//!
//! In: a table and quantities with one value per row: task quantities, distractor parameters, the video shown. Out: for each and each
//! probe (`ridge`, `knn`) a score with a 95% interval: R² of numbers, accuracy of classes. A good latent scores
//! high on the task and at chance on the distractors.
//!
//! Trajectories are cut into five folds; every row is predicted by a probe fitted to the other folds. Beside each score stands the same probe's
//! on shuffled quantities (each trajectory given another's): what the number is worth. The action-only control is the same call on
//! the table of an encoder that sees only actions.

mod knn;
mod quantity;
mod ridge;
mod score;

pub use quantity::{Quantity, Values};

use rand::Rng;
use rand::seq::SliceRandom;
use serde::Serialize;

use crate::intervals::Interval;
use crate::neighbours::Metric;
use crate::{Error, Table};
use quantity::Targets;

/// The two probes: what a linear reader finds, and what any smooth one could.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Probe {
    /// Ridge regression; classes as one column of zeros and ones each, the largest prediction wins.
    Ridge,
    /// The mean, or the most frequent class, of the nearest rows.
    Knn,
}

/// What must be held out together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HoldOut {
    /// State trajectories of rows on a grid (the cells of a row share their states), episodes of others.
    #[default]
    State,
    /// Episodes.
    Episode,
    /// Distractor trajectories: whether a distractor's parameters can be read from one never seen.
    Distractor,
}

/// How to probe.
#[derive(Debug, Clone, Copy)]
pub struct ProbeOptions {
    /// What is held out together.
    pub hold_out: HoldOut,
    /// Folds; fewer if there are fewer trajectories.
    pub folds: usize,
    /// Neighbours of the kNN probe.
    pub neighbours: usize,
    /// Its measure of nearness.
    pub metric: Metric,
    /// Most rows the kNN probe predicts; more are drawn from (above 100,000 rows fewer, see [`bounded_queries`](crate::neighbours::bounded_queries)).
    pub knn_rows: usize,
}

impl Default for ProbeOptions {
    fn default() -> Self {
        Self { hold_out: HoldOut::State, folds: 5, neighbours: 10, metric: Metric::Standardized, knn_rows: 5000 }
    }
}

/// How well a probe reads a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbeScore {
    /// Name of the quantity.
    pub quantity: String,
    /// Which probe.
    pub probe: Probe,
    /// "R²" or "accuracy".
    pub measure: &'static str,
    /// On held-out trajectories; interval over trajectories.
    pub score: Interval,
    /// The same probe on shuffled quantities.
    pub shuffled: Interval,
    /// What needs no latent: 0 for R², the share of the most frequent class for accuracy.
    pub chance: f64,
    /// Held-out groups (trajectories).
    pub groups: usize,
}

/// Probe a table for every quantity, ridge and kNN.
///
/// # Errors
/// A quantity of another length or with a value that is not finite, fewer than two groups, no grid to hold out distractors of,
/// latents that do not vary.
pub fn probe(
    table: &Table<'_>,
    quantities: &[Quantity],
    options: ProbeOptions,
    rng: &mut impl Rng,
) -> Result<Vec<ProbeScore>, Error> {
    let groups = groups(table, options.hold_out)?;
    let count = groups.iter().max().map_or(0, |&last| last as usize + 1);
    if count < 2 {
        return Err(Error::TooFewRows { what: "a probe: trajectories", needed: 2, found: count });
    }
    let folds = folds(count, options.folds, rng);
    let fold: Vec<u32> = groups.iter().map(|&group| folds[group as usize]).collect();
    let targets = Targets::new(table, quantities)?;
    let shuffled = targets.shuffled(&groups, count, rng);
    let mut scores = Vec::new();
    for probe in [Probe::Ridge, Probe::Knn] {
        let (rows, predicted, control) = match probe {
            Probe::Ridge => {
                let rows: Vec<usize> = (0..table.rows()).collect();
                (rows, ridge::predict(table, &targets, &fold)?, ridge::predict(table, &shuffled, &fold)?)
            }
            Probe::Knn => {
                let neighbours = knn::Neighbourhoods::new(table, &fold, options, rng)?;
                (neighbours.rows.clone(), neighbours.predict(&targets), neighbours.predict(&shuffled))
            }
        };
        for (at, quantity) in quantities.iter().enumerate() {
            let judge = |targets: &Targets, predicted: &[f64], rng: &mut _| {
                score::score(targets, at, predicted, &rows, &groups, count, rng)
            };
            let (score, shuffled) = (judge(&targets, &predicted, rng), judge(&shuffled, &control, rng));
            let (measure, chance) = targets.measure(at);
            scores.push(ProbeScore {
                quantity: quantity.name.clone(),
                probe,
                measure,
                score,
                shuffled,
                chance,
                groups: count,
            });
        }
    }
    Ok(scores)
}

/// The group of each row, numbered from 0.
fn groups(table: &Table<'_>, hold_out: HoldOut) -> Result<Vec<u32>, Error> {
    let cells: Option<Vec<(u32, u32)>> = (0..table.rows()).map(|row| table.cell(row)).collect();
    let labels: Vec<u32> = match (hold_out, cells) {
        (HoldOut::State, _) => return Ok(table.trajectories()),
        (HoldOut::Distractor, Some(cells)) => cells.iter().map(|cell| cell.1).collect(),
        (HoldOut::Distractor, None) => return Err(Error::NoGrid),
        (HoldOut::Episode, _) => table.episode().to_vec(),
    };
    let mut names = labels.clone();
    names.sort_unstable();
    names.dedup();
    Ok(labels.iter().map(|label| names.partition_point(|name| name < label) as u32).collect())
}

/// The fold of each group: a shuffled deal.
fn folds(groups: usize, folds: usize, rng: &mut impl Rng) -> Vec<u32> {
    let folds = folds.clamp(2, groups) as u32;
    let mut deal: Vec<u32> = (0..groups as u32).map(|group| group % folds).collect();
    deal.shuffle(rng);
    deal
}

#[cfg(test)]
mod tests;
