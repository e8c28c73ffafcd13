//! `curves`: how training went, over any number of runs.

mod drawn;
mod ended;
mod groups;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::{Value, json};

use super::{Globals, Outcome, distinct_places, gaps, say, wrong};
use crate::figures::{Figure, Heading, Table};
use crate::input::{Run, choices};
use crate::metrics::{DYNAMICS_GAP, Metric, TRAINING_VIDEOS_RETURN};
use crate::output;
use groups::{Groups, Shown};

/// Draw learning curves of runs, with 95% intervals over the runs of a group, and a table of where they ended.
///
/// A group of one run has the intervals of its own evaluations: over episodes, or over the trajectories of a grid.
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
    one_clock(&runs)?;
    let metrics = metrics(options, &runs)?;
    let groups = Groups::of(options.by, &runs);
    let names = &groups.names;
    say(globals, format_args!("curves: {} runs in {} groups: {}", runs.len(), names.len(), names.join(", ")));
    let curves = groups::shown(&runs, &groups, &metrics)?;
    let out = options.output.clone().unwrap_or_else(|| options.runs[0].join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let heading = |title: &str| Heading::new(title).with_note(options.note.clone());
    let tabled = match &options.table {
        Some(name) => Some(called(known(name, &runs)?, &runs)),
        None => metrics.iter().find(|m| m.name.contains("return")).cloned(),
    };
    let table = match &tabled {
        Some(metric) => ended::by_task(heading("Where training ended"), &runs, &groups, metric),
        None => ended::by_metric(heading("Where training ended"), &runs, &groups, &metrics),
    };
    let mut outcome = Outcome::default();
    outcome.files.push(drawn::write_curves(&out, &curves)?);
    let about = about(options, &runs, &out, &metrics, tabled.as_ref());
    let (listed, numbers) = (drawn::listed(&curves), ended::numbers(&table));
    let document = output::document(&about, &json!({ "groups": names, "curves": listed, "table": numbers }))?;
    let path = out.join("curves.json");
    output::write_json(&path, &document)?;
    outcome.files.push(path);
    outcome.json = document;
    outcome.remarks = remarks(&runs, &groups, &metrics, &curves);
    outcome.remarks.extend(without_gaps(options, &runs));
    outcome.remarks.extend(gap_notes(&runs, metrics.iter().chain(&tabled)));
    // Behind the numbers: figures of very many runs are too large to draw.
    if curves.is_empty() {
        outcome.leave_out(&out, "curves", "no metric has a curve");
    } else {
        let figure = drawn::figure(heading(drawn::title(&curves)), &runs, names, &curves);
        outcome.remarks.extend(figure.facts());
        outcome.save(&Figure::Curves(figure), &out, "curves")?;
    }
    save_table(&mut outcome, table, &out)?;
    outcome.line = format!("curves: {} metrics of {} runs{}", metrics.len(), runs.len(), progress(&runs));
    Ok(outcome)
}

/// That all runs count the same thing on the x axis.
fn one_clock(runs: &[Run]) -> anyhow::Result<()> {
    let clocks: BTreeSet<&str> = runs.iter().map(|run| run.clock.as_str()).collect();
    if clocks.len() > 1 {
        let clocks = clocks.into_iter().collect::<Vec<_>>().join(" and by ");
        return Err(wrong(format!("these runs go by {clocks}, which have no axis in common; draw them apart")));
    }
    Ok(())
}

/// Where the numbers come from.
fn about(options: &Options, runs: &[Run], out: &Path, metrics: &[Metric], tabled: Option<&Metric>) -> Value {
    json!({
        "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "curves",
        "runs": options.runs.iter().map(|run| vibes_data::relative_place(run, out)).collect::<Vec<_>>(),
        "protocols": runs.iter().map(Run::protocol).collect::<Vec<_>>(),
        "metrics": metrics.iter().map(|metric| &metric.name).collect::<Vec<_>>(),
        "by": clap::ValueEnum::to_possible_value(&options.by).map(|by| by.get_name().to_owned()),
        "table_metric": tabled.map(|metric| &metric.name), "note": options.note,
    })
}

/// Draws the table, on its side where it has many groups; one of very many is left out.
fn save_table(outcome: &mut Outcome, table: Table, out: &Path) -> anyhow::Result<()> {
    let table = ended::as_drawn(table);
    if let Some(fact) = super::table::too_long(table.rows.len()) {
        outcome.leave_out(out, "curves-table", &fact);
        return Ok(());
    }
    outcome.save(&Figure::Table(table), out, "curves-table")
}

/// What must be known of the runs and of their curves, a sentence each.
fn remarks(runs: &[Run], groups: &Groups, metrics: &[Metric], curves: &[Shown<'_>]) -> Vec<String> {
    let mut remarks: Vec<String> = runs.iter().flat_map(Run::remarks).collect();
    let (drawn, others): (Vec<&Metric>, Vec<&Metric>) =
        metrics.iter().partition(|metric| curves.iter().any(|shown| shown.metric.name == metric.name));
    for metric in others {
        remarks.push(format!("{} was measured at the end alone and has no curve; it stands in the table", metric.name));
    }
    remarks.extend(drawn.into_iter().flat_map(|metric| groups::lacking(runs, groups, metric)));
    let broken: usize = runs.iter().map(|r| r.broken_lines).sum();
    if broken > 0 {
        remarks.push(format!("{broken} lines of metrics could not be read and were left out"));
    }
    remarks
}

/// That there are no gaps to a bisimulation, which the metrics that nobody chose have among them.
fn without_gaps(options: &Options, runs: &[Run]) -> Option<String> {
    let has_none = options.metrics.is_empty() && runs.iter().all(|run| !run.series.contains_key(DYNAMICS_GAP));
    let text = "no held-out gaps to a bisimulation in these runs; `vibes-train evaluate RUN GRID` measures them";
    has_none.then(|| text.to_owned())
}

/// What must be said of the gaps to a bisimulation among the metrics that are drawn or tabled: the same as of a table of them.
fn gap_notes<'m>(runs: &[Run], metrics: impl Iterator<Item = &'m Metric>) -> Vec<String> {
    let named: Vec<(&str, &Run)> = runs.iter().map(|run| (run.name.as_str(), run)).collect();
    gaps::notes(&named, &metrics.map(|metric| metric.name.as_str()).collect::<Vec<_>>())
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
        // Where nobody sees a video, both sets are the same episodes: one panel says it all.
        let sees_videos = runs.iter().any(Run::sees_videos);
        let is_new = |name: &&str| there.contains(name) && (sees_videos || *name != TRAINING_VIDEOS_RETURN);
        chosen = Metric::known().filter(is_new).collect();
    }
    if chosen.is_empty() {
        chosen = there.into_iter().take(Metric::known().count()).collect();
    }
    if chosen.is_empty() {
        let paths: Vec<String> = runs.iter().map(|r| r.path.display().to_string()).collect();
        return Err(anyhow::anyhow!("these runs have no metrics yet: {}", paths.join(", ")));
    }
    Ok(chosen.into_iter().map(|name| called(name, runs)).collect())
}

/// A metric as figures of these runs call it.
fn called(name: &str, runs: &[Run]) -> Metric {
    let metric = Metric::named(name);
    if runs.iter().any(Run::sees_videos) { metric } else { metric.without_videos() }
}
