//! The actions of a file, one row an agent step, as they were recorded or written by hand. A trace (`vibes-trace/1`) has one row a control step, of what every
//! actuator is given, and is played only where that is the same.

use std::path::{Path, PathBuf};

use rand::RngCore;
use serde_json::Value;

use super::{Policy, Sight};
use crate::{Environment, EnvironmentOptions, Error, Result, Start};

/// The format of a trace.
const TRACE: &str = "vibes-trace/1";

/// Rows of actions, and which is next.
#[derive(Debug)]
pub struct Replay {
    path: PathBuf,
    rows: Vec<Vec<f64>>,
    next: usize,
    /// The task of a trace; none for a list of rows.
    traced: Option<String>,
}

impl Replay {
    /// Reads the rows of a file.
    ///
    /// # Errors
    /// When the file cannot be read or holds no rows of actions.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
        let expected = "actions are a JSON list of rows of numbers, or an object with such a list as its actions";
        let wrong = |fact: String| Error::malformed(path, fact, expected);
        let file: Value = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        let rows = file.as_array().or_else(|| file.get("actions").and_then(Value::as_array));
        let rows = rows.ok_or_else(|| wrong("neither a list nor an object with one".to_owned()))?;
        let rows = rows.iter().enumerate().map(|(at, row)| numbers(at, row).map_err(wrong)).collect::<Result<_>>()?;
        let is_trace = file.get("format").and_then(Value::as_str) == Some(TRACE);
        let task = file.get("task").and_then(Value::as_str);
        let traced = is_trace.then(|| task.map(str::to_owned).ok_or_else(|| wrong("a trace of no task".to_owned())));
        Ok(Self { path: path.to_owned(), rows, next: 0, traced: traced.transpose()? })
    }

    /// That there are enough rows for an episode of so many steps, that every one of them is an action of this environment, and that a trace is of it.
    ///
    /// # Errors
    /// There are too few, one is of another length, or the trace is of another task or clock.
    pub fn check(&self, steps: u32, environment: &Environment) -> Result<()> {
        self.fits(environment)?;
        let action_len = environment.action_len();
        if self.rows.len() < steps as usize {
            let fact = format!("there are {} rows of actions", self.rows.len());
            let expected = format!("an episode of {steps} steps needs as many; --steps asks for fewer");
            return Err(Error::malformed(&self.path, fact, expected));
        }
        match self.rows.iter().position(|row| row.len() != action_len) {
            Some(at) => Err(self.of_another_length(at, action_len)),
            None => Ok(()),
        }
    }

    /// That a trace's rows mean here what they meant where they were recorded.
    fn fits(&self, environment: &Environment) -> Result<()> {
        let Some(task) = &self.traced else { return Ok(()) };
        let refused = |fact: String, expected: &str| Err(Error::malformed(&self.path, fact, expected));
        if !is_task(environment, task) {
            return refused(format!("a trace of {task}"), &format!("right is one of {}", environment.name()));
        }
        if environment.action_repeat() != 1 {
            let fact = format!(
                "a trace has a row a control step, and here an action is held for {}",
                environment.action_repeat()
            );
            return refused(fact, "--action-repeat 1 plays it as it was");
        }
        if environment.acts_by_waves() {
            let fact = "a trace has a torque a joint, and here an action is the four parameters of a wave";
            return refused(fact.to_owned(), "--raw-torques plays it as it was");
        }
        Ok(())
    }

    fn of_another_length(&self, at: usize, action_len: usize) -> Error {
        let fact = format!("row {at} has {} numbers", self.rows[at].len());
        Error::malformed(&self.path, fact, format!("an action of the task has {action_len}"))
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
        if self.next == 0 {
            self.fits(environment)?;
        }
        let Some(row) = self.rows.get(self.next) else {
            let fact = format!("there are {} rows of actions", self.rows.len());
            return Err(Error::malformed(&self.path, fact, "one for every step of the episode"));
        };
        if row.len() != environment.action_len() {
            return Err(self.of_another_length(self.next, environment.action_len()));
        }
        self.next += 1;
        Ok(row.clone())
    }
}

/// Whether the environment is of the task of this name, which may have others.
fn is_task(environment: &Environment, name: &str) -> bool {
    let named = || Environment::new(name, EnvironmentOptions::default());
    environment.name() == name || named().is_ok_and(|named| named.name() == environment.name())
}

/// The numbers of a row, or what is wrong with it.
fn numbers(at: usize, row: &Value) -> std::result::Result<Vec<f64>, String> {
    let numbers = row.as_array().ok_or_else(|| format!("row {at} is {row}"))?;
    let number = |number: &Value| number.as_f64().ok_or_else(|| format!("row {at} has {number} among its numbers"));
    numbers.iter().map(number).collect()
}
