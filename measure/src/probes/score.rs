//! How good predictions are: R² of numbers, accuracy of classes, with an interval over state and distractor trajectories.

use rand::Rng;

use super::quantity::{Predictions, Targets};
use crate::Table;
use crate::intervals::{Interval, Trajectories};
use crate::r_squared::{Squares, r_squared};

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
        let columns = span.first..span.first + span.columns;
        let pairs = found.rows.iter().zip(found.values.chunks_exact(self.targets.columns)).map(|(&row, predicted)| {
            (self.trajectories.unit(row), &self.targets.row(row)[columns.clone()], &predicted[columns.clone()])
        });
        if span.classes { self.accuracy(pairs, rng) } else { self.r_squared(pairs, rng) }
    }

    /// Of numbers: `(cell or episode, value, prediction)` a row.
    fn r_squared<'v>(&self, pairs: impl Iterator<Item = Pair<'v>>, rng: &mut impl Rng) -> Interval {
        let mut squares = vec![Squares::default(); self.trajectories.units()];
        pairs.for_each(|(unit, value, predicted)| squares[unit].add(value[0], predicted[0]));
        self.trajectories.bootstrap(rng, |weights| r_squared(&squares, weights))
    }

    /// Of classes: `(cell or episode, indicators, shares)` a row.
    fn accuracy<'v>(&self, pairs: impl Iterator<Item = Pair<'v>>, rng: &mut impl Rng) -> Interval {
        let mut sums = vec![(0.0, 0.0); self.trajectories.units()];
        for (unit, value, predicted) in pairs {
            let (hits, rows) = &mut sums[unit];
            *hits += f64::from(u8::from(largest(predicted) == largest(value)));
            *rows += 1.0;
        }
        self.trajectories.bootstrap(rng, |weights| {
            let total = |of: fn(&(f64, f64)) -> f64| sums.iter().zip(weights).map(|(s, w)| w * of(s)).sum::<f64>();
            total(|sums| sums.0) / total(|sums| sums.1)
        })
    }
}

/// The cell or episode of a row, its true values, and what was predicted.
type Pair<'v> = (usize, &'v [f64], &'v [f64]);

/// The first of the largest.
fn largest(values: &[f64]) -> usize {
    values.iter().enumerate().fold((0, f64::NEG_INFINITY), |best, (at, &x)| if x > best.1 { (at, x) } else { best }).0
}
