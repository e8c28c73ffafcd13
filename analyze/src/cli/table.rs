//! `table`: numbers of many runs in the form of the paper's Table 1.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::json;

use super::{Globals, Outcome, distinct_places, gaps, wrong};
use crate::figures::{Entry, Figure, Heading, Table};
use crate::input::{Cell, Results, Rows, RowsError, Run, choices};
use crate::metrics::{HELD_OUT_RETURN, Metric, RETURN_GAP, RETURNS, TRAINING_VIDEOS_RETURN};
use crate::output::{self, Column, write_csv, write_parquet};
use crate::scores::{self, Mark, RunScore, ScoreTable, Style, score_table};

/// Write a table over runs: mean and 95% interval of any metric, by any keys.
///
/// The best of each column is bold, and those whose interval overlaps with its are underlined, where there are several runs of one kind. A run's metric is that of `vibes-train evaluate` of the newest checkpoint that it judged, else of its last evaluation, else the mean of its last tenth. Keys are what run.json holds (`objective`, `task`, `seed`: what the run was
/// asked to do, or in full, as in `model.reward_scale`, what came of it) and `run`, the folder's name; of a table of results they are its columns. Written as Markdown, LaTeX, CSV, Parquet and as a figure.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Run folders, or tables of results (CSV, Parquet, Arrow) with a row a run.
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Metrics; a number of a held-out grid as `vibes-train evaluate` calls it, as in `probe/reward/hs` [default: the return if the runs have one, else those known by name].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    metrics: Vec<String>,
    /// What a row of the table is: runs that agree in all of these keys are averaged [default: the objective, else each run].
    #[arg(long, value_name = "KEY,…", value_delimiter = ',')]
    by: Vec<String>,
    /// What a column is, beside the metric [default: the task where the runs are of several].
    #[arg(long, value_name = "KEY")]
    columns: Option<String>,
    /// Which runs, as in "seed < 3 and task != 'reacher-easy'".
    #[arg(long = "where", value_name = "EXPRESSION")]
    rows: Option<String>,
    /// Metrics of which a lower number is better, beside those known to be.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    lower: Vec<String>,
    /// Where the output goes [default: the folder `figures` in the first run, or beside the first table].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// A line under the title of the figure.
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

/// Most rows of a figure, so that it can be drawn at all.
const DRAWN: usize = 200;

/// Why a table of so many rows has no figure, if it has none.
pub(super) fn too_long(rows: usize) -> Option<String> {
    (rows > DRAWN).then(|| format!("it would have {rows} rows, and at most {DRAWN} are drawn"))
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let rows = options.rows.as_deref().map(str::parse).transpose().map_err(|e: RowsError| wrong(e.to_string()))?;
    distinct_places(&options.runs)?;
    let results = Results::open(&options.runs)?;
    let metrics = metrics(options, &results, rows.as_ref())?;
    let by = if options.by.is_empty() { vec![usual_key(&results)] } else { options.by.clone() };
    let Read { scores, across, rows, without } = scores(options, &results, rows.as_ref(), &metrics, &by)?;
    let table = score_table(&scores);
    let corner = by.join(", ");
    let averages = across.is_some() && metrics.len() == 1;
    let terminal = !globals.json && std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let text = table.text(&corner, averages, Style::Terminal { ansi: terminal });
    let out = options.output.clone().unwrap_or_else(|| beside(&options.runs[0]));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let mut outcome = Outcome { files: write(&out, &table, &corner, averages)?, ..Outcome::default() };
    let heading = Heading::new(title(&metrics, &table)).with_note(options.note.clone());
    let of =
        if results.are_runs() { "vibes-train evaluate, else last evaluation, else mean of the last tenth" } else { "" };
    let document = output::document(
        &json!({
            "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "table", "by": by, "where": options.rows,
            "metrics": metrics.iter().map(|metric| &metric.name).collect::<Vec<_>>(), "columns": options.columns, "lower": options.lower,
            "runs": options.runs.iter().map(|run| vibes_data::relative_place(run, &out)).collect::<Vec<_>>(),
            "protocols": results.protocols(), "note": options.note,
        }),
        &table,
    )?;
    let path = out.join("table.json");
    output::write_json(&path, &document)?;
    outcome.files.push(path);
    outcome.json = document;
    outcome.remarks = results.remarks();
    let names: Vec<&str> = metrics.iter().map(|metric| metric.name.as_str()).collect();
    let named: Vec<(&str, &Run)> = results.runs().map(|run| (run.name.as_str(), run)).collect();
    outcome.remarks.extend(gaps::notes(&named, &names));
    if !without.is_empty() {
        let lack: Vec<String> = without.iter().map(|(method, count)| format!("{count} of {method}")).collect();
        outcome.remarks.push(format!(
            "{} of {rows} runs have no such number and are left out: {}",
            without.values().sum::<usize>(),
            lack.join(", ")
        ));
    }
    if let Some(fact) = too_long(table.methods.len()) {
        outcome.leave_out(&out, "table", &fact);
    } else {
        outcome.save(&Figure::Table(figure(heading, &table, &corner, averages, of)), &out, "table")?;
    }
    let body: Vec<String> = text.lines().map(|line| format!("  {line}")).collect();
    outcome.line = format!(
        "table: {} of {rows} {} by {corner}{}\n{}",
        names.join(", "),
        if rows == 1 { "run" } else { "runs" },
        if table.has_marks(averages) { marks(terminal) } else { "" },
        body.join("\n")
    );
    Ok(outcome)
}

