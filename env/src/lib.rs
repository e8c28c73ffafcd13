//! The world that agents live in: MuJoCo tasks of the Distracting Control Suite, policies that act in them, distractors and pictures.
//!
//! An [`Environment`] is a task under a clock. A [`distractors::DistractorWalk`] says what changes in the picture, a [`render::Renderer`] draws
//! the two together, and [`Eyes`] put all three under one clock: reset, step, and a row's picture only when it is asked for. A [`Policy`] chooses
//! actions from what it may see; [`rollout()`] lets it act through an episode and gives a [`StateTrajectory`].

pub mod distractors;
mod environment;
mod error;
mod eyes;
mod gaussian;
pub mod names;
mod physics;
mod policies;
pub mod render;
mod rollout;
mod seeds;
mod tasks;
pub mod videos;

/// The versions of the simulator and of the models in this build: the first is the library's own answer, the second that of the wheel that set-up fetched.
pub fn versions() -> [(&'static str, &'static str); 2] {
    [("mujoco", mujoco_rs::mujoco_version()), ("dm_control models", env!("VIBES_SUITE_VERSION"))]
}

pub use environment::{Environment, EnvironmentOptions};
pub use error::{Error, Result};
pub use eyes::Eyes;
pub use gaussian::standard_normal;
pub use physics::{ModelOverrides, Physics, Snapshot, Start};
pub use policies::{Planner, Policy, PolicyMix, PolicySpec, Random, Replay, Sight};
pub use rollout::{EpisodeSeeds, StateTrajectory, rollout};
pub use seeds::{ChosenSeeds, distractor_seed, state_seed};
pub use tasks::{
    EPISODE_CONTROL_STEPS, KNOWN_SLIDE, PlannerSettings, Sigmoid, Sinusoid, Task, Tolerance, example_tasks,
    known_reward, large_example_tasks, task_help, task_names,
};
