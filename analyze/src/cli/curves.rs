//! `curves`: how training went, over any number of runs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::json;

use super::{Globals, Outcome, distinct_places, say, wrong};
use crate::curves::{CurvePoint, mean_curve};
use crate::figures::{Curve, Curves, Entry, Facet, Figure, Heading, Table};
use crate::input::{Run, Series, choices};
use crate::metrics::{DYNAMICS_GAP, Metric};
use crate::output::{self, Column, write_table};
use crate::scores::{self, Mark, RunScore, score_table};
use vibes_measure::intervals::Interval;

/// Most places along a mean curve.
const PLACES: usize = 200;

/// Draw learning curves of runs, with 95% intervals over the runs of a group, and a table of where they ended.
///
/// Beside the metrics of training stand those of a held-out grid: retrieval, variance shares, and the gaps to a bisimulation in nats
/// (`vibes-train offline --eval GRID` while training, `vibes-train evaluate RUN GRID` afterwards).
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Run folders (each with a metrics.jsonl).
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Metrics to show, in place of the known ones; a number of a held-out grid as `vibes-train evaluate` calls it, as in `retrieval_same_step@1`.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    metrics: Vec<String>,
    /// The metric of the table of groups × tasks [default: the return; without returns, a table of metrics × groups].
    #[arg(long, value_name = "NAME")]
    table: Option<String>,
    /// What makes a group: runs of one `objective` are averaged, or each `run` stands alone; `auto` averages when several runs share an objective.
    #[arg(long, value_enum, default_value_t = By::Auto)]
    by: By,
    /// Where the output goes [default: the folder `figures` in the first run].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// A line under the title of every figure.
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(runs: Vec<PathBuf>, output: &Path, note: Option<&str>) -> Self {
        let (output, note) = (Some(output.to_path_buf()), note.map(String::from));
        Self { runs, metrics: Vec::new(), table: None, by: By::Auto, output, note }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Auto,
    Objective,
    Run,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    distinct_places(&options.runs)?;
    let runs = options.runs.iter().map(|path| Run::read(path)).collect::<Result<Vec<_>, _>>()?;
    let clocks: BTreeSet<&str> = runs.iter().map(|run| run.clock.as_str()).collect();
    if clocks.len() > 1 {
        let clocks = clocks.into_iter().collect::<Vec<_>>().join(" and by ");
        return Err(wrong(format!("these runs go by {clocks}, which have no axis in common; draw them apart")));
    }
    let metrics = metrics(options, &runs)?;
    let groups = groups(options.by, &runs);
    let names: Vec<String> = groups.iter().fold(Vec::new(), |mut seen, g| {
        if !seen.contains(g) {
            seen.push(g.clone());
        }
        seen
    });
    say(globals, format_args!("curves: {} runs in {} groups: {}", runs.len(), names.len(), names.join(", ")));
    let mut curves = Vec::new();
    for metric in &metrics {
        for task in tasks(&runs) {
            let of_groups = group_curves(&runs, &groups, &names, &metric.name, task.as_deref())?;
            if !of_groups.is_empty() {
                curves.push(Shown { metric, task, curves: of_groups });
            }
        }
    }
    let out = options.output.clone().unwrap_or_else(|| options.runs[0].join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let heading = |title: &str| Heading::new(title).with_note(options.note.clone());
    let is_of_several = curves.iter().any(|shown| shown.curves.iter().any(|curve| curve.runs > 1));
    let title = if is_of_several { "Training, mean and 95% interval over runs" } else { "Training" };
    let tabled = match &options.table {
        Some(name) => Some(Metric::named(known(name, &runs)?)),
        None => metrics.iter().find(|m| m.name.contains("return")).map(|m| Metric::named(&m.name)),
    };
    let table = match &tabled {
        Some(metric) => by_task(heading("Where training ended"), &runs, &groups, metric),
        None => by_metric(heading("Where training ended"), &runs, &groups, &metrics),
    };
    let mut outcome = Outcome::default();
    outcome.files.push(write_curves(&out, &curves)?);
    let document = output::document(
        &json!({
            "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "curves",
            "runs": options.runs.iter().map(|run| vibes_data::relative_place(run, &out)).collect::<Vec<_>>(),
            "protocols": runs.iter().map(Run::protocol).collect::<Vec<_>>(),
            "metrics": metrics.iter().map(|metric| &metric.name).collect::<Vec<_>>(),
            "by": clap::ValueEnum::to_possible_value(&options.by).map(|by| by.get_name().to_owned()), "table_metric": tabled.as_ref().map(|metric| &metric.name),
            "note": options.note,
        }),
        &json!({ "groups": names, "table": numbers(&table) }),
    )?;
    let path = out.join("curves.json");
    output::write_json(&path, &document)?;
    outcome.files.push(path);
    outcome.json = document;
    outcome.remarks = remarks(&runs, &metrics, &curves);
    // Behind the numbers: figures of very many runs are too large to draw.
    if curves.is_empty() {
        outcome.leave_out(&out, "curves", "no metric has a curve");
    } else {
        outcome.save(&Figure::Curves(figure(heading(title), &runs, &names, &curves)), &out, "curves")?;
    }
    outcome.save(&Figure::Table(table), &out, "curves-table")?;
    outcome.line = format!("curves: {} metrics of {} runs{}", metrics.len(), runs.len(), progress(&runs));
    Ok(outcome)
}

/// What must be known of the runs and of their curves, a sentence each.
fn remarks(runs: &[Run], metrics: &[Metric], curves: &[Shown<'_>]) -> Vec<String> {
    let mut remarks: Vec<String> = runs.iter().flat_map(Run::remarks).collect();
    for metric in metrics.iter().filter(|metric| !curves.iter().any(|shown| shown.metric.name == metric.name)) {
        remarks.push(format!("{} was measured at the end alone and has no curve; it stands in the table", metric.name));
    }
    let broken: usize = runs.iter().map(|r| r.broken_lines).sum();
    if broken > 0 {
        remarks.push(format!("{broken} lines of metrics could not be read and were left out"));
    }
    if runs.iter().all(|r| !r.series.contains_key(DYNAMICS_GAP)) {
        remarks.push(
            "no held-out gaps to a bisimulation in these runs; `vibes-train evaluate RUN GRID` measures them".into(),
        );
    }
    remarks
}

/// How far the runs got.
fn progress(runs: &[Run]) -> String {
    let updates = runs.iter().filter_map(Run::updates).fold((f64::INFINITY, 0.0f64), |(a, b), u| (a.min(u), b.max(u)));
    if updates.0.is_finite() { format!(", {} to {} updates", updates.0, updates.1) } else { String::new() }
}

/// The metric's name in full, if a run has it.
fn known<'r>(name: &str, runs: &'r [Run]) -> anyhow::Result<&'r str> {
    if let Some(full) = runs.iter().find_map(|run| run.full_name(name)) {
        return Ok(full);
    }
    let there = choices(name, runs.iter().flat_map(Run::names));
    Err(wrong(format!("no run has the metric {name}, choose among {there}")))
}

