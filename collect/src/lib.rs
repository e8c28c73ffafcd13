//! Collecting: MuJoCo tasks of the Distracting Control Suite, policies that act in them, distractors, pictures, and the recorder.
//!
//! An [`Environment`] is a task under a clock; a [`Policy`] chooses its actions; [`rollout`] makes a [`StateTrajectory`] of the two. A
//! [`distractors::DistractorTrajectory`] says what changes in the picture, a [`render::Renderer`] draws the two together, and
//! [`recorder::record`] writes episodes. A [`Trace`] is an episode in JSON, to compare simulations with.

pub mod bench;
pub mod care;
pub mod cli;
pub mod distractor_trace;
pub mod distractors;
mod environment;
mod error;
pub mod extend;
pub mod frames;
mod gaussian;
mod physics;
pub mod plan;
mod policies;
pub mod preview;
pub mod recorder;
pub mod redraw;
pub mod render;
pub mod replay;
mod rollout;
pub mod stored;
pub mod studio;
mod tasks;
mod trace;
pub mod verify;
pub mod videos;

pub use environment::{Environment, EnvironmentOptions, Start};
pub use error::{Error, Result};
pub use gaussian::standard_normal;
pub use physics::{ModelOverrides, Physics, Snapshot};
pub use policies::{Planner, PlannerSettings, Policy, PolicyMix, PolicySpec};
pub use rollout::{StateTrajectory, rollout};
pub use tasks::{EPISODE_CONTROL_STEPS, KNOWN_SLIDE, Sigmoid, Sinusoid, Task, Tolerance, known_reward, task_names};
pub use trace::{TRACE_FORMAT, Trace, TraceErrors};
