//! How good predictions are: R² of numbers, accuracy of classes, with an interval over state and distractor trajectories.

use rand::Rng;

use super::quantity::{Predictions, Targets};
use crate::Table;
use crate::intervals::{Interval, Trajectories};

/// The truth, and what is drawn again for intervals.
#[derive(Debug, Clone)]
pub(super) struct Judge<'a> {
    targets: &'a Targets,
    trajectories: Trajectories,
}

impl<'a> Judge<'a> {
    pub(super) fn new(targets: &'a Targets, table: &Table<'_>) -> Self {
        Self { targets, trajectories: table.trajectories() }
    }

    /// The score of one quantity's predictions.
    pub(super) fn score(&self, quantity: usize, found: &Predictions, rng: &mut impl Rng) -> Interval {
        let span = self.targets.spans[quantity];
        let mut sums = vec![Sums::default(); self.trajectories.units()];
        for (&row, predicted) in found.rows.iter().zip(found.values.chunks_exact(self.targets.columns)) {
            let true_values = &self.targets.row(row)[span.first..span.first + span.columns];
            let predicted = &predicted[span.first..span.first + span.columns];
            let sums = &mut sums[self.trajectories.unit(row)];
            sums.rows += 1.0;
            if span.classes {
                sums.hits += f64::from(u8::from(largest(predicted) == largest(true_values)));
            } else {
                sums.add(true_values[0], predicted[0]);
            }
        }
        self.trajectories.bootstrap(rng, |weights| {
            let total = |part: fn(&Sums) -> f64| {
                sums.iter().zip(weights).map(|(sums, weight)| weight * part(sums)).sum::<f64>()
            };
            let rows = total(|sums| sums.rows);
            if span.classes {
                return total(|sums| sums.hits) / rows;
            }
            let sum = total(|sums| sums.sum);
            1.0 - total(|sums| sums.error) / (total(|sums| sums.squares) - sum * sum / rows)
        })
    }
}

/// What a cell or episode contributes.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    rows: f64,
    hits: f64,
    error: f64,
    sum: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, y: f64, predicted: f64) {
        self.error += (y - predicted).powi(2);
        self.sum += y;
        self.squares += y * y;
    }
}

/// The first of the largest.
fn largest(values: &[f64]) -> usize {
    values.iter().enumerate().fold((0, f64::NEG_INFINITY), |best, (at, &x)| if x > best.1 { (at, x) } else { best }).0
}
