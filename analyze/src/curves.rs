//! Learning curves with intervals over runs (Figure 3), and the table of methods × tasks (Table 1).
//!
//! In: for each run its points `(x, y)`: environment steps or updates, and a return, a gap, any metric. Out: mean and 95% interval
//! (Student's t over runs) at common places, and the table with its best and tied entries marked.

use std::collections::BTreeMap;

use serde::Serialize;

use vibes_measure::Error;
use vibes_measure::intervals::{Interval, student};

/// One place on a mean curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Steps, updates, …
    pub x: f64,
    /// Mean over runs and its interval; no interval from a single run.
    pub y: Interval,
    /// Runs that reach this far.
    pub runs: usize,
}

/// The mean curve of several runs at `places` evenly spaced values of x, from the latest start to the furthest end.
///
/// Each run is averaged over a window of one spacing around each place, and read off linearly between points where the window is empty. Runs that
/// end early take part up to their end.
///
/// # Errors
/// No run with a finite point, or fewer than two places.
pub fn mean_curve(runs: &[Vec<(f64, f64)>], places: usize) -> Result<Vec<CurvePoint>, Error> {
    if places < 2 {
        return Err(Error::Option { option: "places", value: places.to_string(), must: "at least 2" });
    }
    let runs: Vec<Vec<(f64, f64)>> = runs.iter().map(|run| sorted(run)).filter(|run| !run.is_empty()).collect();
    let start = runs.iter().map(|run| run[0].0).fold(f64::NEG_INFINITY, f64::max);
    let end = runs.iter().map(|run| run[run.len() - 1].0).fold(f64::NEG_INFINITY, f64::max);
    if runs.is_empty() {
        return Err(Error::TooFewRows { what: "a learning curve: runs with points", needed: 1, found: 0 });
    }
    let spacing = ((end - start) / (places - 1) as f64).max(0.0);
    let count = if spacing > 0.0 { places } else { 1 };
    let point = |place: usize| {
        let x = start + spacing * place as f64;
        let values: Vec<f64> = runs.iter().filter_map(|run| read(run, x, spacing)).collect();
        CurvePoint { x, y: student(&values), runs: values.len() }
    };
    Ok((0..count).map(point).collect())
}

/// Finite points by rising x.
fn sorted(run: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut run: Vec<(f64, f64)> = run.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    run.sort_by(|a, b| a.0.total_cmp(&b.0));
    run
}

/// A run's value at `x`: the mean over the window around it, or linear between the points beside it.
fn read(run: &[(f64, f64)], x: f64, width: f64) -> Option<f64> {
    let from = run.partition_point(|point| point.0 < x - width / 2.0);
    let to = run.partition_point(|point| point.0 <= x + width / 2.0);
    if to > from {
        return Some(run[from..to].iter().map(|point| point.1).sum::<f64>() / (to - from) as f64);
    }
    let (before, after) = (run.get(from.checked_sub(1)?)?, run.get(to)?);
    Some(before.1 + (after.1 - before.1) * (x - before.0) / (after.0 - before.0))
}

/// A result to enter in the table.
#[derive(Debug, Clone, PartialEq)]
pub struct RunScore {
    /// Row: method, objective, …
    pub method: String,
    /// Column: task.
    pub task: String,
    /// The run's number, as its final return.
    pub score: f64,
}

/// How an entry is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// The highest mean of its column: bold.
    Best,
    /// Its interval overlaps the best one's: underlined.
    Tied,
    /// Neither.
    Plain,
}

/// One entry of the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Entry {
    /// Mean over runs and its interval.
    pub score: Interval,
    /// Number of runs.
    pub runs: usize,
    /// How it is set.
    pub mark: Mark,
}

/// Methods × tasks, as Table 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreTable {
    /// Rows, in order of appearance.
    pub methods: Vec<String>,
    /// Columns, in order of appearance.
    pub tasks: Vec<String>,
    /// `[methods][tasks]`; none where a method has no run of a task.
    pub entries: Vec<Vec<Option<Entry>>>,
    /// Mean over tasks of the means, for methods that have every task.
    pub averages: Vec<Option<f64>>,
}

