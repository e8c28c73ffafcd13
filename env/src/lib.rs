//! The world that agents live in: MuJoCo tasks of the Distracting Control Suite, policies that act in them, distractors and pictures.
//!
//! An [`Environment`] is a task under a clock; a [`Policy`] chooses its actions; [`rollout`] makes a [`StateTrajectory`] of the two. A
//! [`distractors::DistractorTrajectory`] says what changes in the picture, and a [`render::Renderer`] draws the two together.

pub mod distractors;
mod environment;
mod error;
mod gaussian;
mod physics;
mod policies;
pub mod render;
mod rollout;
mod tasks;
pub mod videos;

pub use environment::{Environment, EnvironmentOptions, Start};
pub use error::{Error, Result};
pub use gaussian::standard_normal;
pub use physics::{ModelOverrides, Physics, Snapshot};
pub use policies::{Planner, PlannerSettings, Policy, PolicyMix, PolicySpec};
pub use rollout::{StateTrajectory, rollout};
pub use tasks::{EPISODE_CONTROL_STEPS, KNOWN_SLIDE, Sigmoid, Sinusoid, Task, Tolerance, known_reward, task_names};
