//! A run folder as the analyzer sees it: what was trained (`run.json`), how its numbers went (`metrics.jsonl`), and what was measured on a
//! held-out grid (`evaluations.jsonl`, written while training, and `evaluation*.json`, written by `vibes-train evaluate`).
//!
//! Every numeric field of the metrics becomes a series over `update` (or `step`), so that a new metric needs no change here. Those of the
//! held-out grid are named as in `held_out.gaps.dynamics_gap`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};
use vibes_data::{Metrics, RunFolder, RunInfo};

use super::InputError;
use crate::metrics::{
    DYNAMICS_GAP, ESTIMATE, GAP_UPDATES, HELD_OUT_RETURN, NUMBERS, Over, RETURN_GAP, REWARD_GAP,
    TRAINING_VIDEOS_RETURN, own_interval,
};

/// Fields that count progress, the first that a line has is its x.
const CLOCKS: [&str; 7] =
    ["control_steps", "env_step", "environment_steps", "update", "step", "agent_steps", "episodes"];

/// What the names of metrics on a held-out grid begin with.
const HELD_OUT: &str = "held_out";
/// The field of an evaluation that says whether its grid was new to the run. Older ones have none.
const IS_HELD_OUT: &str = "is_held_out";
/// The end of [`GAP_UPDATES`].
const CRITIC_UPDATES: &str = "critic_updates";

/// One metric over training: `(x, value)` in the order of the file.
pub type Series = Vec<(f64, f64)>;

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Its folder.
    pub path: PathBuf,
    /// The folder's name.
    pub name: String,
    /// `run.json` or `model_free.json`, if there is one.
    pub info: Option<RunInfo>,
    /// What the x axis of the series counts, as in `update`.
    pub clock: String,
    /// Every numeric metric.
    pub series: BTreeMap<String, Series>,
    /// Numbers of where the run ended that have no place on a curve: of the last evaluation of an online run, which has starts and a number of episodes of its own, and of
    /// `vibes-train evaluate` where another grid was looked at over training.
    finals: BTreeMap<String, f64>,
    /// Files of the run whose grid is among what the run was trained on, or what was fitted for it: their numbers are not held out, and are left out.
    not_held_out: BTreeSet<String>,
    /// The protocol under which an online run was evaluated last.
    protocol: Option<String>,
    /// What else must be known of its numbers.
    remarks: Vec<String>,
    /// Lines of the metrics that could not be read (a run that was killed leaves at most one).
    pub broken_lines: usize,
}

