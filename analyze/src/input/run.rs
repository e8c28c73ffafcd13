//! A run folder as the analyzer sees it: what was trained (`run.json`) and how its numbers went (`metrics.jsonl`).
//!
//! Every numeric field of the metrics becomes a series over `update` (or `step`), so that a new metric needs no change here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::InputError;

/// Fields that count progress, the first that a line has is its x.
const CLOCKS: [&str; 4] = ["env_step", "environment_steps", "update", "step"];

/// One metric over training: `(x, value)` in the order of the file.
pub type Series = Vec<(f64, f64)>;

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Its folder.
    pub path: PathBuf,
    /// The folder's name.
    pub name: String,
    /// `run.json`, or null.
    pub info: Value,
    /// What the x axis of the series counts, as in `update`.
    pub clock: String,
    /// Every numeric metric.
    pub series: BTreeMap<String, Series>,
    /// Lines of the metrics that could not be read (a run that was killed leaves at most one).
    pub broken_lines: usize,
}

impl Run {
    /// Reads a run folder.
    ///
    /// # Errors
    /// [`InputError::NoRun`] without a `metrics.jsonl`.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = match std::fs::read_to_string(path.join("metrics.jsonl")) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(InputError::NoRun { path: path.into() });
            }
            Err(error) => return Err(InputError::io(&path.join("metrics.jsonl"))(error)),
        };
        let info = std::fs::read(path.join("run.json"))
            .ok()
            .and_then(|text| serde_json::from_slice(&text).ok())
            .unwrap_or(Value::Null);
        let whole = std::path::absolute(path).unwrap_or_else(|_e| path.to_path_buf());
        let name = whole.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        let (mut series, mut broken_lines, mut clock): (BTreeMap<String, Series>, _, _) = (BTreeMap::new(), 0, None);
        for (number, line) in text.lines().filter(|l| !l.trim().is_empty()).enumerate() {
            let Ok(Value::Object(row)) = serde_json::from_str::<Value>(line) else {
                broken_lines += 1;
                continue;
            };
            let key = clock.get_or_insert_with(|| CLOCKS.into_iter().find(|c| row.contains_key(*c)).unwrap_or("line"));
            let x = row.get(*key).and_then(Value::as_f64).unwrap_or(number as f64);
            for (metric, value) in row.iter().filter(|(name, _)| !CLOCKS.contains(&name.as_str())) {
                if let Some(value) = value.as_f64() {
                    series.entry(metric.clone()).or_default().push((x, value));
                }
            }
        }
        let clock = clock.unwrap_or("update").to_string();
        Ok(Self { path: path.into(), name, info, clock, series, broken_lines })
    }

    /// The objective the run was trained with, if `run.json` says.
    #[must_use]
    pub fn objective(&self) -> Option<&str> {
        find(&self.info, "objective")
    }

    /// The task of its recordings, if `run.json` says.
    #[must_use]
    pub fn task(&self) -> Option<&str> {
        find(&self.info, "task")
    }

    /// How far training got, in updates.
    #[must_use]
    pub fn updates(&self) -> Option<f64> {
        (self.clock == "update").then(|| self.series.values().filter_map(|s| s.last()).map(|p| p.0).fold(0.0, f64::max))
    }
}

/// The first text under this key, anywhere in the document.
fn find<'a>(value: &'a Value, key: &str) -> Option<&'a str> {
    let Value::Object(map) = value else { return None };
    map.get(key).and_then(Value::as_str).or_else(|| map.values().find_map(|v| find(v, key)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_killed_runs_last_line_is_counted_not_fatal() {
        let dir = tempfile::tempdir().expect("folder");
        let text =
            "{\"update\":10,\"loss\":2.5,\"gap\":null}\n{\"update\":20,\"loss\":1.5,\"gap\":0.5}\n{\"update\":30,\"lo";
        std::fs::write(dir.path().join("metrics.jsonl"), text).expect("file");
        std::fs::write(dir.path().join("run.json"), r#"{"options":{"model":{"objective":"vibes"}}}"#).expect("file");
        let run = Run::read(dir.path()).expect("run");
        assert_eq!(run.series["loss"], vec![(10.0, 2.5), (20.0, 1.5)]);
        assert_eq!(run.series["gap"], vec![(20.0, 0.5)]);
        assert_eq!((run.broken_lines, run.objective(), run.updates()), (1, Some("vibes"), Some(20.0)));
    }

    #[test]
    fn a_folder_without_metrics_is_no_run() {
        let dir = tempfile::tempdir().expect("folder");
        assert!(matches!(Run::read(dir.path()), Err(InputError::NoRun { .. })));
    }
}
