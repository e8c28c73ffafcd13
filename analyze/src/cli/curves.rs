//! `curves`: how training went, over any number of runs.

use std::collections::BTreeSet;
use std::path::PathBuf;

use anyhow::Context;
use serde_json::json;

use super::{Globals, Outcome, say, wrong};
use crate::curves::{CurvePoint, Mark, RunScore, mean_curve, score_table};
use crate::figures::{Curve, Curves, Entry, Facet, Figure, Heading, Table};
use crate::input::{Run, Series};
use crate::intervals::Interval;
use crate::output::{self, Column, write_table};

/// Most places along a mean curve.
const PLACES: usize = 200;

/// Metrics shown unless others are asked for, if the runs have them: name, title, whether higher is better.
const KNOWN: [(&str, &str, bool); 9] = [
    ("episode_return", "episode return", true),
    ("objective", "objective (nats a row)", true),
    ("dynamics_log_likelihood", "dynamics log-likelihood (nats)", true),
    ("adversary_log_likelihood", "adversary log-likelihood (nats)", true),
    ("gap", "gap: adversary − dynamics (nats)", false),
    ("reward_log_likelihood", "reward log-likelihood (nats)", true),
    ("clipped_share", "share of clipped terms", false),
    ("effective_rank", "effective rank of the latents", true),
    ("frames_per_second", "frames a second", true),
];

