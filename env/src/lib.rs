//! The world that agents live in: MuJoCo tasks of the Distracting Control Suite, policies that act in them, distractors and pictures.
//!
//! An [`Environment`] is a task under a clock. A [`distractors::DistractorWalk`] says what changes in the picture, a [`render::Renderer`] draws
//! the two together, and [`Eyes`] put all three under one clock: reset, step, and a row's picture only when it is asked for. A [`Policy`] chooses
//! actions from what it may see; [`rollout()`] lets it act through an episode and gives a [`StateTrajectory`], [`rollout_frames`] the same with its pictures.
//! A [`Heading`] is what a recording says of the world it was made in.

pub mod distractors;
mod environment;
mod error;
mod eyes;
mod gaussian;
mod heading;
pub mod names;
mod physics;
mod policies;
pub mod render;
mod rollout;
mod seeds;
mod tasks;
pub mod videos;

pub use environment::{Environment, EnvironmentOptions, Snapshot};
pub use error::{Error, Result};
pub use eyes::Eyes;
pub use gaussian::standard_normal;
pub use heading::Heading;
pub use physics::{ModelOverrides, Physics, PhysicsSnapshot, Start};
pub use policies::{
    Chosen, HeldRandom, Planner, Policy, PolicyMix, PolicySpec, Random, Replay, Sight, SingleRandom, Trained,
};
pub use rollout::{EpisodeSeeds, Playing, StateTrajectory, rollout, rollout_frames};
pub use seeds::{ChosenSeeds, distractor_seed, state_seed};
pub use tasks::{
    EPISODE_CONTROL_STEPS, KNOWN_SLIDE, PlannerSettings, Sigmoid, Sinusoid, Task, Tolerance, all_example_tasks,
    example_tasks, known_reward, large_example_tasks, suite_tasks, symmetric_tasks, task_help, task_names,
};
