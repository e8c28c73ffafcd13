//! How far every run of a sweep is, from its files alone, so that it can be asked from anywhere.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::Serialize;
use vibes_data::{FolderLock, Metrics, RunFolder};

use super::{Element, Mark};
use crate::error::Result;

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Nothing was done yet.
    Waiting,
    /// A process is at it.
    Running,
    /// It was stopped and goes on with the same command.
    Saved,
    /// Every stage is done.
    Done,
    /// A stage failed.
    Failed,
}

/// One line of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// The run's place in the plan.
    pub index: usize,
    /// Its settings.
    pub name: String,
    /// Where it stands.
    pub state: State,
    /// Stages done, and of how many.
    pub stages: (usize, usize),
    /// Updates made.
    pub update: Option<u64>,
    /// Updates asked for; none of online training, which goes by control steps.
    pub updates: Option<u64>,
    /// Control steps lived through, in online training.
    pub control_steps: Option<u64>,
    /// Control steps asked for, in online training.
    pub control_steps_asked: Option<u64>,
    /// Updates a second over the last line of the metrics.
    pub rate: Option<f64>,
    /// Seconds of training left at that rate.
    pub seconds_left: Option<f64>,
    /// The objective in the last line of the metrics.
    pub objective: Option<f64>,
    /// Seconds since the metrics last grew.
    pub seconds_since: Option<f64>,
    /// Why it failed, or who is at it and what that waits for.
    pub note: Option<String>,
}

/// The state of one run. One whose folder belongs to another plan, or has a file that cannot be read, has failed, so that it does not hide the others.
pub fn status(element: &Element) -> Status {
    found(element).unwrap_or_else(|error| Status {
        index: element.index,
        name: element.name.clone(),
        state: State::Failed,
        stages: (0, element.stages.len()),
        update: None,
        updates: None,
        control_steps: None,
        control_steps_asked: None,
        rate: None,
        seconds_left: None,
        objective: None,
        seconds_since: None,
        note: Some(error.to_string()),
    })
}

fn found(element: &Element) -> Result<Status> {
    let mark = Mark::found(element)?;
    let owner = FolderLock::owner_beside(&element.folder);
    let state = match &mark {
        _ if owner.is_some() => State::Running,
        None => State::Waiting,
        Some(mark) if mark.is_done() => State::Done,
        Some(mark) if mark.error.is_some() => State::Failed,
        Some(_) => State::Saved,
    };
    let run = at_work(&element.folder);
    let metrics = Metrics::read(&run.metrics_path())?;
    let control_steps_asked = control_steps_asked(&run);
    let is_online = control_steps_asked.is_some();
    let updates = run.open_info().ok().and_then(|info| info.options.get("updates")?.as_u64()).filter(|_| !is_online);
    let whole = |name: &str| metrics.last(name).map(|number| number as u64);
    let (update, control_steps) = (whole("update"), whole("control_steps").filter(|_| is_online));
    let rate = metrics.last("updates_per_second");
    let (asked, made, pace) = match is_online {
        true => (control_steps_asked, control_steps, metrics.last("control_steps_per_second")),
        false => (updates, update, rate),
    };
    let left = asked.zip(made).map(|(all, made)| all.saturating_sub(made) as f64);
    let since = std::fs::metadata(run.metrics_path()).and_then(|file| file.modified()).ok();
    let since = since.map(|then| SystemTime::now().duration_since(then).unwrap_or(Duration::ZERO).as_secs_f64());
    Ok(Status {
        index: element.index,
        name: element.name.clone(),
        state,
        stages: (mark.as_ref().map_or(0, |mark| mark.finished), element.stages.len()),
        update,
        updates,
        control_steps,
        control_steps_asked,
        rate,
        seconds_left: left.zip(pace).filter(|(_, pace)| *pace > 0.0).map(|(left, pace)| left / pace),
        objective: metrics.last("objective"),
        seconds_since: since,
        note: note(owner, mark),
    })
}

/// Who is at a run, with what it waits for if it does; or why it failed.
fn note(owner: Option<String>, mark: Option<Mark>) -> Option<String> {
    let (error, waiting) = mark.map_or((None, None), |mark| (mark.error, mark.waiting));
    match (owner, waiting) {
        (Some(owner), Some(reason)) => Some(format!("{owner}; waiting: {reason}")),
        (owner, _) => owner.or(error),
    }
}

/// Control steps that an online run is to live through, with a world model or without.
fn control_steps_asked(run: &RunFolder) -> Option<u64> {
    let read = |file: &Path| serde_json::from_slice::<serde_json::Value>(&std::fs::read(file).ok()?).ok();
    let options =
        read(&run.path().join("online.json")).or_else(|| Some(read(&run.model_free_path())?["online"].take()));
    options?["control_steps"].as_u64()
}

/// The training run of an element whose metrics grew last: the element's own folder, or one in it, as in a plan that trains offline and then online.
fn at_work(folder: &Path) -> RunFolder {
    let inside = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let grown = |path: PathBuf| {
        let grown = std::fs::metadata(RunFolder::at(&path).metrics_path()).and_then(|file| file.modified()).ok()?;
        Some((grown, path))
    };
    let newest = inside.chain([folder.to_owned()]).filter_map(grown).max();
    RunFolder::at(&newest.map_or_else(|| folder.to_owned(), |(_, path)| path))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of online training goes by control steps, of which its run.json says nothing: the updates there are those of the offline run before.
    #[test]
    fn online_training_goes_by_control_steps() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("2-online");
        std::fs::create_dir(&run).unwrap();
        std::fs::write(run.join("online.json"), r#"{"control_steps":1000}"#).unwrap();
        let line = r#"{"update":90,"control_steps":400,"updates_per_second":5.0,"control_steps_per_second":20.0}"#;
        std::fs::write(run.join("metrics.jsonl"), line.to_owned() + "\n").unwrap();
        let element = Element {
            index: 0,
            name: "seed=0".to_owned(),
            folder: folder.path().to_owned(),
            settings: Default::default(),
            stages: vec![vec!["vibes-train".to_owned()]; 2],
        };
        let found = status(&element);
        assert_eq!((found.update, found.updates, found.rate), (Some(90), None, Some(5.0)));
        assert_eq!((found.control_steps, found.control_steps_asked), (Some(400), Some(1000)));
        assert_eq!(found.seconds_left, Some(30.0));
    }
}
