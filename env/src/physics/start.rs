//! Where an episode starts, as a value: drawn by a task, kept in a recording, set again in a simulation.

use serde::{Deserialize, Serialize};

use super::ModelOverrides;

/// Where an episode starts: everything its physics depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Simulated seconds.
    pub time: f64,
    /// Generalised positions `[nq]`.
    pub qpos: Vec<f64>,
    /// Generalised velocities `[nv]`.
    pub qvel: Vec<f64>,
    /// Actuator activations `[na]`; no task here has any.
    pub act: Vec<f64>,
    /// What is changed in the model, by object name.
    pub model_overrides: ModelOverrides,
}
