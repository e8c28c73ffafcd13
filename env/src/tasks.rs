//! The registry of tasks, and what a task is: which model, how an episode starts, what is observed, what is rewarded.
//!
//! In: a name as in `reacher-easy`. Out: a [`Loaded`] task, which [`crate::Environment`] turns into a simulation with a clock.
//! One file a task, all of the same shape; a new task is a sibling file and a line in [`TASKS`]. What else depends on the task (its model, how its actions
//! are meant, how the planner looks ahead, where the camera may go, how opaque the ground is) its file says too. Numbers and order of the observations
//! follow `dm_control` 1.0.50 (`dm_control/suite/*.py`).

mod ball_in_cup;
mod cartpole;
mod cheetah;
mod finger;
mod known_slide;
mod planning;
mod random_joints;
mod reacher;
mod sinusoid;
mod swimmer;
mod tolerance;
mod walker;

use std::fmt::Debug;

use rand::RngCore;
use vibes_data::{About, Formula, ObservationPart, Quantity};

pub use known_slide::{KNOWN_SLIDE, known_reward};
pub use planning::PlannerSettings;
pub use sinusoid::Sinusoid;
pub use tolerance::{Sigmoid, Tolerance};

use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, Start};
use crate::{Error, Result};

/// Control steps in an episode, of every task.
pub const EPISODE_CONTROL_STEPS: u32 = 1000;

/// What is wanted of a simulation. Objects of the model are looked up once, when the task is loaded.
pub trait Task: Debug + Send + Sync {
    /// The names and lengths of the observation's parts, in `dm_control`'s order.
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart>;

    /// The task's numbers under names that a reader understands, as formulas of what a recording holds.
    fn quantities(&self, physics: &Physics) -> Vec<Quantity>;

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
    /// Its one name, also where it was asked for by another (`swimmer-swimmer6`).
    pub name: String,
    /// The model.
    pub physics: Physics,
    /// What is wanted of it.
    pub task: Box<dyn Task>,
    /// What an action means.
    pub actuation: Actuation,
    /// Physics steps in a control step.
    pub physics_steps: usize,
    /// How the planner looks ahead.
    pub planner: PlannerSettings,
    /// What the distractors have to know.
    pub scenery: Scenery,
}

/// A task in the registry: its own file says all there is to say of it.
#[derive(Clone, Copy, Debug)]
struct Registered {
    /// As in listings: the name, or a pattern such as `swimmer-N`.
    name: &'static str,
    /// What stands beside a pattern in listings; empty for a name.
    note: &'static str,
    /// Names to try the task with, from a small one for its laws to a large one for its rate card.
    examples: &'static [&'static str],
    /// Control steps an action is held for, unless asked otherwise.
    action_repeat: u32,
    /// Whether it is one of the tasks of the Distracting Control Suite, whose action repeat this then is.
    is_of_the_suite: bool,
    /// Whether its states can be turned about the vertical axis through the origin ([`Task::rotate`]).
    is_symmetric: bool,
    /// Loads the task if the name is one of its own.
    load: fn(&str) -> Option<Result<Loaded>>,
}

/// The registered tasks.
const TASKS: [Registered; 7] =
    [ball_in_cup::TASK, cartpole::TASK, cheetah::TASK, finger::TASK, reacher::TASK, walker::TASK, swimmer::TASK];

/// The names of the tasks, for listings; `swimmer-N` stands for every number of links that [`task_help`] names.
pub fn task_names() -> Vec<&'static str> {
    TASKS.iter().map(|task| task.name).collect()
}

/// The names of the tasks and what a pattern among them stands for, as one line of help.
pub fn task_help() -> String {
    let named = |task: &Registered| match task.note {
        "" => task.name.to_owned(),
        note => format!("{} ({note})", task.name),
    };
    TASKS.iter().map(named).collect::<Vec<_>>().join(", ")
}

/// A name of every task that can be loaded as it stands: a small one where a pattern has many.
pub fn example_tasks() -> Vec<&'static str> {
    TASKS.iter().filter_map(|task| task.examples.first().copied()).collect()
}

/// The same with a large one where a pattern has many: for rate cards.
pub fn large_example_tasks() -> Vec<&'static str> {
    TASKS.iter().filter_map(|task| task.examples.last().copied()).collect()
}

/// Every name that the tasks give as an example: for listings of tasks that can be loaded as they stand.
pub fn all_example_tasks() -> Vec<&'static str> {
    TASKS.iter().flat_map(|task| task.examples).copied().collect()
}

/// The tasks of the Distracting Control Suite, with the control steps for which it holds an action.
pub fn suite_tasks() -> Vec<(&'static str, u32)> {
    TASKS.iter().filter(|task| task.is_of_the_suite).map(|task| (task.name, task.action_repeat)).collect()
}

/// The tasks whose states can be turned about the vertical axis through the origin, physics and reward being the same afterwards.
pub fn symmetric_tasks() -> Vec<&'static str> {
    TASKS.iter().filter(|task| task.is_symmetric).map(|task| task.name).collect()
}

/// Loads the task of that name, and says for how many control steps its actions are held.
pub(crate) fn load(name: &str) -> Result<(Loaded, u32)> {
    let known = TASKS.iter().chain([&known_slide::TASK]);
    let mut loaded = known.filter_map(|task| Some((task.action_repeat, (task.load)(name)?)));
    match loaded.next() {
        Some((action_repeat, loaded)) => Ok((loaded?, action_repeat)),
        None => Err(Error::UnknownTask { name: name.to_owned(), known: task_help() }),
    }
}

/// A number that the task is about.
fn quantity(name: impl Into<String>, formula: Formula) -> Quantity {
    Quantity { name: name.into(), about: About::Task, formula }
}

/// The first numbers of the observation, by name.
fn observed<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<Quantity> {
    names.into_iter().enumerate().map(|(at, name)| quantity(name, Formula::Observation(at))).collect()
}

/// A part of an observation.
fn part(name: &str, len: usize) -> ObservationPart {
    ObservationPart { name: name.to_owned(), len }
}