impl Run {
    /// Reads a run folder.
    ///
    /// # Errors
    /// [`InputError::NoRun`] without a `metrics.jsonl`.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let folder = RunFolder::at(path);
        if !folder.metrics_path().is_file() {
            return Err(InputError::NoRun { path: path.into() });
        }
        let metrics = Metrics::read(&folder.metrics_path())?;
        // A run of another program may have metrics and no run.json; a damaged one is said.
        let info = match folder.open_info() {
            Ok(info) => Some(info),
            Err(vibes_data::Error::NoRun { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        let name = folder.name();
        let (mut series, mut clock): (BTreeMap<String, Series>, _) = (BTreeMap::new(), None);
        for (number, row) in metrics.lines.iter().enumerate() {
            let key = clock.get_or_insert_with(|| CLOCKS.into_iter().find(|c| row.contains_key(*c)).unwrap_or("line"));
            let x = row.get(*key).and_then(Value::as_f64).unwrap_or(number as f64);
            for (metric, value) in row.iter().filter(|(name, _)| !CLOCKS.contains(&name.as_str())) {
                if let Some(value) = value.as_f64() {
                    series.entry(metric.clone()).or_default().push((x, value));
                }
            }
        }
        let clock = clock.unwrap_or("update").to_string();
        let (path, finals, not_held_out, remarks) = (path.into(), BTreeMap::new(), BTreeSet::new(), Vec::new());
        let broken_lines = metrics.broken;
        let protocol = None;
        let mut run = Self { path, name, info, clock, series, finals, not_held_out, protocol, remarks, broken_lines };
        run.add_held_out(&folder, &metrics)?;
        // Single checkpoints are evaluated in any order.
        run.series.values_mut().for_each(|series| series.sort_by(|a, b| a.0.total_cmp(&b.0)));
        Ok(run)
    }

    /// Adds what was measured on a held-out grid: over training, and of single checkpoints.
    fn add_held_out(&mut self, folder: &RunFolder, metrics: &Metrics) -> Result<(), InputError> {
        let passed = passed(metrics, &self.clock);
        let over_training = Metrics::read(&folder.evaluations_path())?;
        self.broken_lines += over_training.broken;
        let is_final = |row: &&Map<String, Value>| row.get("is_final") == Some(&Value::Bool(true));
        let is_held_out = |row: &&Map<String, Value>| row.get(IS_HELD_OUT) != Some(&Value::Bool(false));
        if !over_training.lines.iter().all(|row| is_held_out(&row)) {
            self.not_held_out.insert(name_of(&folder.evaluations_path()));
        }
        let kept = over_training.lines.iter().filter(is_held_out);
        let all_final = kept.clone().all(|row| is_final(&row));
        for row in kept.clone().filter(|row| all_final || !is_final(row)) {
            let own = row.get(&self.clock).and_then(Value::as_f64);
            let x = own.unwrap_or_else(|| at(&passed, row.get("update").and_then(Value::as_f64)));
            let mut row = row.clone();
            let gaps = gaps(&Value::Object(row.clone()));
            row.insert("gaps".into(), gaps);
            self.add(HELD_OUT, &Value::Object(row), x);
        }
        if let Some(last) = over_training.lines.last().filter(is_final).filter(is_held_out) {
            self.add_final(HELD_OUT, &Value::Object(last.clone()));
            self.protocol = last.get("protocol").and_then(Value::as_str).map(str::to_owned);
            let under = self.protocol.iter().map(|protocol| format!("{}: last evaluated under {protocol}", self.name));
            self.remarks.extend(under);
        }
        // Evaluations of an online run are of returns alone, and leave room for a grid's numbers.
        let of_grid = kept.clone().filter(|row| row.contains_key("numbers"));
        let judged = of_grid.filter_map(|row| row.get("update")?.as_f64()).reduce(f64::max);
        let with_gaps = kept.clone().filter(|row| row.get("gaps").is_some_and(Value::is_object));
        let gaps_judged = with_gaps.filter_map(|row| row.get("update")?.as_f64()).reduce(f64::max);
        self.add_documents(folder, [judged, gaps_judged], &passed)
    }

    /// Adds what `vibes-train evaluate` measured. Where evaluations over training, the last after so many updates, have a grid's numbers or its gaps too, of what may be another grid, a document has no place
    /// on their curve; of the newest checkpoint that was evaluated it says where the run ended, since it was asked for by name.
    fn add_documents(
        &mut self,
        folder: &RunFolder,
        [judged, gaps_judged]: [Option<f64>; 2],
        passed: &[(f64, f64)],
    ) -> Result<(), InputError> {
        let (held_out, others): (Vec<_>, Vec<_>) =
            evaluations(&self.path)?.into_iter().partition(|(_, document)| document[IS_HELD_OUT] != false);
        self.not_held_out.extend(others.iter().map(|(path, _)| name_of(path)));
        let newest = held_out.iter().map(|(_, document)| update_of(document)).reduce(f64::max);
        // One number of each checkpoint: where two documents have it, that of the one whose name is last.
        let mut found = BTreeMap::new();
        for (_, document) in &held_out {
            let of = update_of(document);
            let mut keep = |name: &str, value: f64| {
                found.insert((name.to_owned(), of.to_bits()), value);
            };
            let gaps = gaps(document);
            for (name, measured, judged) in
                [(HELD_OUT, &document["report"], judged), ("held_out.gaps", &gaps, gaps_judged)]
            {
                match judged {
                    None => numbers(name, measured, &mut keep),
                    Some(judged) if Some(of) == newest && of >= judged => self.add_final(name, measured),
                    Some(_) => {}
                }
            }
        }
        for ((name, of), value) in found {
            let x = at(passed, Some(f64::from_bits(of)));
            self.series.entry(name).or_default().push((x, value));
        }
        // What nobody is shown needs no word.
        let newest = newest.filter(|newest| judged.is_none_or(|judged| *newest >= judged));
        self.remark_documents(folder, newest, &held_out);
        Ok(())
    }

    /// Says where the documents of the newest evaluated checkpoint are of several grids, and where the run has gone on since.
    fn remark_documents(&mut self, folder: &RunFolder, newest: Option<f64>, documents: &[(PathBuf, Value)]) {
        let Some(newest) = newest else { return };
        let of_newest = documents.iter().filter(|(_, document)| update_of(document) == newest);
        let grids: BTreeSet<&str> = of_newest.filter_map(|(_, document)| document["grid"].as_str()).collect();
        let name = &self.name;
        if grids.len() > 1 {
            let grids = grids.into_iter().collect::<Vec<_>>().join(", ");
            self.remarks.push(format!("{name} was evaluated on several grids after {newest} updates: {grids}; a number is that of the last file that has it"));
        }
        let last = folder.checkpoints().last().copied().filter(|last| *last as f64 > newest && newest > 0.0);
        if let Some(last) = last {
            self.remarks.push(format!("{name} was evaluated after {newest} updates and has gone on to {last}; `vibes-train evaluate` judges what it is now"));
        }
    }

    /// Adds every number of a document at `x`.
    fn add(&mut self, name: &str, value: &Value, x: f64) {
        numbers(name, value, &mut |name, y| self.series.entry(name.to_owned()).or_default().push((x, y)));
    }

    /// Keeps every number of a document as where the run ended.
    fn add_final(&mut self, name: &str, value: &Value) {
        numbers(name, value, &mut |name, y| {
            self.finals.insert(name.to_owned(), y);
        });
    }

    /// The full name of a metric of this run; a number of `vibes-train evaluate` may be called as it is called there, as in `retrieval_same_step@1`.
    #[must_use]
    pub fn full_name(&self, metric: &str) -> Option<&str> {
        let own = self.series.get_key_value(metric).map(|(name, _)| name.as_str());
        own.or_else(|| self.known_final(metric)).or_else(|| self.of_grid(metric))
    }

    /// Every metric that it has a number of.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.series.keys().chain(self.finals.keys()).map(String::as_str)
    }

    /// A number of a held-out grid as `vibes-train evaluate` calls it, by its full name.
    fn of_grid(&self, metric: &str) -> Option<&str> {
        let name = format!("{NUMBERS}{metric}{ESTIMATE}");
        self.series.get_key_value(&name).map(|(name, _)| name.as_str()).or_else(|| self.known_final(&name))
    }

    fn known_final(&self, name: &str) -> Option<&str> {
        self.finals.get_key_value(name).map(|(name, _)| name.as_str())
    }

    /// What must be known of its numbers, a sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let fact = |file: &String| {
            let name = &self.name;
            format!(
                "{name}/{file} is left out: its grid or its videos are among what the run was trained on, or what was fitted for it, and so are not held out"
            )
        };
        self.not_held_out.iter().map(fact).chain(self.remarks.iter().cloned()).collect()
    }

    /// Where a metric ended: the number of `vibes-train evaluate` of the newest checkpoint that it judged, else of the last evaluation, else the mean of its last tenth, at least one value. Of two of one name it is the number of the held-out grid, not of
    /// the batches.
    #[must_use]
    pub fn final_value(&self, metric: &str) -> Option<f64> {
        let name = self.of_grid(metric).unwrap_or(metric);
        if let Some(value) = self.finals.get(name) {
            return Some(*value);
        }
        let series = self.series.get(name).filter(|series| !series.is_empty())?;
        // Evaluations are whole, as the lines of training batches are not.
        if name.strip_prefix(HELD_OUT).is_some_and(|rest| rest.starts_with('.')) {
            return series.last().map(|point| point.1);
        }
        let count = (series.len() / 10).max(1);
        Some(series[series.len() - count..].iter().map(|point| point.1).sum::<f64>() / count as f64)
    }

    /// The 95% interval that the run's own evaluation at a point of a metric holds, and what it is over. None of metrics of training batches, where an evaluation has none (of a single episode),
    /// and where several evaluations lie at one place.
    #[must_use]
    pub fn own_interval(&self, metric: &str, (x, value): (f64, f64)) -> Option<((f64, f64), Over)> {
        let (name, over) = own_interval(metric)?;
        let only = |name: &str| only_at(self.series.get(name)?, x);
        let ends = (only(&format!("{name}.low"))?, only(&format!("{name}.high"))?);
        (only(metric)? == value).then_some((ends, over))
    }

    /// Whether returns were evaluated under videos. Where nobody sees one, both sets are the same episodes and there is no gap between them.
    #[must_use]
    pub fn sees_videos(&self) -> bool {
        let [held_out, training] = [HELD_OUT_RETURN, TRAINING_VIDEOS_RETURN];
        self.names().any(|name| name == RETURN_GAP)
            || self.series.get(held_out) != self.series.get(training)
            || self.finals.get(held_out) != self.finals.get(training)
    }

    /// A number of the last evaluation of an online run that has ended, by its full name.
    #[must_use]
    pub fn last_evaluation(&self, name: &str) -> Option<f64> {
        self.finals.get(name).copied()
    }

    /// The protocol under which it was evaluated last, if it was under one.
    #[must_use]
    pub fn protocol(&self) -> Option<&str> {
        self.protocol.as_deref()
    }

    /// After how many updates of the critic the gaps were read that the run ended with; none where their file does not say.
    #[must_use]
    pub fn gap_updates(&self) -> Option<u64> {
        let is_final = [DYNAMICS_GAP, REWARD_GAP].iter().any(|gap| self.finals.contains_key(*gap));
        let updates = if is_final {
            self.finals.get(GAP_UPDATES).copied()
        } else {
            let last = |gap: &str| self.series.get(gap)?.last().map(|point| point.0);
            only_at(self.series.get(GAP_UPDATES)?, last(DYNAMICS_GAP).or_else(|| last(REWARD_GAP))?)
        };
        updates.map(|updates| updates as u64)
    }

    /// The objective the run was trained with, if `run.json` says.
    #[must_use]
    pub fn objective(&self) -> Option<&str> {
        self.info.as_ref()?.option("objective")
    }

    /// The task of its recordings, if `run.json` says.
    #[must_use]
    pub fn task(&self) -> Option<&str> {
        self.info.as_ref()?.task()
    }

    /// How far training got, in updates.
    #[must_use]
    pub fn updates(&self) -> Option<f64> {
        (self.clock == "update").then(|| self.series.values().filter_map(|s| s.last()).map(|p| p.0).fold(0.0, f64::max))
    }
}

