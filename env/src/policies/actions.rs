//! The actions of a file, one row an agent step, as they were recorded or written by hand.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{Environment, Error, Result};

/// Rows of actions, and which is next.
#[derive(Debug)]
pub struct Replay {
    path: PathBuf,
    rows: Vec<Vec<f64>>,
    next: usize,
}

/// A bare list of rows, or anything with a list of `actions`, such as a trace.
#[derive(Deserialize)]
#[serde(untagged)]
enum File {
    Rows(Vec<Vec<f64>>),
    Trace { actions: Vec<Vec<f64>> },
}

impl Replay {
    /// Reads the rows of a file.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
        let expected = "actions are a JSON list of rows of numbers, or an object with such a list as its actions";
        let file: File =
            serde_json::from_str(&text).map_err(|error| Error::malformed(path, error.to_string(), expected))?;
        let (File::Rows(rows) | File::Trace { actions: rows }) = file;
        Ok(Self { path: path.to_owned(), rows, next: 0 })
    }

    /// Back to the first row.
    pub(super) fn begin(&mut self) {
        self.next = 0;
    }

    /// The next row.
    pub(super) fn act(&mut self, environment: &Environment) -> Result<Vec<f64>> {
        let Some(row) = self.rows.get(self.next) else {
            let fact = format!("there are {} rows of actions", self.rows.len());
            let expected = format!(
                "an episode of {} needs {}, or ask for fewer steps",
                environment.name(),
                environment.episode_steps()
            );
            return Err(Error::malformed(&self.path, fact, expected));
        };
        if row.len() != environment.action_len() {
            let fact = format!("row {} has {} numbers", self.next, row.len());
            return Err(Error::malformed(
                &self.path,
                fact,
                format!("an action of {} has {}", environment.name(), environment.action_len()),
            ));
        }
        self.next += 1;
        Ok(row.clone())
    }
}
