//! A range with ticks of our own for Plotters, whose own are one, or none, where numbers are very small or very large.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

use crate::picture::number::Ticks;

/// Ranges of numbers beyond this are held to it, so that they have an extent.
const LARGEST: f64 = 1e300;
/// An extent smaller than this share of the numbers themselves is none.
const LEAST: f64 = 1e-9;
/// From one tick to the next, upwards: wished, and at least, points.
const UP: (f64, f64) = (22.0, 9.0);
/// From one tick to the next, across: wished, and between two labels at least, points.
const ACROSS: (f64, f64) = (30.0, 5.0);

/// A range with ticks.
#[derive(Clone)]
pub(in super::super) struct Ticked {
    range: RangedCoordf64,
    ticks: Vec<f64>,
}

impl Ticked {
    /// A range that is not empty.
    pub(super) fn new((lo, hi): (f64, f64), ticks: &Ticks) -> Self {
        Self { range: (lo..hi).into(), ticks: ticks.at.clone() }
    }
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.range.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.range()
    }
}

/// A range that can be drawn: an empty one, or one too narrow for its numbers to be told apart, is widened by their size, so that what lies in it is in the
/// middle and its number can be read.
pub(super) fn widened((lo, hi): (f64, f64)) -> (f64, f64) {
    if !lo.is_finite() || !hi.is_finite() {
        return (0.0, 1.0);
    }
    let (lo, hi) = (lo.clamp(-LARGEST, LARGEST), hi.clamp(-LARGEST, LARGEST));
    let largest = lo.abs().max(hi.abs());
    if hi - lo > LEAST * largest {
        return (lo, hi);
    }
    let (middle, half) = ((lo + hi) / 2.0, if largest > 0.0 { largest / 2.0 } else { 0.5 });
    (middle - half, middle + half)
}

/// Ticks of an upright axis.
pub(super) fn upwards(range: (f64, f64), height: f64) -> Ticks {
    Ticks::new(range, height, false, |_| UP)
}

/// Ticks of a level axis, fewer where their labels are wide.
pub(super) fn across(range: (f64, f64), width: f64) -> Ticks {
    Ticks::new(range, width, false, |ticks| {
        let least = ticks.width() + ACROSS.1;
        (least.max(ACROSS.0), least)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_has_at_least_three_ticks() {
        for (lo, hi) in [(-36.0, 936.0), (-0.02, 0.93), (3e-7, 9.1e-7), (0.0, 990.0)] {
            assert!(upwards((lo, hi), 90.0).at.len() >= 3, "{lo} to {hi}");
            assert!(across((lo, hi), 121.0).at.len() >= 3, "{lo} to {hi}");
        }
        assert!(upwards((1.0, 1499.0), 90.0).at.len() >= 3);
    }

    #[test]
    fn labels_along_x_do_not_touch() {
        for (lo, hi) in [(0.0, 1e-9), (100_000.0, 100_000.7), (-1e15, 1e15), (0.0, 1e12)] {
            let ticks = across((lo, hi), 120.0);
            let apart = ticks.at.windows(2).map(|pair| (pair[1] - pair[0]) / (hi - lo) * 120.0);
            assert!(apart.fold(f64::INFINITY, f64::min) > ticks.width() + 3.0, "{lo} to {hi}");
        }
    }

    #[test]
    fn every_range_can_be_drawn() {
        let ends = [0.0, 7.0, -1e-9, 1e12, f64::MAX, f64::MIN, f64::NAN, f64::INFINITY];
        for (lo, hi) in ends.into_iter().flat_map(|lo| ends.map(|hi| (lo, hi))) {
            let (from, to) = widened((lo, hi));
            assert!(to > from && (to - from).is_finite(), "{lo} to {hi}: {from} to {to}");
        }
        assert_eq!((widened((500.0, 500.0)), widened((0.0, 0.0))), ((250.0, 750.0), (-0.5, 0.5)));
        let (from, to) = widened((1e6, 1e6 + 1e-6));
        assert!(from < 1e6 && to > 1e6 + 1e-6, "rounding is no curve: {from} to {to}");
    }
}
