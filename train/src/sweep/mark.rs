//! How far one run of a sweep is: `sweep.json` in its folder. In: an element and something that carries out a command line. Out: the element done,
//! or what is missing.

mod differences;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use vibes_data::{FolderLock, write_atomically};

use super::outputs::{is_free, make_room};
use super::{Element, line};
use crate::error::{Result, TrainError, io, malformed};

/// The format's name.
const FORMAT: &str = "vibes-sweep/1";

/// How long to wait for a recording that another run of the sweep is making.
const WAIT: Duration = Duration::from_millis(500);

/// What `sweep.json` holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    format: String,
    /// The element's settings.
    pub settings: BTreeMap<String, String>,
    /// The command lines, the run's own folder written as `{run}` so that the sweep can be moved.
    pub stages: Vec<Vec<String>>,
    /// Stages that are done.
    pub finished: usize,
    /// Why the stage after them failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<String>,
    /// Why that stage has to wait, while it does.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub waiting: Option<String>,
    /// Places below the run's folder that the stage at hand fills and where nothing was before: what is there now is its own work.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    makes: Vec<String>,
}

/// How a stage ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StageEnd {
    /// Done.
    Done,
    /// The same command, later: somebody else is at it, as is said here, or it was stopped.
    Again(Option<String>),
}

impl Mark {
    /// The mark of an element that nothing was done of.
    fn of(element: &Element) -> Self {
        let run = element.folder.to_string_lossy();
        let portable = |words: &Vec<String>| words.iter().map(|word| word.replace(run.as_ref(), "{run}")).collect();
        Self {
            format: FORMAT.to_owned(),
            settings: element.settings.clone(),
            stages: element.stages.iter().map(portable).collect(),
            finished: 0,
            error: None,
            waiting: None,
            makes: Vec::new(),
        }
    }

    /// The mark in the element's folder, if one is there.
    ///
    /// # Errors
    /// It is damaged, or of another plan: the keys that differ are named.
    pub fn found(element: &Element) -> Result<Option<Self>> {
        let path = path(&element.folder);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io("read", &path)(error)),
        };
        let found: Self = serde_json::from_str(&text)
            .map_err(|error| malformed(&path, error, "a sweep.json as `vibes-train sweep` writes it"))?;
        let differences = found.differences(&Self::of(element));
        if differences.is_empty() {
            return Ok(Some(found));
        }
        Err(TrainError::OtherSweep { differences: differences.join(", "), path: element.folder.clone() })
    }

    /// Whether every stage is done.
    pub fn is_done(&self) -> bool {
        self.finished >= self.stages.len()
    }

    /// Clears what an earlier attempt at the stage at hand has made, and notes what this one will make before it is there: after a kill nobody else
    /// could tell it from what the stage has found.
    fn begin(&mut self, words: &[String], element: &Element) -> Result<()> {
        let makes = make_room(words, &element.folder, &self.makes)?;
        if self.makes == makes {
            return Ok(());
        }
        self.makes = makes;
        self.write(element)
    }

    /// Notes why the stage at hand failed; of what it was to make only what is there is its work.
    fn fail(&mut self, error: String, element: &Element) -> Result<()> {
        self.makes.retain(|place| !is_free(&element.folder.join(place)));
        (self.error, self.waiting) = (Some(error), None);
        self.write(element)
    }

    /// Notes why the stage at hand waits, where that is another reason than before.
    fn wait(&mut self, reason: Option<String>, element: &Element) -> Result<()> {
        if self.waiting == reason {
            return Ok(());
        }
        self.waiting = reason;
        self.write(element)
    }

    fn write(&self, element: &Element) -> Result<()> {
        let file = path(&element.folder);
        std::fs::create_dir_all(&element.folder).map_err(io("create", &element.folder))?;
        let text = serde_json::to_string_pretty(self).map_err(|error| malformed(&file, error, "texts"))?;
        Ok(write_atomically(&file, (text + "\n").as_bytes())?)
    }
}

fn path(folder: &Path) -> PathBuf {
    folder.join("sweep.json")
}

/// Does what is not done of an element yet, by `carry_out` for one command line after the other; none if all was done before.
///
/// # Errors
/// [`TrainError::OtherSweep`] for a folder of another plan, the owner of a folder that is being written, and what `carry_out` fails of, which is
/// also written into the mark.
pub fn run_element<E: From<TrainError> + std::fmt::Display>(
    element: &Element,
    stop: &AtomicBool,
    carry_out: &mut dyn FnMut(&[String]) -> std::result::Result<StageEnd, E>,
) -> std::result::Result<Option<StageEnd>, E> {
    let _lock = FolderLock::acquire_beside(&element.folder).map_err(TrainError::from)?;
    let mut mark = Mark::found(element)?.unwrap_or_else(|| Mark::of(element));
    if mark.is_done() {
        return Ok(None);
    }
    (mark.error, mark.waiting) = (None, None);
    mark.write(element)?;
    while let Some(words) = element.stages.get(mark.finished) {
        if stop.load(Ordering::Relaxed) {
            mark.wait(None, element)?;
            return Ok(Some(StageEnd::Again(None)));
        }
        mark.begin(words, element)?;
        match carry_out(words) {
            Ok(StageEnd::Again(reason)) => {
                mark.wait(reason, element)?;
                std::thread::sleep(WAIT);
                continue;
            }
            Ok(StageEnd::Done) => {
                (mark.finished, mark.waiting, mark.makes) = (mark.finished + 1, None, Vec::new());
            }
            Err(error) => {
                mark.fail(format!("{error:#}: {}", line(words)), element)?;
                return Err(error);
            }
        }
        mark.write(element)?;
    }
    Ok(Some(StageEnd::Done))
}

#[cfg(test)]
#[path = "mark/tests.rs"]
mod tests;
