//! How good predictions are: R² of numbers, accuracy of classes, with an interval over held-out groups.

use rand::Rng;

use super::quantity::Targets;
use crate::intervals::{Interval, bootstrap};

/// The score of one quantity's predictions `[rows, columns]` for `rows` of the table.
pub(super) fn score(
    targets: &Targets,
    quantity: usize,
    predicted: &[f64],
    rows: &[usize],
    groups: &[u32],
    count: usize,
    rng: &mut impl Rng,
) -> Interval {
    let span = targets.spans[quantity];
    let mut sums = vec![Sums::default(); count];
    for (&row, predicted) in rows.iter().zip(predicted.chunks_exact(targets.columns)) {
        let true_values = &targets.row(row)[span.first..span.first + span.columns];
        let predicted = &predicted[span.first..span.first + span.columns];
        let sums = &mut sums[groups[row] as usize];
        sums.rows += 1.0;
        if span.classes {
            sums.hits += f64::from(u8::from(largest(predicted) == largest(true_values)));
        } else {
            sums.add(true_values[0], predicted[0]);
        }
    }
    bootstrap(count, rng, |counts| {
        let total =
            |part: fn(&Sums) -> f64| sums.iter().zip(counts).map(|(sums, count)| count * part(sums)).sum::<f64>();
        let rows = total(|sums| sums.rows);
        if span.classes {
            return total(|sums| sums.hits) / rows;
        }
        let sum = total(|sums| sums.sum);
        1.0 - total(|sums| sums.error) / (total(|sums| sums.squares) - sum * sum / rows)
    })
}

/// What a group contributes.
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
