//! Traces: one episode's start, actions, observations and rewards at every control step, as JSON (`vibes-trace/1`), and their replay.
//!
//! In: a trace that someone else's simulation wrote. Out: the same start and actions through ours, as a trace again, and the largest difference
//! of each column.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::largest::largest;
use crate::{Error, Result};
use vibes_env::{EPISODE_CONTROL_STEPS, Environment, EnvironmentOptions, Start};

/// The name and version of the format.
pub const TRACE_FORMAT: &str = "vibes-trace/1";

/// An episode at control steps: `T` actions and rewards, `T + 1` observations and positions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// [`TRACE_FORMAT`].
    pub format: String,
    /// The task.
    pub task: String,
    /// The seed of whoever drew the start; for information.
    #[serde(default)]
    pub seed: u64,
    /// What simulated it.
    #[serde(default)]
    pub versions: BTreeMap<String, String>,
    /// Seconds of a control step.
    #[serde(default)]
    pub control_timestep: f64,
    /// Seconds of a physics step.
    #[serde(default)]
    pub physics_timestep: f64,
    /// Control steps in a whole episode.
    #[serde(default)]
    pub step_limit: f64,
    /// The action's lower bounds.
    #[serde(default)]
    pub action_min: Vec<f64>,
    /// The action's upper bounds.
    #[serde(default)]
    pub action_max: Vec<f64>,
    /// Where it starts: time, qpos, qvel, act, model overrides.
    #[serde(flatten)]
    pub start: Start,
    /// The observation's parts.
    #[serde(default)]
    pub observation_names: Vec<String>,
    /// `[T, action]`, one a control step.
    pub actions: Vec<Vec<f64>>,
    /// `[T]`.
    #[serde(default)]
    pub rewards: Vec<f64>,
    /// `[T + 1, observation]`.
    #[serde(default)]
    pub observations: Vec<Vec<f64>>,
    /// `[T + 1, nq]`.
    #[serde(default)]
    pub qpos_trace: Vec<Vec<f64>>,
}

/// The largest absolute difference of each column; none for a column the trace does not have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TraceErrors {
    /// Over all observations.
    pub observations: Option<f64>,
    /// Over all rewards.
    pub rewards: Option<f64>,
    /// Over all positions.
    pub qpos: Option<f64>,
}

impl TraceErrors {
    /// The largest of all.
    pub fn largest(&self) -> f64 {
        largest([self.observations, self.rewards, self.qpos].into_iter().flatten())
    }
}

impl Trace {
    /// Reads a trace.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
        let expected = format!("a trace is JSON of the format {TRACE_FORMAT}");
        let trace: Self =
            serde_json::from_str(&text).map_err(|error| Error::malformed(path, error.to_string(), &expected))?;
        if trace.format != TRACE_FORMAT {
            return Err(Error::malformed(path, format!("the format is {}", trace.format), expected));
        }
        trace.fault().map_or(Ok(()), |fact| {
            Err(Error::malformed(path, fact, "T actions go with T rewards and T + 1 observations"))
        })?;
        Ok(trace)
    }

    /// Says which column has the wrong number of rows, if any.
    fn fault(&self) -> Option<String> {
        let steps = self.actions.len();
        let rows = [
            ("rewards", self.rewards.len(), steps),
            ("observations", self.observations.len(), steps + 1),
            ("qpos_trace", self.qpos_trace.len(), steps + 1),
        ];
        let wrong = rows.iter().find(|(_, found, expected)| *found != 0 && found != expected);
        wrong.map(|(name, found, _)| format!("{steps} actions and {found} {name}"))
    }

    /// Simulates the trace's actions from its start; the result has our own observations, rewards and positions.
    pub fn replay(&self) -> Result<Self> {
        let options = EnvironmentOptions { action_repeat: Some(1), raw_torques: true };
        let mut environment = Environment::new(&self.task, options)?;
        environment.reset_to(&self.start)?;
        let mut got = self.header(&environment);
        got.push_row(&environment);
        for (step, action) in self.actions.iter().enumerate() {
            let reward = environment.step(action).map_err(|error| Error::from(error).at_step(step))?;
            got.rewards.push(reward);
            got.push_row(&environment);
        }
        Ok(got)
    }

    /// The trace as it is before the first row.
    fn header(&self, environment: &Environment) -> Self {
        let bounds = environment.control_spec();
        Self {
            format: TRACE_FORMAT.to_owned(),
            versions: [("mujoco".to_owned(), mujoco_rs::mujoco_version().to_owned())].into(),
            control_timestep: environment.control_timestep(),
            physics_timestep: environment.physics().timestep(),
            step_limit: f64::from(EPISODE_CONTROL_STEPS),
            action_min: bounds.min,
            action_max: bounds.max,
            observation_names: environment.observation_spec().into_iter().map(|part| part.name).collect(),
            rewards: Vec::new(),
            observations: Vec::new(),
            qpos_trace: Vec::new(),
            ..self.clone()
        }
    }

    /// The first row of a trace of a simulation that has just been reset to `start`.
    pub(crate) fn begin(environment: &Environment, start: Start, seed: u64) -> Self {
        let task = environment.name().to_owned();
        let empty = Self { task, seed, start, ..Self::default() };
        let mut trace = empty.header(environment);
        trace.push_row(environment);
        trace
    }

    /// Takes one control step and adds it as a row, with the control that the actuators got; returns its reward.
    pub(crate) fn control_step(&mut self, environment: &mut Environment, action: &[f64]) -> Result<f64> {
        let step = self.actions.len();
        let reward = environment.control_step(action).map_err(|error| Error::from(error).at_step(step))?;
        self.actions.push(environment.physics().control().to_vec());
        self.rewards.push(reward);
        self.push_row(environment);
        Ok(reward)
    }

    fn push_row(&mut self, environment: &Environment) {
        let mut observation = Vec::new();
        environment.observe(&mut observation);
        self.observations.push(observation);
        self.qpos_trace.push(environment.physics().qpos().to_vec());
    }

    /// The largest differences between this trace and another of the same actions.
    pub fn compare(&self, other: &Self) -> TraceErrors {
        TraceErrors {
            observations: largest_difference(&self.observations, &other.observations),
            rewards: largest_difference(&[self.rewards.as_slice()], &[other.rewards.as_slice()]),
            qpos: largest_difference(&self.qpos_trace, &other.qpos_trace),
        }
    }

    /// Writes the trace.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string(self)
            .map_err(|error| Error::malformed(path, error.to_string(), "numbers are finite"))?;
        std::fs::write(path, text).map_err(Error::io("write", path))
    }
}

/// The largest absolute difference of two tables; infinite where their shapes differ or a number is not finite, none when the first is empty.
fn largest_difference<A: AsRef<[f64]>, B: AsRef<[f64]>>(expected: &[A], got: &[B]) -> Option<f64> {
    if expected.iter().all(|row| row.as_ref().is_empty()) {
        return None;
    }
    if expected.len() != got.len() {
        return Some(f64::INFINITY);
    }
    let rows = expected.iter().zip(got).map(|(expected, got)| {
        let (expected, got) = (expected.as_ref(), got.as_ref());
        if expected.len() != got.len() {
            return f64::INFINITY;
        }
        largest(expected.iter().zip(got).map(|(expected, got)| expected - got))
    });
    Some(largest(rows))
}
