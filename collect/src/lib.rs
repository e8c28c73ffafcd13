//! Collecting: MuJoCo tasks of the Distracting Control Suite, policies that act in them, and the trajectories they make.
//!
//! An [`Environment`] is a task under a clock; a [`Policy`] chooses its actions; [`rollout`] makes a [`StateTrajectory`] of the two. A [`Trace`]
//! is an episode in JSON, to compare simulations with.
//!
//! [`distractors`] walk at random, apart from the physics; [`render`] lays them over states and draws; [`videos`] are what the background shows.

pub mod distractor_trace;
pub mod distractors;
mod environment;
mod error;
mod gaussian;
mod physics;
mod policies;
pub mod render;
mod rollout;
mod spec;
mod tasks;
mod trace;
pub mod videos;

pub use environment::{Environment, EnvironmentOptions, Start};
pub use error::{Error, Result};
pub use gaussian::standard_normal;
pub use physics::{ModelOverrides, Physics, Snapshot};
pub use policies::{Planner, PlannerSettings, Policy, PolicyMix, PolicySpec};
pub use rollout::{StateTrajectory, rollout};
pub use spec::{ActionSpec, ObservationPart};
pub use tasks::{EPISODE_CONTROL_STEPS, KNOWN_SLIDE, Sigmoid, Sinusoid, Task, Tolerance, known_reward, task_names};
pub use trace::{TRACE_FORMAT, Trace, TraceErrors};
