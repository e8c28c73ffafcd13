//! Simulates a recorded episode again and compares it row by row.
//!
//! In: a recording and the number of an episode. Out: the largest difference of every stored column, and the episode as a [`Trace`] of control steps
//! with our own numbers. Observations and rewards are compared as a recording keeps them, in single precision.

use serde::Serialize;
use vibes_data::{EpisodeView, Manifest, Recording};

use crate::care::merge::merged_parts;
use crate::largest::largest;
use crate::stored::{start_of, takes_torques};
use crate::{Error, Result, Trace};
use vibes_env::{Environment, EnvironmentOptions};

/// The largest absolute difference of each column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EpisodeErrors {
    /// Of the positions, in double precision.
    pub qpos: f64,
    /// Of the velocities, in double precision.
    pub qvel: f64,
    /// Of the observations, in single precision.
    pub observations: f64,
    /// Of the rewards, in single precision.
    pub rewards: f64,
}

impl EpisodeErrors {
    /// The largest of all; infinite when a number is not finite.
    pub fn largest(&self) -> f64 {
        largest([self.qpos, self.qvel, self.observations, self.rewards])
    }

    /// Compares what an environment is at now with a stored row.
    pub(crate) fn compare_row(&mut self, environment: &Environment, view: &EpisodeView, row: usize) {
        let physics = environment.physics();
        let pairs = |stored: &[f64], again: &[f64], largest: &mut f64| {
            stored.iter().zip(again).for_each(|(&stored, &again)| larger(largest, stored, again));
        };
        pairs(view.qpos(row), physics.qpos(), &mut self.qpos);
        pairs(view.qvel(row), physics.qvel(), &mut self.qvel);
        let mut observation = Vec::new();
        environment.observe(&mut observation);
        for (&stored, again) in view.observation(row).iter().zip(observation) {
            larger(&mut self.observations, f64::from(stored), f64::from(again as f32));
        }
    }

    /// Compares what an agent step earned with what is stored of it.
    pub(crate) fn compare_reward(&mut self, view: &EpisodeView, step: usize, reward: f64) {
        larger(&mut self.rewards, f64::from(view.reward(step)), f64::from(reward as f32));
    }
}

/// An episode that was simulated again.
#[derive(Clone, Debug)]
pub struct ReplayedEpisode {
    /// How far the recording is from it.
    pub errors: EpisodeErrors,
    /// It, at control steps: the actions are those of the actuators.
    pub trace: Trace,
    /// Positions at every row of the recording.
    pub positions: Vec<Vec<f64>>,
}

/// The environment of a recording's episode. Whether a swimmer's action is torques or a wave, the options say; where they do not, the action's length has to, which
/// is the same for both with five links.
///
/// # Errors
/// For a task that is not known.
pub fn environment_of(recording: &Recording, index: u32) -> Result<Environment> {
    let spec = &recording.manifest().spec;
    let action_repeat = Some(spec.action_repeat);
    let made = |raw_torques| {
        let made = Environment::new(&spec.task, EnvironmentOptions { action_repeat, raw_torques });
        made.map_err(|error| Error::from(error).in_file(recording.path()))
    };
    if let Some(raw_torques) = torques_of(recording.manifest(), index) {
        return made(raw_torques);
    }
    let environment = made(false)?;
    let fits = environment.action_len() == spec.action_len();
    Ok(if fits { environment } else { made(true)? })
}

/// What the options of an episode say of its actions: those of the part that it came from, where the recording was merged.
fn torques_of(manifest: &Manifest, index: u32) -> Option<bool> {
    match merged_parts(manifest) {
        Some(parts) => takes_torques(&parts.iter().find(|part| part.holds(index))?.options),
        None => takes_torques(&manifest.options),
    }
}

/// Simulates an episode again from its first row and its actions.
///
/// # Errors
/// When the episode is not there or damaged, its task is unknown, or the simulation becomes unstable.
pub fn replay_episode(recording: &Recording, index: u32) -> Result<ReplayedEpisode> {
    let view = recording.episode(index)?;
    let entry = &recording.episodes()[recording.episodes().partition_point(|entry| entry.index < index)];
    let mut environment = environment_of(recording, index)?;
    let start = start_of(recording.path(), entry, &view)?;
    environment.reset_to(&start)?;
    let mut trace = Trace::begin(&environment, start, entry.seed);
    let mut errors = EpisodeErrors::default();
    let mut positions = Vec::new();
    errors.compare_row(&environment, &view, 0);
    positions.push(environment.physics().qpos().to_vec());
    for step in 0..view.steps() {
        let action: Vec<f64> = view.action(step).iter().map(|&number| f64::from(number)).collect();
        let mut reward = 0.0;
        for _ in 0..environment.action_repeat() {
            reward += trace.control_step(&mut environment, &action)?;
        }
        errors.compare_reward(&view, step, reward);
        errors.compare_row(&environment, &view, step + 1);
        positions.push(environment.physics().qpos().to_vec());
    }
    Ok(ReplayedEpisode { errors, trace, positions })
}

/// Keeps the largest difference.
fn larger(kept: &mut f64, stored: f64, again: f64) {
    *kept = largest([*kept, stored - again]);
}