/// Learning curves over run folders, with 95% intervals over the runs of a group, and a table of where they ended.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Run folders (each with a metrics.jsonl).
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Metrics to show, in place of the known ones.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    metrics: Vec<String>,
    /// What makes a group: runs of one `objective` are averaged, or each `run` stands alone; `auto` averages when several runs share an objective.
    #[arg(long, value_enum, default_value_t = By::Auto)]
    by: By,
    /// Where the output goes [default: the folder `figures` in the first run].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seed (nothing here is random; taken so that all verbs have the same options).
    #[arg(long, default_value_t = 0, hide = true)]
    seed: u64,
    /// A line under the title of every figure.
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Auto,
    Objective,
    Run,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let runs = options.runs.iter().map(|path| Run::read(path)).collect::<Result<Vec<_>, _>>()?;
    let metrics = metrics(options, &runs)?;
    let groups = groups(options.by, &runs);
    let names: Vec<String> = groups.iter().fold(Vec::new(), |mut seen, g| {
        if !seen.contains(g) {
            seen.push(g.clone());
        }
        seen
    });
    say(globals, format_args!("curves: {} runs in {} groups: {}", runs.len(), names.len(), names.join(", ")));
    let curves = metrics
        .iter()
        .map(|m| Ok((m, group_curves(&runs, &groups, &names, &m.name)?)))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let out = options.output.clone().unwrap_or_else(|| options.runs[0].join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let heading = |title: &str| Heading::new(title).with_note(options.note.clone());
    let title = if names.len() < runs.len() { "Training, mean and 95% interval over runs" } else { "Training" };
    let mut files = Figure::Curves(figure(heading(title), &runs, &names, &curves)).save(&out, "curves")?;
    let table = table(heading("Where training ended"), &runs, &groups, &metrics);
    files.extend(Figure::Table(table.clone()).save(&out, "table")?);
    files.push(write_curves(&out, &curves)?);
    let document = output::document(
        &json!({ "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "curves", "runs": options.runs, "note": options.note }),
        &json!({ "groups": names, "table": numbers(&table) }),
    )?;
    let path = out.join("curves.json");
    output::write_json(&path, &document)?;
    files.push(path);
    let broken: usize = runs.iter().map(|r| r.broken_lines).sum();
    let remarks = if broken > 0 {
        vec![format!("{broken} lines of metrics could not be read and were left out")]
    } else {
        Vec::new()
    };
    let line = format!("curves: {} metrics of {} runs{}", curves.len(), runs.len(), progress(&runs));
    Ok(Outcome { line, remarks, files, json: document })
}

/// How far the runs got.
fn progress(runs: &[Run]) -> String {
    let updates = runs.iter().filter_map(Run::updates).fold((f64::INFINITY, 0.0f64), |(a, b), u| (a.min(u), b.max(u)));
    if updates.0.is_finite() { format!(", {} to {} updates", updates.0, updates.1) } else { String::new() }
}

/// A metric to show.
struct Metric {
    name: String,
    title: String,
    higher_is_better: bool,
}

impl Metric {
    fn named(name: &str) -> Self {
        let known = KNOWN.iter().find(|k| k.0 == name);
        known.map_or_else(
            || Self { name: name.into(), title: name.replace('_', " "), higher_is_better: true },
            |k| Self { name: k.0.into(), title: k.1.into(), higher_is_better: k.2 },
        )
    }
}

/// The metrics to show: those asked for, else the known ones that the runs have, else whatever they have.
fn metrics(options: &Options, runs: &[Run]) -> anyhow::Result<Vec<Metric>> {
    let there: BTreeSet<&str> = runs.iter().flat_map(|r| r.series.keys()).map(String::as_str).collect();
    if let Some(missing) = options.metrics.iter().find(|m| !there.contains(m.as_str())) {
        let list: Vec<&str> = there.into_iter().collect();
        return Err(wrong(format!("no run has the metric {missing}, choose among {}", list.join(", "))));
    }
    let mut chosen: Vec<&str> = options.metrics.iter().map(String::as_str).collect();
    if chosen.is_empty() {
        chosen = KNOWN.iter().map(|k| k.0).filter(|k| there.contains(k)).collect();
    }
    if chosen.is_empty() {
        chosen = there.into_iter().take(KNOWN.len()).collect();
    }
    if chosen.is_empty() {
        let paths: Vec<String> = runs.iter().map(|r| r.path.display().to_string()).collect();
        return Err(anyhow::anyhow!("these runs have no metrics yet: {}", paths.join(", ")));
    }
    Ok(chosen.into_iter().map(Metric::named).collect())
}

/// The group of each run.
fn groups(by: By, runs: &[Run]) -> Vec<String> {
    let objective = |r: &Run| r.objective().map_or_else(|| r.name.clone(), String::from);
    let distinct: BTreeSet<String> = runs.iter().map(objective).collect();
    if by == By::Objective
        || (by == By::Auto && distinct.len() < runs.len() && runs.iter().all(|r| r.objective().is_some()))
    {
        return runs.iter().map(objective).collect();
    }
    let same_name = |r: &Run| runs.iter().filter(|o| o.name == r.name).count() > 1;
    runs.iter().map(|r| if same_name(r) { r.path.display().to_string() } else { r.name.clone() }).collect()
}

/// A metric of a group over training.
struct GroupCurve {
    group: String,
    points: Vec<CurvePoint>,
    runs: usize,
}

/// The curves of one metric, group by group; groups that lack it are left out. A run alone keeps its own points.
fn group_curves(runs: &[Run], groups: &[String], names: &[String], metric: &str) -> anyhow::Result<Vec<GroupCurve>> {
    let mut curves = Vec::new();
    for group in names {
        let members = runs.iter().zip(groups).filter(|(_, g)| *g == group).filter_map(|(r, _)| r.series.get(metric));
        let members: Vec<Series> = members.filter(|s| s.iter().any(|p| p.1.is_finite())).cloned().collect();
        if !members.is_empty() {
            let places = members.iter().map(Vec::len).max().unwrap_or(2).clamp(2, PLACES);
            curves.push(GroupCurve {
                group: group.clone(),
                points: mean_curve(&members, places)?,
                runs: members.len(),
            });
        }
    }
    Ok(curves)
}

fn figure(heading: Heading, runs: &[Run], names: &[String], curves: &[(&Metric, Vec<GroupCurve>)]) -> Curves {
    let curve = |c: &GroupCurve| Curve {
        group: names.iter().position(|n| *n == c.group).unwrap_or(0),
        x: c.points.iter().map(|p| p.x).collect(),
        mean: c.points.iter().map(|p| p.y.estimate).collect(),
        band: if c.runs > 1 { c.points.iter().map(|p| band(&p.y)).collect() } else { Vec::new() },
    };
    let facets = curves
        .iter()
        .map(|(metric, curves)| Facet { metric: metric.title.clone(), curves: curves.iter().map(curve).collect() })
        .collect();
    let axis = runs.first().map_or("update", |r| r.clock.as_str()).replace('_', " ") + "s";
    Curves { heading, axis, groups: names.to_vec(), facets }
}

/// The interval, closed where only one run reaches.
fn band(y: &Interval) -> (f64, f64) {
    let end = |v: f64| if v.is_finite() { v } else { y.estimate };
    (end(y.low), end(y.high))
}

/// The mean of a run's last tenth of a metric, at least one value.
fn final_value(series: &Series) -> f64 {
    let count = (series.len() / 10).max(1);
    series[series.len() - count..].iter().map(|p| p.1).sum::<f64>() / count as f64
}

/// Where training ended. With returns: groups x tasks, the form of the paper's Table 1. Without: metrics x groups.
fn table(heading: Heading, runs: &[Run], groups: &[String], metrics: &[Metric]) -> Table {
    let returns = metrics.iter().find(|m| m.name.contains("return"));
    let scores = |metric: &Metric,
                  method: &dyn Fn(usize) -> String,
                  task: &dyn Fn(usize) -> String,
                  sign: f64|
     -> Vec<RunScore> {
        let score = |i: usize| {
            let series = runs[i].series.get(&metric.name).filter(|s| !s.is_empty())?;
            Some(RunScore { method: method(i), task: task(i), score: sign * final_value(series) })
        };
        (0..runs.len()).filter_map(score).collect()
    };
    let entry = |e: &crate::curves::Entry, sign: f64, compared: bool| Entry {
        mean: sign * e.score.estimate,
        half: Some(e.score.high - e.score.estimate).filter(|h| h.is_finite()),
        best: compared && e.mark == Mark::Best,
        tied: compared && e.mark == Mark::Tied,
    };
    if let Some(metric) = returns {
        let of = |i: usize| runs[i].task().unwrap_or("all runs").to_string();
        let made = score_table(&scores(metric, &|i| groups[i].clone(), &of, 1.0));
        let compared = made.methods.len() > 1;
        let rows = made
            .methods
            .iter()
            .zip(&made.entries)
            .map(|(m, row)| (m.clone(), row.iter().map(|e| e.as_ref().map(|e| entry(e, 1.0, compared))).collect()));
        return Table { heading, corner: metric.title.clone(), columns: made.tasks.clone(), rows: rows.collect(), foot: "mean of the last tenth; bold: best of its column, underlined: its 95% interval overlaps with the best's".into() };
    }
    let mut columns: Vec<String> = Vec::new();
    groups.iter().for_each(|g| {
        if !columns.contains(g) {
            columns.push(g.clone());
        }
    });
    let row = |metric: &Metric| {
        let sign = if metric.higher_is_better { 1.0 } else { -1.0 };
        let made = score_table(&scores(metric, &|i| groups[i].clone(), &|_| metric.name.clone(), sign));
        let of = |g: &String| {
            made.methods
                .iter()
                .position(|m| m == g)
                .and_then(|at| made.entries[at][0].as_ref())
                .map(|e| entry(e, sign, made.methods.len() > 1))
        };
        (metric.title.clone(), columns.iter().map(of).collect())
    };
    let rows = metrics.iter().map(row).collect();
    let foot = if columns.len() > 1 {
        "mean of the last tenth; bold: best of its row, underlined: its 95% interval overlaps with the best's"
    } else {
        "mean of the last tenth"
    };
    Table { heading, corner: "metric".into(), columns: columns.clone(), rows, foot: foot.into() }
}

fn numbers(table: &Table) -> serde_json::Value {
    let entry =
        |e: &Option<Entry>| e.map(|e| json!({ "mean": e.mean, "half": e.half, "best": e.best, "tied": e.tied }));
    table
        .rows
        .iter()
        .map(|(metric, entries)| json!({ "metric": metric, "values": entries.iter().map(entry).collect::<Vec<_>>() }))
        .collect()
}

fn write_curves(out: &std::path::Path, curves: &[(&Metric, Vec<GroupCurve>)]) -> anyhow::Result<PathBuf> {
    let rows: Vec<(&str, &GroupCurve, &CurvePoint)> = curves
        .iter()
        .flat_map(|(m, curves)| curves.iter().flat_map(move |c| c.points.iter().map(move |p| (m.name.as_str(), c, p))))
        .collect();
    let numbers = |of: fn(&CurvePoint) -> f64| Column::Float64(rows.iter().map(|r| of(r.2)).collect());
    let table = [
        ("metric", Column::Text(rows.iter().map(|r| r.0.to_string()).collect())),
        ("group", Column::Text(rows.iter().map(|r| r.1.group.clone()).collect())),
        ("runs", Column::UInt32(rows.iter().map(|r| r.2.runs as u32).collect())),
        ("x", numbers(|p| p.x)),
        ("mean", numbers(|p| p.y.estimate)),
        ("low", numbers(|p| p.y.low)),
        ("high", numbers(|p| p.y.high)),
    ];
    let path = out.join("curves.arrow");
    write_table(&path, &table, &[])?;
    Ok(path)
}