/// The metrics to show: those asked for, else the known ones that the runs have, else whatever they have.
fn metrics(options: &Options, runs: &[Run]) -> anyhow::Result<Vec<Metric>> {
    let there: BTreeSet<&str> = runs.iter().flat_map(|r| r.series.keys()).map(String::as_str).collect();
    let mut chosen: Vec<&str> = options.metrics.iter().map(|name| known(name, runs)).collect::<anyhow::Result<_>>()?;
    // Two names may be of one metric.
    let mut seen = BTreeSet::new();
    chosen.retain(|name| seen.insert(*name));
    if chosen.is_empty() {
        chosen = Metric::known().filter(|name| there.contains(name)).collect();
    }
    if chosen.is_empty() {
        chosen = there.into_iter().take(Metric::known().count()).collect();
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

/// What one facet shows: a metric, of one task if the runs are of several.
struct Shown<'m> {
    metric: &'m Metric,
    task: Option<String>,
    curves: Vec<GroupCurve>,
}

impl Shown<'_> {
    fn title(&self) -> String {
        self.task.as_ref().map_or_else(|| self.metric.title.clone(), |task| format!("{task}: {}", self.metric.title))
    }
}

/// The runs' tasks, whose curves are not averaged; none to tell apart if they are all of one.
fn tasks(runs: &[Run]) -> Vec<Option<String>> {
    let tasks: BTreeSet<&str> = runs.iter().map(|r| r.task().unwrap_or("no task named")).collect();
    if tasks.len() < 2 { vec![None] } else { tasks.into_iter().map(|task| Some(task.to_string())).collect() }
}

