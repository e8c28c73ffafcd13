//! `curves`: how training went, over any number of runs.

use std::collections::BTreeSet;
use std::path::PathBuf;

use anyhow::Context;
use serde_json::json;

use super::{Globals, Outcome, say, wrong};
use crate::figures::{Curve, Curves, Entry, Facet, Figure, Heading, Table};
use crate::input::Run;
use crate::learning::{GroupCurve, final_values, group_curves, mark_best};
use crate::output::{self, Column, write_table};

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
    let names: Vec<String> = groups.iter().cloned().collect::<BTreeSet<_>>().into_iter().collect();
    say(globals, format_args!("curves: {} runs in {} groups: {}", runs.len(), names.len(), names.join(", ")));
    let curves: Vec<(&(String, String, bool), Vec<GroupCurve>)> = metrics.iter().map(|m| (m, group_curves(&runs, &groups, &m.0))).collect();
    let out = options.output.clone().unwrap_or_else(|| options.runs[0].join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let heading = |title: &str| Heading::new(title).with_note(options.note.clone());
    let title = if names.len() < runs.len() { "Training, mean and 95% interval over runs" } else { "Training" };
    let mut files = Figure::Curves(figure(heading(title), &runs, &names, &curves)).save(&out, "curves")?;
    let table = table(heading("Where training ended: mean of the last tenth"), &runs, &groups, &names, &metrics);
    files.extend(Figure::Table(table.clone()).save(&out, "table")?);
    files.push(write_curves(&out, &curves)?);
    let document = output::document(&json!({ "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "curves", "runs": options.runs, "note": options.note }), &json!({ "groups": names, "table": numbers(&table) }))?;
    let path = out.join("curves.json");
    output::write_json(&path, &document)?;
    files.push(path);
    let broken: usize = runs.iter().map(|r| r.broken_lines).sum();
    let remarks = if broken > 0 { vec![format!("{broken} lines of metrics could not be read and were left out")] } else { Vec::new() };
    let line = format!("curves: {} metrics of {} runs{}", curves.len(), runs.len(), progress(&runs));
    Ok(Outcome { line, remarks, files, json: document })
}

/// How far the runs got.
fn progress(runs: &[Run]) -> String {
    let updates = runs.iter().filter_map(Run::updates).fold((f64::INFINITY, 0.0f64), |(a, b), u| (a.min(u), b.max(u)));
    if updates.0.is_finite() { format!(", {} to {} updates", updates.0, updates.1) } else { String::new() }
}

/// The metrics to show: name, title, whether higher is better.
fn metrics(options: &Options, runs: &[Run]) -> anyhow::Result<Vec<(String, String, bool)>> {
    let there: BTreeSet<&String> = runs.iter().flat_map(|r| r.series.keys()).collect();
    if let Some(missing) = options.metrics.iter().find(|m| !there.contains(m)) {
        let list: Vec<&str> = there.iter().map(|s| s.as_str()).collect();
        return Err(wrong(format!("no run has the metric {missing}, choose among {}", list.join(", "))));
    }
    let known = |name: &str| KNOWN.iter().find(|k| k.0 == name).map_or((name.to_string(), name.replace('_', " "), true), |k| (k.0.into(), k.1.into(), k.2));
    let mut chosen: Vec<_> = if options.metrics.is_empty() {
        KNOWN.iter().filter(|k| there.contains(&k.0.to_string())).map(|k| known(k.0)).collect()
    } else {
        options.metrics.iter().map(|m| known(m)).collect()
    };
    if chosen.is_empty() {
        chosen = there.iter().take(9).map(|m| known(m)).collect();
    }
    if chosen.is_empty() {
        return Err(anyhow::anyhow!("these runs have no metrics yet: {}", runs.iter().map(|r| r.path.display().to_string()).collect::<Vec<_>>().join(", ")));
    }
    Ok(chosen)
}

/// The group of each run.
fn groups(by: By, runs: &[Run]) -> Vec<String> {
    let objective = |r: &Run| r.objective().map_or_else(|| r.name.clone(), String::from);
    let distinct: BTreeSet<String> = runs.iter().map(objective).collect();
    if by == By::Objective || (by == By::Auto && distinct.len() < runs.len() && runs.iter().all(|r| r.objective().is_some())) {
        return runs.iter().map(objective).collect();
    }
    let same_name = |r: &Run| runs.iter().filter(|o| o.name == r.name).count() > 1;
    runs.iter().map(|r| if same_name(r) { r.path.display().to_string() } else { r.name.clone() }).collect()
}

fn figure(heading: Heading, runs: &[Run], names: &[String], curves: &[(&(String, String, bool), Vec<GroupCurve>)]) -> Curves {
    let curve = |c: &GroupCurve| Curve {
        group: names.iter().position(|n| *n == c.group).unwrap_or(0),
        x: c.x.clone(),
        mean: c.y.iter().map(|y| y.estimate).collect(),
        band: if c.runs > 1 { c.y.iter().map(|y| (y.low, y.high)).collect() } else { Vec::new() },
    };
    let facets = curves.iter().map(|(metric, curves)| Facet { metric: metric.1.clone(), curves: curves.iter().map(curve).collect() }).collect();
    let axis = runs.first().map_or("update", |r| r.clock.as_str()).replace('_', " ") + "s";
    Curves { heading, axis, groups: names.to_vec(), facets }
}

/// Rows are metrics, columns are groups: runs have many metrics and few groups.
fn table(heading: Heading, runs: &[Run], groups: &[String], names: &[String], metrics: &[(String, String, bool)]) -> Table {
    let row = |(name, title, higher): &(String, String, bool)| {
        let values = final_values(runs, name);
        let of_group = |group: &String| {
            let its: Vec<f64> = values.iter().zip(groups).filter(|(v, g)| *g == group && v.is_finite()).map(|(v, _)| *v).collect();
            (!its.is_empty()).then(|| crate::intervals::student(&its))
        };
        let intervals: Vec<_> = names.iter().map(of_group).collect();
        let marks = mark_best(&intervals, *higher);
        let compared = intervals.iter().flatten().count() > 1;
        let entry = |(i, (best, tied)): (&Option<crate::intervals::Interval>, &(bool, bool))| {
            i.map(|i| Entry { mean: i.estimate, half: Some(i.high - i.estimate).filter(|h| h.is_finite()), best: *best && compared, tied: *tied && compared })
        };
        (title.clone(), intervals.iter().zip(&marks).map(entry).collect())
    };
    Table {
        heading,
        corner: "metric".into(),
        columns: names.to_vec(),
        rows: metrics.iter().map(row).collect(),
        foot: "bold: best of its row; underlined: its 95% interval overlaps with the best's".into(),
    }
}

fn numbers(table: &Table) -> serde_json::Value {
    let entry = |e: &Option<Entry>| e.map(|e| json!({ "mean": e.mean, "half": e.half, "best": e.best, "tied": e.tied }));
    table.rows.iter().map(|(metric, entries)| json!({ "metric": metric, "values": entries.iter().map(entry).collect::<Vec<_>>() })).collect()
}

fn write_curves(out: &std::path::Path, curves: &[(&(String, String, bool), Vec<GroupCurve>)]) -> anyhow::Result<PathBuf> {
    let rows: Vec<(&str, &GroupCurve, usize)> =
        curves.iter().flat_map(|(m, curves)| curves.iter().flat_map(move |c| (0..c.x.len()).map(move |i| (m.0.as_str(), c, i)))).collect();
    let numbers = |of: &dyn Fn(&GroupCurve, usize) -> f64| Column::Float64(rows.iter().map(|&(_, c, i)| of(c, i)).collect());
    let table = [
        ("metric", Column::Text(rows.iter().map(|r| r.0.to_string()).collect())),
        ("group", Column::Text(rows.iter().map(|r| r.1.group.clone()).collect())),
        ("runs", Column::UInt32(rows.iter().map(|r| r.1.runs as u32).collect())),
        ("x", numbers(&|c, i| c.x[i])),
        ("mean", numbers(&|c, i| c.y[i].estimate)),
        ("low", numbers(&|c, i| c.y[i].low)),
        ("high", numbers(&|c, i| c.y[i].high)),
    ];
    let path = out.join("curves.arrow");
    write_table(&path, &table, &[])?;
    Ok(path)
}