/// The table of any runs.
#[must_use]
pub fn score_table(runs: &[RunScore]) -> ScoreTable {
    let methods = in_order(runs.iter().map(|run| &run.method));
    let tasks = in_order(runs.iter().map(|run| &run.task));
    let mut scores: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for run in runs {
        scores.entry((&run.method, &run.task)).or_default().push(run.score);
    }
    let entry = |method: &String, task: &String| {
        let scores = scores.get(&(method.as_str(), task.as_str()))?;
        Some(Entry { score: student(scores), runs: scores.len(), mark: Mark::Plain })
    };
    let mut entries: Vec<Vec<Option<Entry>>> =
        methods.iter().map(|method| tasks.iter().map(|task| entry(method, task)).collect()).collect();
    (0..tasks.len()).for_each(|task| mark(entries.iter_mut().filter_map(|row| row[task].as_mut()).collect()));
    let average = |row: &Vec<Option<Entry>>| {
        let means: Option<Vec<f64>> = row.iter().map(|entry| entry.map(|entry| entry.score.estimate)).collect();
        means.map(|means| means.iter().sum::<f64>() / means.len() as f64)
    };
    let averages = entries.iter().map(average).collect();
    ScoreTable { methods, tasks, entries, averages }
}

fn in_order<'n>(names: impl Iterator<Item = &'n String>) -> Vec<String> {
    names.fold(Vec::new(), |mut seen, name| {
        if !seen.contains(name) {
            seen.push(name.clone());
        }
        seen
    })
}

/// Mark the best entry of a column and those whose intervals overlap its. Without an interval an entry stands for its mean alone.
fn mark(mut column: Vec<&mut Entry>) {
    let reach = |score: Interval, end: f64| if end.is_nan() { score.estimate } else { end };
    let Some(best) = column.iter().map(|entry| entry.score).max_by(|a, b| a.estimate.total_cmp(&b.estimate)) else {
        return;
    };
    for entry in &mut column {
        entry.mark = if entry.score.estimate >= best.estimate {
            Mark::Best
        } else if reach(entry.score, entry.score.high) >= reach(best, best.low) {
            Mark::Tied
        } else {
            Mark::Plain
        };
    }
}

#[cfg(test)]
mod tests {
    use super::{Mark, RunScore, mean_curve, score_table};

    #[test]
    fn curves_are_averaged_where_runs_have_them() {
        // Two lines on different grids, and one that ends half way.
        let line = |slope: f64, every: f64, end: f64| -> Vec<(f64, f64)> {
            (0..).map(|i| f64::from(i) * every).take_while(|x| *x <= end).map(|x| (x, slope * x)).collect()
        };
        let runs = [line(1.0, 1.0, 100.0), line(3.0, 7.0, 98.0), line(2.0, 0.5, 50.0)];
        let curve = mean_curve(&runs, 11).unwrap();
        assert_eq!(curve.len(), 11);
        assert_eq!((curve[3].runs, curve[8].runs), (3, 2));
        let (third, eighth) = (curve[3], curve[8]);
        assert!((third.x - 30.0).abs() < 1e-9 && (third.y.estimate - 60.0).abs() < 3.0, "{third:?}");
        assert!((eighth.y.estimate - 160.0).abs() < 4.0, "{eighth:?}");
        // t(2) · s / √3 with s the deviation of 30, 60 and 90.
        assert!((third.y.high - third.y.estimate - 4.3027 * 30.0 / 3.0_f64.sqrt()).abs() < 10.0);
        assert!(mean_curve(&[vec![(0.0, f64::NAN)]], 5).is_err());
        assert_eq!(mean_curve(&[vec![(5.0, 1.0)]], 5).unwrap().len(), 1);
    }

    #[test]
    fn the_best_is_bold_and_the_tied_are_underlined() {
        let run =
            |method: &str, task: &str, score| RunScore { method: method.to_owned(), task: task.to_owned(), score };
        let scores = |method: &str, task: &str, centre: f64, spread: f64| {
            [-1.0, 0.0, 1.0].map(|x| run(method, task, centre + spread * x)).to_vec()
        };
        let runs = [
            scores("vibes", "reacher", 900.0, 10.0),
            scores("no-adversary", "reacher", 880.0, 10.0),
            scores("reconstruction", "reacher", 100.0, 10.0),
            scores("vibes", "walker", 700.0, 1.0),
            scores("reconstruction", "walker", 710.0, 1.0),
        ];
        let table = score_table(&runs.concat());
        assert_eq!(table.methods, ["vibes", "no-adversary", "reconstruction"]);
        assert_eq!(table.tasks, ["reacher", "walker"]);
        let mark = |method: usize, task: usize| table.entries[method][task].map(|entry| entry.mark);
        assert_eq!([mark(0, 0), mark(1, 0), mark(2, 0)], [Some(Mark::Best), Some(Mark::Tied), Some(Mark::Plain)]);
        assert_eq!([mark(0, 1), mark(1, 1), mark(2, 1)], [Some(Mark::Plain), None, Some(Mark::Best)]);
        assert_eq!(table.averages, [Some(800.0), None, Some(405.0)]);
    }
}