/// A metric of a group over training.
struct GroupCurve {
    group: String,
    points: Vec<CurvePoint>,
    runs: usize,
}

/// The curves of one metric, group by group; groups that lack it are left out. A run alone keeps its own points.
fn group_curves(
    runs: &[Run],
    groups: &[String],
    names: &[String],
    metric: &str,
    task: Option<&str>,
) -> anyhow::Result<Vec<GroupCurve>> {
    let mut curves = Vec::new();
    let of_task = |run: &Run| task.is_none_or(|task| run.task().unwrap_or("no task named") == task);
    for group in names {
        let members = runs
            .iter()
            .zip(groups)
            .filter(|(r, g)| *g == group && of_task(r))
            .filter_map(|(r, _)| r.series.get(metric));
        let members: Vec<Series> = members.filter(|s| s.iter().any(|p| p.1.is_finite())).cloned().collect();
        if !members.is_empty() {
            let points: usize = members.iter().map(Vec::len).sum();
            let longest = members.iter().map(Vec::len).max().unwrap_or(2).clamp(2, PLACES);
            let places = if points <= PLACES { PLACES } else { longest };
            curves.push(GroupCurve {
                group: group.clone(),
                points: mean_curve(&members, places)?,
                runs: members.len(),
            });
        }
    }
    Ok(curves)
}