/// What the marks of a table of text mean.
fn marks(terminal: bool) -> &'static str {
    if terminal {
        " (bold: best; underlined: its 95% interval overlaps with the best's)"
    } else {
        " (*: best; ~: its 95% interval overlaps with the best's)"
    }
}

/// What the figure shows: intervals over runs only where an entry is of several.
fn title(metrics: &[Metric], table: &ScoreTable) -> String {
    match (metrics, table.has_intervals()) {
        ([only], true) => format!("{}, mean and 95% interval over runs", only.title),
        ([only], false) => only.title.clone(),
        (_, true) => "Mean and 95% interval over runs".into(),
        (_, false) => "Numbers of single runs".into(),
    }
}

/// The metrics asked for, or those that the results have.
fn metrics(options: &Options, results: &Results, rows: Option<&Rows>) -> anyhow::Result<Vec<Metric>> {
    let names = results.names();
    let returns = || RETURNS.into_iter().find(|name| names.contains(*name)).map(String::from);
    let mut seen = BTreeSet::new();
    let chosen: Vec<String> = match &options.metrics {
        // Named twice, each run would count twice in the metric's column.
        asked if !asked.is_empty() => asked.iter().filter(|name| seen.insert(name.as_str())).cloned().collect(),
        _ => match returns() {
            Some(name) => vec![name],
            None => Metric::known().filter(|name| names.contains(*name)).map(String::from).collect(),
        },
    };
    if chosen.is_empty() {
        let list = choices("", names.iter().map(String::as_str));
        return Err(wrong(format!("none of the metrics known by name is there; name one with --metrics: {list}")));
    }
    if let Some(idle) = options.lower.iter().find(|name| !chosen.contains(name)) {
        return Err(wrong(format!("--lower {idle} has no effect: the table is of {}", chosen.join(", "))));
    }
    let sees_videos = sees_videos(results, rows)?;
    let metric = |name: &String| {
        let metric = Metric::named(name);
        let metric = if sees_videos { metric } else { metric.without_videos() };
        Metric { higher_is_better: metric.higher_is_better && !options.lower.contains(name), ..metric }
    };
    Ok(chosen.iter().map(metric).collect())
}

/// Whether returns were evaluated under videos in some of the runs: the two sets differ, or there is a gap between them.
fn sees_videos(results: &Results, rows: Option<&Rows>) -> anyhow::Result<bool> {
    let all = [HELD_OUT_RETURN, TRAINING_VIDEOS_RETURN, RETURN_GAP];
    let names: Vec<String> = all.into_iter().filter(|name| results.has(name)).map(String::from).collect();
    if !names.iter().map(String::as_str).eq([HELD_OUT_RETURN, TRAINING_VIDEOS_RETURN]) {
        return Ok(true);
    }
    let found = results.read_with(&[], &names, rows)?;
    Ok(found.iter().any(|row| row[0].number() != row[1].number()))
}

fn usual_key(results: &Results) -> String {
    ["objective", "method", "algorithm"].into_iter().find(|key| results.has(key)).unwrap_or("run").into()
}

/// What was read.
struct Read {
    /// Every run's numbers with their places.
    scores: Vec<RunScore>,
    /// The key that makes columns.
    across: Option<String>,
    /// The runs that were chosen.
    rows: usize,
    /// How many of them have none of the numbers, by their row of the table.
    without: BTreeMap<String, usize>,
}

