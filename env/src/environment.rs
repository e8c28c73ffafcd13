//! The clock over a task: episodes begin, actions become control steps, rewards are summed over the action repeat.
//!
//! In: a task's name, a start (drawn or given), actions. Out: observations and rewards. An episode's start is a value ([`Start`]), and every
//! episode goes through it, so that a recording's first row is enough to simulate the episode again.

use rand::RngCore;
use serde::{Deserialize, Serialize};
use vibes_data::{ActionSpec, ObservationPart, Quantity};

use crate::distractors::Scenery;
use crate::physics::{Physics, PhysicsSnapshot, Start};
use crate::tasks::{Actuation, EPISODE_CONTROL_STEPS, Loaded, PlannerSettings, Task, load, symmetric_tasks};
use crate::{Error, Result};

/// What a user may choose about an environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnvironmentOptions {
    /// Control steps an action is held; the task's own number when none is given.
    pub action_repeat: Option<u32>,
    /// One torque per joint instead of the swimmer's four-parameter wave; other tasks always take torques.
    pub raw_torques: bool,
}

/// A task under a clock.
#[derive(Debug)]
pub struct Environment {
    name: String,
    physics: Physics,
    task: Box<dyn Task>,
    actuation: Actuation,
    physics_steps: usize,
    action_repeat: u32,
    planner: PlannerSettings,
    scenery: Scenery,
    control: Vec<f64>,
    /// Where the swimmer's wave stands, radians; 0 for other tasks.
    phase: f64,
}

/// An episode in the middle, to be gone on with from there bit for bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    physics: PhysicsSnapshot,
    phase: f64,
}

impl Environment {
    /// Loads a task by name.
    pub fn new(task: &str, options: EnvironmentOptions) -> Result<Self> {
        let (loaded, action_repeat) = load(task)?;
        let actuation = if options.raw_torques { Actuation::Direct } else { loaded.actuation };
        let Loaded { name, physics, task, physics_steps, planner, scenery, .. } = loaded;
        let action_repeat = options.action_repeat.unwrap_or(action_repeat).max(1);
        let control = vec![0.0; physics.control().len()];
        Ok(Self { name, physics, task, actuation, physics_steps, action_repeat, planner, scenery, control, phase: 0.0 })
    }

    /// The task's one name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The simulation, as for drawing it.
    pub fn physics(&self) -> &Physics {
        &self.physics
    }

    /// The simulation, to be changed: by renderers, which restore stored states.
    pub fn physics_mut(&mut self) -> &mut Physics {
        &mut self.physics
    }

    /// The bounds of an action.
    pub fn action_spec(&self) -> ActionSpec {
        match self.actuation {
            Actuation::Sinusoid(_) => ActionSpec { min: vec![-1.0; 4], max: vec![1.0; 4] },
            Actuation::Direct => self.control_spec(),
        }
    }

    /// An action as it is executed and as a recording keeps it: within its bounds, where the actuators would cut it anyway, and in single precision, so that what is
    /// stored simulates again exactly.
    pub fn executable(&self, action: &[f64]) -> Vec<f64> {
        let ActionSpec { min, max } = self.action_spec();
        let within = |(at, &number): (usize, &f64)| match (min.get(at), max.get(at)) {
            (Some(&low), Some(&high)) => number.clamp(low, high),
            // A number too many is for the step to refuse.
            _ => number,
        };
        action.iter().enumerate().map(within).map(|number| f64::from(number as f32)).collect()
    }

    /// Whether an action is the parameters of a travelling wave, as the swimmer's are unless torques were asked for.
    pub fn acts_by_waves(&self) -> bool {
        matches!(self.actuation, Actuation::Sinusoid(_))
    }

    /// The bounds of the actuators' control.
    pub fn control_spec(&self) -> ActionSpec {
        let range = self.physics.model().actuator_ctrlrange();
        ActionSpec {
            min: range.iter().map(|[low, _]| *low).collect(),
            max: range.iter().map(|[_, high]| *high).collect(),
        }
    }

    /// The observation's parts, in `dm_control`'s order.
    pub fn observation_spec(&self) -> Vec<ObservationPart> {
        self.task.observation(&self.physics)
    }

    /// The task's numbers by name.
    pub fn quantities(&self) -> Vec<Quantity> {
        self.task.quantities(&self.physics)
    }

    /// Seconds of a control step.
    pub fn control_timestep(&self) -> f64 {
        self.physics.timestep() * self.physics_steps as f64
    }