fn figure(heading: Heading, runs: &[Run], names: &[String], curves: &[Shown<'_>]) -> Curves {
    let curve = |c: &GroupCurve| Curve {
        group: names.iter().position(|n| *n == c.group).unwrap_or(0),
        x: c.points.iter().map(|p| p.x).collect(),
        mean: c.points.iter().map(|p| p.y.estimate).collect(),
        band: if c.runs > 1 { c.points.iter().map(|p| band(&p.y)).collect() } else { Vec::new() },
    };
    let facets = curves
        .iter()
        .map(|shown| Facet { metric: shown.title(), curves: shown.curves.iter().map(curve).collect() })
        .collect();
    let clock = runs.first().map_or("update", |r| r.clock.as_str()).replace("env_", "environment ").replace('_', " ");
    let axis = if clock.ends_with('s') { clock } else { clock + "s" };
    Curves { heading, axis, groups: names.to_vec(), facets }
}

/// The interval; none where only one run reaches, whose mean nothing says how sure it is of.
fn band(y: &Interval) -> Option<(f64, f64)> {
    (y.low.is_finite() && y.high.is_finite()).then_some((y.low, y.high))
}

/// The final values of a metric, one a run that has it.
fn scores(
    runs: &[Run],
    metric: &Metric,
    method: impl Fn(usize) -> String,
    task: impl Fn(usize) -> String,
) -> Vec<RunScore> {
    let score = |i: usize| {
        let score = runs[i].final_value(&metric.name)?;
        Some(RunScore { method: method(i), task: task(i), score, higher_is_better: metric.higher_is_better })
    };
    (0..runs.len()).filter_map(score).collect()
}

/// An entry as it is drawn.
fn drawn(e: &scores::Entry) -> Entry {
    Entry {
        mean: e.score.estimate,
        half: Some(e.score.high - e.score.estimate).filter(|h| h.is_finite()),
        best: e.mark == Mark::Best,
        tied: e.mark == Mark::Tied,
    }
}

/// What stands under a table.
fn foot(compared: bool, line: &str) -> String {
    let marks = if compared {
        format!("; bold: best of its {line}, underlined: its 95% interval overlaps with the best's")
    } else {
        String::new()
    };
    format!("vibes-train evaluate, else last evaluation, else mean of the last tenth{marks}")
}

/// Where training ended: groups x tasks, the form of the paper's Table 1, with the mean over tasks where there are several.
fn by_task(heading: Heading, runs: &[Run], groups: &[String], metric: &Metric) -> Table {
    let task = |i: usize| runs[i].task().unwrap_or("all runs").to_string();
    let made = score_table(&scores(runs, metric, |i| groups[i].clone(), task));
    let compared = made.methods.len() > 1;
    let mut columns = made.tasks.clone();
    let row = |entries: &Vec<Option<scores::Entry>>| -> Vec<Option<Entry>> {
        entries.iter().map(|e| e.as_ref().map(drawn)).collect()
    };
    let mut rows: Vec<(String, Vec<Option<Entry>>)> =
        made.methods.iter().cloned().zip(made.entries.iter().map(row)).collect();
    if made.tasks.len() > 1 {
        columns.push("average".into());
        let best = made.best_average();
        for (i, ((_, row), average)) in rows.iter_mut().zip(&made.averages).enumerate() {
            row.push(average.map(|mean| Entry { mean, half: None, best: best == Some(i), tied: false }));
        }
    }
    Table { heading, corner: metric.title.clone(), columns, rows, foot: foot(compared, "column") }
}

/// Where training ended: metrics x groups.
fn by_metric(heading: Heading, runs: &[Run], groups: &[String], metrics: &[Metric]) -> Table {
    let columns = groups.iter().fold(Vec::new(), |mut seen: Vec<String>, group| {
        if !seen.contains(group) {
            seen.push(group.clone());
        }
        seen
    });
    let row = |metric: &Metric| {
        let made = score_table(&scores(runs, metric, |i| groups[i].clone(), |_| metric.name.clone()));
        let of = |group: &String| {
            let at = made.methods.iter().position(|method| method == group)?;
            made.entries[at][0].as_ref().map(drawn)
        };
        (metric.title.clone(), columns.iter().map(of).collect())
    };
    let rows = metrics.iter().map(row).collect();
    let foot = foot(columns.len() > 1, "row");
    Table { heading, corner: "metric".into(), columns, rows, foot }
}

fn numbers(table: &Table) -> serde_json::Value {
    let entry =
        |e: &Option<Entry>| e.map(|e| json!({ "mean": e.mean, "half": e.half, "best": e.best, "tied": e.tied }));
    table
        .rows
        .iter()
        .map(|(name, entries)| json!({ "row": name, "columns": table.columns, "values": entries.iter().map(entry).collect::<Vec<_>>() }))
        .collect()
}

fn write_curves(out: &Path, curves: &[Shown<'_>]) -> anyhow::Result<PathBuf> {
    let rows: Vec<(&Shown<'_>, &GroupCurve, &CurvePoint)> = curves
        .iter()
        .flat_map(|shown| shown.curves.iter().flat_map(move |c| c.points.iter().map(move |p| (shown, c, p))))
        .collect();
    let numbers = |of: fn(&CurvePoint) -> f64| Column::Float64(rows.iter().map(|r| of(r.2)).collect());
    let table = [
        ("metric", Column::Text(rows.iter().map(|r| r.0.metric.name.clone()).collect())),
        ("task", Column::Text(rows.iter().map(|r| r.0.task.clone().unwrap_or_default()).collect())),
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
