//! The actions of a file, one row an agent step, as they were recorded or written by hand.

use std::path::{Path, PathBuf};

use rand::RngCore;
use serde::Deserialize;

use super::{Policy, Sight};
use crate::{Error, Result, Start};

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
    ///
    /// # Errors
    /// When the file cannot be read or holds no rows of actions.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
        let expected = "actions are a JSON list of rows of numbers, or an object with such a list as its actions";
        let file: File =
            serde_json::from_str(&text).map_err(|error| Error::malformed(path, error.to_string(), expected))?;
        let (File::Rows(rows) | File::Trace { actions: rows }) = file;
        Ok(Self { path: path.to_owned(), rows, next: 0 })
    }
}

impl Policy for Replay {
    /// Back to the first row.
    fn begin(&mut self, _: &Start) -> Result<()> {
        self.next = 0;
        Ok(())
    }

    /// The next row.
    fn act(&mut self, sight: &Sight<'_>, _: &mut dyn RngCore) -> Result<Vec<f64>> {
        let environment = sight.environment;
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
