//! Runs side by side: curves averaged over the runs of a group, and the table of final numbers.
//!
//! In: runs with their metrics. Out: for each metric and group the mean and Student's 95% interval at common positions; for each metric the
//! last values, the best marked, and those that cannot be told from it.

use std::collections::BTreeMap;

use crate::input::{Run, Series};
use crate::intervals::{Interval, student};

/// Positions along the x axis at which a group's runs are averaged.
const POSITIONS: usize = 200;

/// A metric of a group over training.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupCurve {
    /// The group.
    pub group: String,
    /// Positions, rising, within the range that all its runs reach.
    pub x: Vec<f64>,
    /// Mean over the runs and its interval (no ends for a single run).
    pub y: Vec<Interval>,
    /// How many runs.
    pub runs: usize,
}

/// The curves of one metric for runs that belong to groups (`[runs]`); groups that lack the metric are left out.
#[must_use]
pub fn group_curves(runs: &[Run], groups: &[String], metric: &str) -> Vec<GroupCurve> {
    let mut members: BTreeMap<&str, Vec<&Series>> = BTreeMap::new();
    for (run, group) in runs.iter().zip(groups) {
        if let Some(series) = run.series.get(metric).filter(|s| !s.is_empty()) {
            members.entry(group).or_default().push(series);
        }
    }
    members.into_iter().map(|(group, series)| average(group, &series)).collect()
}

fn average(group: &str, series: &[&Series]) -> GroupCurve {
    let x = if let [only] = series {
        only.iter().map(|p| p.0).collect()
    } else {
        // Runs are compared only where all of them are: the shortest ends the curve.
        let from = series.iter().filter_map(|s| s.first()).map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let to = series.iter().filter_map(|s| s.last()).map(|p| p.0).fold(f64::INFINITY, f64::min);
        let count = if to > from { series.iter().map(|s| s.len()).max().unwrap_or(1).clamp(2, POSITIONS) } else { 1 };
        (0..count).map(|i| from + (to - from).max(0.0) * i as f64 / (count - 1).max(1) as f64).collect::<Vec<f64>>()
    };
    let at = |x: f64| student(&series.iter().map(|s| value_at(s, x)).collect::<Vec<f64>>());
    GroupCurve { group: group.into(), y: x.iter().map(|&x| at(x)).collect(), x, runs: series.len() }
}

/// The series at `x`, linear between its points, constant beyond its ends.
fn value_at(series: &Series, x: f64) -> f64 {
    let next = series.partition_point(|p| p.0 < x);
    match (next.checked_sub(1).and_then(|i| series.get(i)), series.get(next)) {
        (_, Some(&(at, y))) if at == x => y,
        (Some(&(x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some(&(_, y)), None) | (None, Some(&(_, y))) => y,
        (None, None) => f64::NAN,
    }
}

/// The mean of each run's last tenth (at least one value) of a metric, `[runs]`; NaN where a run lacks it.
#[must_use]
pub fn final_values(runs: &[Run], metric: &str) -> Vec<f64> {
    let last = |series: &Series| {
        let count = (series.len() / 10).max(1);
        series[series.len() - count..].iter().map(|p| p.1).sum::<f64>() / count as f64
    };
    runs.iter().map(|run| run.series.get(metric).filter(|s| !s.is_empty()).map_or(f64::NAN, last)).collect()
}

/// For each of several means with intervals: is it the best, and does its interval overlap with the best's?
#[must_use]
pub fn mark_best(values: &[Option<Interval>], higher_is_better: bool) -> Vec<(bool, bool)> {
    let better = |a: f64, b: f64| if higher_is_better { a > b } else { a < b };
    let best = values.iter().flatten().filter(|v| v.estimate.is_finite()).fold(None, |best: Option<Interval>, v| match best {
        Some(b) if !better(v.estimate, b.estimate) => Some(b),
        _ => Some(*v),
    });
    let end = |v: f64, middle: f64| if v.is_finite() { v } else { middle };
    let overlap = |a: &Interval, b: &Interval| end(a.high, a.estimate) >= end(b.low, b.estimate) && end(b.high, b.estimate) >= end(a.low, a.estimate);
    let mark = |v: &Option<Interval>| match (v, best) {
        (Some(v), Some(b)) if v.estimate.is_finite() => (v.estimate == b.estimate, overlap(v, &b)),
        _ => (false, false),
    };
    values.iter().map(mark).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(points: &[(f64, f64)]) -> Run {
        Run {
            path: "r".into(),
            name: "r".into(),
            info: serde_json::Value::Null,
            clock: "update".into(),
            series: BTreeMap::from([("m".to_string(), points.to_vec())]),
            broken_lines: 0,
        }
    }

    #[test]
    fn a_group_is_averaged_where_all_its_runs_are() {
        let runs = [run(&[(0.0, 0.0), (10.0, 10.0), (20.0, 20.0)]), run(&[(5.0, 7.0), (15.0, 17.0)])];
        let groups = ["a".to_string(), "a".to_string()];
        let curves = group_curves(&runs, &groups, "m");
        assert_eq!((curves.len(), curves[0].runs), (1, 2));
        assert_eq!((curves[0].x[0], *curves[0].x.last().expect("x")), (5.0, 15.0));
        assert!(curves[0].y.iter().zip(&curves[0].x).all(|(y, x)| (y.estimate - (x + 1.0)).abs() < 1e-9));
        assert!(curves[0].y[0].low < curves[0].y[0].estimate);
        assert!(group_curves(&runs, &groups, "other").is_empty());
    }

    #[test]
    fn the_best_is_bold_and_what_overlaps_with_it_is_tied() {
        let v = |estimate: f64, half: f64| Some(Interval { estimate, low: estimate - half, high: estimate + half });
        let values = [v(930.0, 12.0), v(925.0, 21.0), v(360.0, 280.0), None];
        assert_eq!(mark_best(&values, true), [(true, true), (false, true), (false, false), (false, false)]);
        assert!(mark_best(&values, false)[2].0);
    }

    #[test]
    fn the_last_tenth_is_the_final_value() {
        let long: Vec<(f64, f64)> = (0..100).map(|i| (f64::from(i), f64::from(i))).collect();
        assert_eq!(final_values(&[run(&long), run(&[])], "m")[0], 94.5);
        assert!(final_values(&[run(&[])], "m")[0].is_nan());
    }
}