/// The gaps of an evaluation, with the updates of the critic that they were read after where it says so.
fn gaps(evaluation: &Value) -> Value {
    let mut gaps = evaluation["gaps"].clone();
    if let (Some(fields), Some(updates)) = (gaps.as_object_mut(), evaluation.get("gap_updates")) {
        fields.insert(CRITIC_UPDATES.into(), updates.clone());
    }
    gaps
}

/// Every number of a document under its name, as in `held_out.gaps.dynamics_gap`; an interval is a list of its ends.
fn numbers(name: &str, value: &Value, found: &mut dyn FnMut(&str, f64)) {
    match value {
        Value::Object(fields) => {
            for (field, value) in fields.iter().filter(|(field, _)| !CLOCKS.contains(&field.as_str())) {
                numbers(&format!("{name}.{field}"), value, found);
            }
        }
        Value::Number(number) => {
            if let Some(number) = number.as_f64() {
                found(name, number);
            }
        }
        Value::Array(ends) if ends.len() == 2 => {
            for (end, value) in ["low", "high"].into_iter().zip(ends) {
                numbers(&format!("{name}.{end}"), value, found);
            }
        }
        _ => {}
    }
}

/// The value at a place of a series, which goes by rising places, if there is just one.
fn only_at(series: &[(f64, f64)], x: f64) -> Option<f64> {
    let from = series.partition_point(|point| point.0 < x);
    let to = series.partition_point(|point| point.0 <= x);
    (to == from + 1).then(|| series[from].1)
}

