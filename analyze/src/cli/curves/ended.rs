//! Where training ended, as a table: of one metric over groups and tasks, or of every metric.

use serde_json::{Value, json};

use super::groups::{Groups, is_of, tasks, title};
use crate::figures::{Entry, Heading, Table};
use crate::input::Run;
use crate::metrics::{Metric, Over};
use crate::scores::{self, RunScore, score_table};

/// Most groups that stand side by side above metrics.
const SIDE_BY_SIDE: usize = 5;

/// Which numbers those are.
const FOOT: &str = "vibes-train evaluate, else last evaluation, else mean of the last tenth";

/// The final values of a metric, one a run that has it.
fn scores(
    runs: &[Run],
    metric: &Metric,
    method: impl Fn(usize) -> String,
    task: impl Fn(usize) -> Option<String>,
) -> Vec<RunScore> {
    let score = |i: usize| {
        let (score, task) = (runs[i].final_value(&metric.name)?, task(i)?);
        Some(RunScore { method: method(i), task, score, higher_is_better: metric.higher_is_better })
    };
    (0..runs.len()).filter_map(score).collect()
}

/// Groups x tasks, the form of the paper's Table 1, with the mean over tasks where there are several.
pub(super) fn by_task(heading: Heading, runs: &[Run], groups: &Groups, metric: &Metric) -> Table {
    let task = |i: usize| Some(runs[i].task().unwrap_or("all runs").to_string());
    let made = score_table(&scores(runs, metric, |i| groups.of_runs[i].clone(), task));
    let mut columns = made.tasks.clone();
    let row = |entries: &Vec<Option<scores::Entry>>| -> Vec<Option<Entry>> {
        entries.iter().map(|entry| entry.as_ref().map(Entry::from)).collect()
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
    Table { heading, corner: metric.title.clone(), columns, rows, by_row: false, foot: FOOT.into() }
}

/// Metrics x groups; a metric of several tasks has a row for each, since what two tasks give is never averaged.
pub(super) fn by_metric(heading: Heading, runs: &[Run], groups: &Groups, metrics: &[Metric]) -> Table {
    let tasks = tasks(runs);
    let mut rows = Vec::new();
    for metric in metrics {
        for task in tasks.iter().map(Option::as_deref) {
            let row = row(runs, groups, metric, task);
            if row.iter().any(Option::is_some) {
                rows.push((title(metric, task), row));
            }
        }
    }
    Table { heading, corner: "metric".into(), columns: groups.names.clone(), rows, by_row: true, foot: FOOT.into() }
}

/// A metric of one task, group by group.
fn row(runs: &[Run], groups: &Groups, metric: &Metric, task: Option<&str>) -> Vec<Option<Entry>> {
    let column = |i: usize| is_of(&runs[i], task).then(|| metric.name.clone());
    let made = score_table(&scores(runs, metric, |i| groups.of_runs[i].clone(), column));
    let of = |group: &String| {
        let at = made.methods.iter().position(|method| method == group)?;
        made.entries[at][0].as_ref().map(Entry::from)
    };
    groups.names.iter().map(of).collect()
}

/// The table as it is drawn: metrics over many groups stand on their side, since names of runs are long and pages are not wide.
pub(super) fn as_drawn(table: Table) -> Table {
    if table.by_row && table.columns.len() > SIDE_BY_SIDE { table.transposed("group") } else { table }
}

/// The table's numbers.
pub(super) fn numbers(table: &Table) -> Value {
    let entry = |e: &Option<Entry>| {
        e.map(|e| {
            let over = e.half.map(|_| Over::Runs.name());
            json!({ "mean": e.mean, "half": e.half, "interval_over": over, "best": e.best, "tied": e.tied })
        })
    };
    let row = |(name, entries): &(String, Vec<Option<Entry>>)| {
        let values: Vec<Option<Value>> = entries.iter().map(entry).collect();
        json!({ "row": name, "columns": table.columns, "values": values })
    };
    table.rows.iter().map(row).collect()
}