    /// Control steps an action is held.
    pub fn action_repeat(&self) -> u32 {
        self.action_repeat
    }

    /// How the planner looks ahead on this task.
    pub fn planner_settings(&self) -> PlannerSettings {
        self.planner
    }

    /// What the distractors have to know of the task's scene.
    pub fn scenery(&self) -> Scenery {
        self.scenery
    }

    /// Agent steps of a whole episode: 1000 control steps, the last agent step included even when the repeat does not divide them.
    pub fn episode_steps(&self) -> u32 {
        EPISODE_CONTROL_STEPS.div_ceil(self.action_repeat)
    }

    /// Begins an episode at a drawn start, which is returned.
    pub fn reset(&mut self, rng: &mut impl RngCore) -> Result<Start> {
        let constants = self.task.constants();
        self.physics.set_overrides(&constants)?;
        self.physics.reset();
        let changed = self.task.start(&mut self.physics, rng)?;
        let start = Start {
            time: self.physics.time(),
            qpos: self.physics.qpos().to_vec(),
            qvel: self.physics.qvel().to_vec(),
            act: self.physics.data().act().to_vec(),
            model_overrides: changed,
        };
        self.reset_to(&start)?;
        Ok(start)
    }

    /// Begins an episode at a given start.
    pub fn reset_to(&mut self, start: &Start) -> Result<()> {
        let data = self.physics.data();
        self.check("qpos", &start.qpos, data.qpos().len())?;
        self.check("qvel", &start.qvel, data.qvel().len())?;
        self.check("act", &start.act, data.act().len())?;
        self.physics.set_overrides(&self.task.constants().with(&start.model_overrides))?;
        self.physics.reset();
        self.phase = 0.0;
        self.physics.set_state(&start.qpos, &start.qvel, &start.act, start.time);
        self.physics.forward_without_actuation();
        Ok(())
    }

    /// Turns a state about the vertical axis through the origin by `angle` radians; see [`Task::rotate`].
    ///
    /// # Errors
    /// [`Error::NoRotation`] for a task that is not the same afterwards.
    pub fn rotate(&self, state: &mut Start, angle: f64) -> Result<()> {
        let is_symmetric = self.task.rotate(state, angle);
        is_symmetric
            .then_some(())
            .ok_or_else(|| Error::NoRotation { task: self.name.clone(), known: symmetric_tasks().join(", ") })
    }

    /// One control step; returns its reward.
    pub fn control_step(&mut self, action: &[f64]) -> Result<f64> {
        self.check("an action", action, self.action_len())?;
        match &self.actuation {
            Actuation::Direct => self.control.copy_from_slice(action),
            Actuation::Sinusoid(wave) => self.phase = wave.torques(action, self.phase, &mut self.control),
        }
        if self.physics.step(&self.control, self.physics_steps) {
            return Ok(self.task.reward(&self.physics));
        }
        Err(Error::Unstable {
            task: self.name.clone(),
            seconds: self.physics.time(),
            warnings: self.physics.warnings(),
        })
    }

    /// One agent step: the action is held for the action repeat; returns the sum of the rewards.
    pub fn step(&mut self, action: &[f64]) -> Result<f64> {
        (0..self.action_repeat).map(|_| self.control_step(action)).sum()
    }

    /// Writes the present observation into `observation`.
    pub fn observe(&self, observation: &mut Vec<f64>) {
        observation.clear();
        self.task.observe(&self.physics, observation);
    }

    /// Saves the simulation in the middle of an episode; [`Self::restore`] goes on from there bit for bit.
    pub fn save(&self, snapshot: &mut Snapshot) {
        self.physics.save(&mut snapshot.physics);
        snapshot.phase = self.phase;
    }

    /// Goes back to a snapshot of the same episode (the model overrides are not part of it).
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.physics.restore(&snapshot.physics);
        self.phase = snapshot.phase;
    }

    /// Numbers in an action.
    pub fn action_len(&self) -> usize {
        match self.actuation {
            Actuation::Direct => self.control.len(),
            Actuation::Sinusoid(_) => 4,
        }
    }

    fn check(&self, what: &'static str, numbers: &[f64], expected: usize) -> Result<()> {
        if numbers.len() == expected {
            return Ok(());
        }
        Err(Error::Length { what, found: numbers.len(), expected, task: self.name.clone() })
    }
}
