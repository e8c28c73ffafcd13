//! The curves as a figure and as a table of numbers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vibes_measure::intervals::Interval;

use super::groups::{self, GroupCurve, Shown};
use crate::curves::CurvePoint;
use crate::figures::{Curve, Curves, Facet, Heading};
use crate::input::Run;
use crate::metrics::Over;
use crate::output::{Column, write_table};

/// What the figure shows: intervals over runs only where some are.
pub(super) fn title(curves: &[Shown<'_>]) -> &'static str {
    let all = || curves.iter().flat_map(|shown| &shown.curves);
    if all().any(|curve| curve.over == Some(Over::Runs)) {
        "Training, mean and 95% interval over runs"
    } else if all().any(|curve| curve.runs > 1) {
        "Training, mean over runs"
    } else {
        "Training"
    }
}

/// What the bands of single runs are, where there are some.
fn foot(curves: &[Shown<'_>]) -> String {
    let of_curves = curves.iter().flat_map(|shown| &shown.curves).filter_map(|curve| curve.over);
    let own: BTreeSet<Over> = of_curves.filter(|over| *over != Over::Runs).collect();
    if own.is_empty() {
        return String::new();
    }
    let own: Vec<&str> = own.into_iter().map(Over::name).collect();
    format!("band of a single run: 95% interval over the {} of an evaluation", own.join(" or "))
}

/// The figure; a column of it is a task, if a page has room for all of them.
pub(super) fn figure(heading: Heading, runs: &[Run], names: &[String], curves: &[Shown<'_>]) -> Curves {
    let curve = |c: &GroupCurve| Curve {
        group: names.iter().position(|n| *n == c.group).unwrap_or(0),
        x: c.points.iter().map(|p| p.x).collect(),
        mean: c.points.iter().map(|p| p.y.estimate).collect(),
        band: c.points.iter().map(|p| band(&p.y)).collect(),
        runs: c.points.iter().map(|p| p.runs).collect(),
    };
    let facet = |shown: &Shown<'_>| Facet { metric: shown.title(), curves: shown.curves.iter().map(curve).collect() };
    let facets = curves.iter().map(facet).collect();
    let clock = runs.first().map_or("update", |r| r.clock.as_str()).replace("env_", "environment ").replace('_', " ");
    let axis = if clock.ends_with('s') { clock } else { clock + "s" };
    let (groups, columns) = (names.to_vec(), groups::columns(runs));
    Curves { heading, axis, groups, columns, facets, foot: foot(curves) }
}

/// The interval; none where only one run reaches, whose mean nothing says how sure it is of.
fn band(y: &Interval) -> Option<(f64, f64)> {
    (y.low.is_finite() && y.high.is_finite()).then_some((y.low, y.high))
}

/// Every curve, with what its intervals are over.
pub(super) fn listed(curves: &[Shown<'_>]) -> Vec<Value> {
    let of_shown = |shown: &Shown<'_>| -> Vec<Value> {
        let curve = |curve: &GroupCurve| {
            let over = curve.over.map(Over::name);
            json!({ "metric": shown.metric.name, "task": shown.task, "group": curve.group, "runs": curve.runs, "interval_over": over })
        };
        shown.curves.iter().map(curve).collect()
    };
    curves.iter().flat_map(of_shown).collect()
}

/// Writes `curves.arrow`, a row a place of a curve.
pub(super) fn write_curves(out: &Path, curves: &[Shown<'_>]) -> anyhow::Result<PathBuf> {
    let rows: Vec<(&Shown<'_>, &GroupCurve, &CurvePoint)> = curves
        .iter()
        .flat_map(|shown| shown.curves.iter().flat_map(move |c| c.points.iter().map(move |p| (shown, c, p))))
        .collect();
    let numbers = |of: fn(&CurvePoint) -> f64| Column::Float64(rows.iter().map(|r| of(r.2)).collect());
    let over = |row: &(&Shown<'_>, &GroupCurve, &CurvePoint)| {
        row.1.over.filter(|_| band(&row.2.y).is_some()).map_or("", Over::name).to_owned()
    };
    let table = [
        ("metric", Column::Text(rows.iter().map(|r| r.0.metric.name.clone()).collect())),
        ("task", Column::Text(rows.iter().map(|r| r.0.task.clone().unwrap_or_default()).collect())),
        ("group", Column::Text(rows.iter().map(|r| r.1.group.clone()).collect())),
        ("runs", Column::UInt32(rows.iter().map(|r| r.2.runs as u32).collect())),
        ("x", numbers(|p| p.x)),
        ("mean", numbers(|p| p.y.estimate)),
        ("low", numbers(|p| p.y.low)),
        ("high", numbers(|p| p.y.high)),
        ("interval_over", Column::Text(rows.iter().map(over).collect())),
    ];
    let path = out.join("curves.arrow");
    write_table(&path, &table, &[])?;
    Ok(path)
}
