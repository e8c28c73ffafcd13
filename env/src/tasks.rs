//! The registry of tasks, and what a task is: which model, how an episode starts, what is observed, what is rewarded.
//!
//! In: a name as in `reacher-easy`. Out: a [`Loaded`] task, which [`crate::Environment`] turns into a simulation with a clock.
//! One file a task, all of the same shape; a new task is a sibling file and a line in [`TASKS`]. Numbers and order of the observations follow
//! `dm_control` 1.0.50 (`dm_control/suite/*.py`).

mod ball_in_cup;
mod cartpole;
mod cheetah;
mod finger;
mod known_slide;
mod random_joints;
mod reacher;
mod sinusoid;
mod swimmer;
mod tolerance;
mod walker;

use std::fmt::Debug;

use rand::RngCore;
use vibes_data::ObservationPart;

pub use known_slide::known_reward;
pub use sinusoid::Sinusoid;
pub use tolerance::{Sigmoid, Tolerance};

use crate::physics::{ModelOverrides, Physics, Start};
use crate::{Error, Result};

/// Control steps in an episode, of every task.
pub const EPISODE_CONTROL_STEPS: u32 = 1000;

/// What is wanted of a simulation. Objects of the model are looked up once, when the task is loaded.
pub trait Task: Debug + Send + Sync {
    /// The names and lengths of the observation's parts, in `dm_control`'s order.
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart>;

    /// What the task changes in the model for every episode alike.
    fn constants(&self) -> ModelOverrides {
        ModelOverrides::default()
    }

    /// Draws an episode's start into the positions, velocities and model of a physics that has just been reset; returns what it wants changed
    /// in the model for this episode.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides>;

    /// Appends the observation of the present state.
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>);

    /// The reward for having come to the present state with the control just used, in `[0, 1]`.
    fn reward(&self, physics: &Physics) -> f64;

    /// Turns a state about the vertical axis through the origin by `angle` radians, where physics and reward are the same afterwards; false
    /// where the task has no such symmetry.
    fn rotate(&self, _: &mut Start, _angle: f64) -> bool {
        false
    }
}

/// How an agent's action becomes the control of the model's actuators.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Actuation {
    /// The action is the control.
    Direct,
    /// The action is the four parameters of a travelling wave of torques.
    Sinusoid(Sinusoid),
}

/// A task with its compiled model.
#[derive(Debug)]
pub(crate) struct Loaded {
    /// The registered name.
    pub name: String,
    /// The model.
    pub physics: Physics,
    /// What is wanted of it.
    pub task: Box<dyn Task>,
    /// What an action means.
    pub actuation: Actuation,
    /// Physics steps in a control step.
    pub physics_steps: usize,
    /// Control steps an action is held for, unless asked otherwise.
    pub action_repeat: u32,
}

type Loader = fn() -> Result<Loaded>;

/// The registered tasks, apart from the swimmers, of which there is one for every number of links.
const TASKS: [(&str, Loader); 6] = [
    ("ball_in_cup-catch", ball_in_cup::load),
    ("cartpole-swingup", cartpole::load),
    ("cheetah-run", cheetah::load),
    ("finger-spin", finger::load),
    ("reacher-easy", reacher::load),
    ("walker-walk", walker::load),
];

/// A task for tests of the alignment of `o_t`, `a_t`, `r_t`: its reward is a formula in state and action. Not in the listing, since it is not
/// for research.
pub const KNOWN_SLIDE: &str = "known-slide";

/// The names of the tasks, for listings; `swimmer-N` stands for every number of links from 3 on.
pub fn task_names() -> Vec<&'static str> {
    TASKS.iter().map(|(name, _)| *name).chain(["swimmer-N"]).collect()
}

/// Loads the task of that name.
pub(crate) fn load(name: &str) -> Result<Loaded> {
    if let Some((_, loader)) = TASKS.iter().find(|(known, _)| *known == name) {
        return loader();
    }
    if name == KNOWN_SLIDE {
        return known_slide::load();
    }
    let links = name.strip_prefix("swimmer-").map(|rest| rest.strip_prefix("swimmer").unwrap_or(rest));
    match links.map(str::parse) {
        Some(Ok(links)) if swimmer::LINKS.contains(&links) => swimmer::load(links),
        _ => Err(Error::UnknownTask {
            name: name.to_owned(),
            known: format!(
                "{} (N is the number of links, {} to {})",
                task_names().join(", "),
                swimmer::LINKS.start(),
                swimmer::LINKS.end()
            ),
        }),
    }
}

/// A part of an observation.
fn part(name: &str, len: usize) -> ObservationPart {
    ObservationPart { name: name.to_owned(), len }
}
