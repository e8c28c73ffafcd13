//! Collecting: MuJoCo tasks of the Distracting Control Suite, policies that act in them, and the trajectories they make.
//!
//! An [`Environment`] is a task under a clock; a [`Policy`] chooses its actions; [`rollout`] makes a [`StateTrajectory`] of the two. A [`Trace`]
//! is an episode in JSON, to compare simulations with.

mod environment;
mod error;
mod gaussian;
mod physics;
mod policies;
mod rollout;
mod spec;
mod tasks;
mod trace;

pub use environment::{Environment, EnvironmentOptions, Start};
pub use error::{Error, Result};
pub use gaussian::standard_normal;
pub use physics::{ModelOverrides, Physics, Snapshot};
pub use policies::{Planner, PlannerSettings, Policy, PolicyMix, PolicySpec};
pub use rollout::{StateTrajectory, rollout};
pub use spec::{ActionSpec, ObservationPart};
pub use tasks::{EPISODE_CONTROL_STEPS, KNOWN_SLIDE, Sigmoid, Sinusoid, Task, Tolerance, known_reward, task_names};
pub use trace::{TRACE_FORMAT, Trace, TraceErrors};