/// Reads the runs' numbers.
fn scores(
    options: &Options,
    results: &Results,
    rows: Option<&Rows>,
    metrics: &[Metric],
    by: &[String],
) -> anyhow::Result<Read> {
    let tasks = || -> anyhow::Result<bool> {
        if !results.has("task") {
            return Ok(false);
        }
        let of = results.read(&["task".into()], rows)?;
        Ok(of.iter().any(|row| row != &of[0]))
    };
    let across = match &options.columns {
        Some(key) => Some(key.clone()),
        None if tasks()? && !by.contains(&"task".to_string()) => Some("task".to_string()),
        None => None,
    };
    let mut keys: Vec<String> = by.to_vec();
    keys.extend(across.clone());
    let names: Vec<String> = metrics.iter().map(|metric| metric.name.clone()).collect();
    let found = results.read_with(&keys, &names, rows)?;
    let (mut all, mut without, rows) = (Vec::new(), BTreeMap::new(), found.len());
    for row in found {
        let method = row[..by.len()].iter().map(Cell::text).collect::<Vec<_>>().join(", ");
        let column = across.is_some().then(|| row[by.len()].text());
        let numbers = &row[by.len() + usize::from(column.is_some())..];
        if numbers.iter().all(|cell| cell.number().is_none()) {
            *without.entry(method.clone()).or_default() += 1;
        }
        for (metric, cell) in metrics.iter().zip(numbers) {
            let Some(score) = cell.number() else { continue };
            let task = match (&column, metrics.len()) {
                (Some(column), 1) => column.clone(),
                (Some(column), _) => format!("{column}: {}", metric.title),
                (None, _) => metric.title.clone(),
            };
            let higher_is_better = metric.higher_is_better;
            all.push(RunScore { method: method.clone(), task, score, higher_is_better });
        }
    }
    if all.is_empty() {
        let names: Vec<&str> = metrics.iter().map(|metric| metric.name.as_str()).collect();
        return Err(wrong(format!("no run has a number for {}", names.join(", "))));
    }
    Ok(Read { scores: all, across, rows, without })
}

/// The folder of figures of a run, or of the folder that a table lies in.
fn beside(first: &Path) -> PathBuf {
    let folder = if first.is_file() { first.parent().unwrap_or(Path::new("")) } else { first };
    folder.join("figures")
}

fn write(out: &Path, table: &ScoreTable, corner: &str, averages: bool) -> anyhow::Result<Vec<PathBuf>> {
    let path = |name: &str| out.join(name);
    let texts = [("table.md", Style::Markdown), ("table.tex", Style::Latex)];
    for (name, style) in texts {
        vibes_data::write_atomically(&path(name), table.text(corner, averages, style).as_bytes())?;
    }
    let entries = || {
        let row = |r: usize| table.entries[r].iter().enumerate().filter_map(move |(c, e)| Some((r, c, e.as_ref()?)));
        (0..table.methods.len()).flat_map(row)
    };
    let texts = |of: &dyn Fn(usize, usize) -> String| Column::Text(entries().map(|(r, c, _)| of(r, c)).collect());
    let numbers = |of: fn(&scores::Entry) -> f64| Column::Float64(entries().map(|(_, _, e)| of(e)).collect());
    let mark = |mark: Mark| match mark {
        Mark::Best => "best",
        Mark::Tied => "tied",
        Mark::Plain => "",
    };
    let columns = [
        ("row", texts(&|r, _| table.methods[r].clone())),
        ("column", texts(&|_, c| table.tasks[c].clone())),
        ("mean", numbers(|e| e.score.estimate)),
        ("low", numbers(|e| e.score.low)),
        ("high", numbers(|e| e.score.high)),
        ("runs", Column::UInt32(entries().map(|(_, _, e)| e.runs as u32).collect())),
        ("mark", Column::Text(entries().map(|(_, _, e)| mark(e.mark).to_string()).collect())),
    ];
    write_csv(&path("table.csv"), &columns)?;
    write_parquet(&path("table.parquet"), &columns)?;
    Ok(["table.md", "table.tex", "table.csv", "table.parquet"].map(path).to_vec())
}

/// The table as a figure.
fn figure(heading: Heading, table: &ScoreTable, corner: &str, averages: bool, of: &str) -> Table {
    let entry = |entry: &Option<scores::Entry>| entry.as_ref().map(Entry::from);
    let averages = averages && table.has_averages();
    let mut columns = table.tasks.clone();
    columns.extend(averages.then(|| "average".to_string()));
    let row = |r: usize| {
        let mut entries: Vec<Option<Entry>> = table.entries[r].iter().map(entry).collect();
        if averages {
            let best = table.best_average() == Some(r);
            entries.push(table.averages[r].map(|mean| Entry { mean, half: None, best, tied: false }));
        }
        (table.methods[r].clone(), entries)
    };
    let rows = (0..table.methods.len()).map(row).collect();
    Table { heading, corner: corner.into(), columns, rows, by_row: false, foot: of.into() }
}