/// Updates and what the clock showed then, for clocks that do not count updates.
fn passed(metrics: &Metrics, clock: &str) -> Vec<(f64, f64)> {
    let rows = metrics.lines.iter();
    rows.filter_map(|row| Some((row.get("update")?.as_f64()?, row.get(clock)?.as_f64()?))).collect()
}

/// What the clock showed after an update.
fn at(passed: &[(f64, f64)], update: Option<f64>) -> f64 {
    let update = update.unwrap_or(0.0);
    let after = passed.iter().find(|(passed, _)| *passed >= update).or(passed.last());
    match after {
        // Between two lines of the metrics: the update itself, if that is what the clock counts.
        Some(&(passed, clock)) if passed == clock => update,
        Some(&(_, clock)) => clock,
        None => update,
    }
}

/// The documents of `vibes-train evaluate` in a run folder.
///
/// # Errors
/// [`InputError::Document`]: one is damaged.
fn evaluations(run: &Path) -> Result<Vec<(PathBuf, Value)>, InputError> {
    let entries = std::fs::read_dir(run).into_iter().flatten().flatten().map(|entry| entry.path());
    let named = |path: &PathBuf| {
        let name = name_of(path);
        name.starts_with("evaluation") && name.ends_with(".json")
    };
    let mut paths: Vec<PathBuf> = entries.filter(named).collect();
    paths.sort();
    let read = |path: PathBuf| {
        let bytes = std::fs::read(&path).map_err(|error| error.to_string());
        let document = bytes.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|error| error.to_string()));
        match document {
            Ok(document) => Ok((path, document)),
            Err(fact) => Err(InputError::Document { fact, path }),
        }
    };
    paths.into_iter().map(read).collect()
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The update of the checkpoint that a document is about, from its path `…/checkpoints/000500/model.safetensors`; 0 where it does not say.
fn update_of(document: &Value) -> f64 {
    let checkpoint = Path::new(document["checkpoint"].as_str().unwrap_or_default());
    checkpoint.iter().rev().find_map(|part| part.to_str()?.parse::<u64>().ok()).unwrap_or(0) as f64
}

#[cfg(test)]
mod tests;
