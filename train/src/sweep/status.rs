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
    /// Updates asked for.
    pub updates: Option<u64>,
    /// Updates a second over the last line of the metrics.
    pub rate: Option<f64>,
    /// Seconds of training left at that rate.
    pub seconds_left: Option<f64>,
    /// The objective in the last line of the metrics.
    pub objective: Option<f64>,
    /// Seconds since the metrics last grew.
    pub seconds_since: Option<f64>,
    /// Why it failed, or who is at it.
    pub note: Option<String>,
}

/// The state of one run.
///
/// # Errors
/// Its folder belongs to another plan, or a file cannot be read.
pub fn status(element: &Element) -> Result<Status> {
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
    let updates = run.open_info().ok().and_then(|info| info.options.get("updates")?.as_u64());
    let update = metrics.last("update").map(|update| update as u64);
    let rate = metrics.last("updates_per_second");
    let left = updates.zip(update).map(|(all, made)| all.saturating_sub(made) as f64);
    let since = std::fs::metadata(run.metrics_path()).and_then(|file| file.modified()).ok();
    let since = since.map(|then| SystemTime::now().duration_since(then).unwrap_or(Duration::ZERO).as_secs_f64());
    Ok(Status {
        index: element.index,
        name: element.name.clone(),
        state,
        stages: (mark.as_ref().map_or(0, |mark| mark.finished), element.stages.len()),
        update,
        updates,
        rate,
        seconds_left: left.zip(rate).filter(|(_, rate)| *rate > 0.0).map(|(left, rate)| left / rate),
        objective: metrics.last("objective"),
        seconds_since: since,
        note: owner.or_else(|| mark.and_then(|mark| mark.error)),
    })
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
