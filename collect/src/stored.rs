//! Recorded episodes, taken up again: what a recording keeps of an episode is enough to draw it anew and to go on from it.
//!
//! In: a recording. Out: its options, and an episode's states and distractors as what they were before they were drawn. Single precision on disk
//! is where both came from ([`vibes_env::rollout`] executes what is stored), so that nothing is lost on the way.

use std::path::Path;

use serde_json::Value;
use vibes_data::{EpisodeEntry, EpisodeInfo, EpisodeView, Manifest, Recording, sha256_hex};

use crate::keys::{MERGED, SUBSET};
use crate::paths::rebase;
use crate::plan::RecordOptions;
use crate::{Error, Result};
use vibes_env::distractors::DistractorTrajectory;
use vibes_env::{Environment, ModelOverrides, Start, StateTrajectory};

/// The options a recording was made with.
///
/// # Errors
/// [`Error::NotAsPlanned`] when no single command of ours made it, as of one that was merged or imported; [`Error::Malformed`] when they are not this program's, or
/// hold a number that it does not take.
pub fn options_of(recording: &Recording) -> Result<RecordOptions> {
    if let Some(fact) = origin(recording.manifest()) {
        return Err(Error::NotAsPlanned { fact: fact.to_owned(), path: recording.path().into() });
    }
    let options = read_options(&recording.manifest().options, recording.path()).map_err(|error| {
        let expected = "the manifest holds the options of a recording that vibes-collect made";
        Error::malformed(recording.path(), format!("its options cannot be read ({error})"), expected)
    })?;
    options.check(recording.path())?;
    Ok(options)
}

/// Where a recording comes from that has no options of one command.
fn origin(manifest: &Manifest) -> Option<&'static str> {
    let has = |key: &str| manifest.options.get(key).is_some();
    if has(MERGED) {
        return Some("it was merged of several recordings, which can be drawn anew and extended by themselves");
    }
    if manifest.is_imported() {
        return Some("it was imported from another program's dataset");
    }
    has("recorded_by").then_some("it was recorded from Python, with a spec of its own")
}

/// Whether an action is one torque a joint, where the options of a recording, or of a part that it was merged of, say so.
pub(crate) fn takes_torques(options: &Value) -> Option<bool> {
    options.get("raw_torques").and_then(Value::as_bool)
}

/// The options of a recording, or of a part that it was merged of, with paths as they are found from here. What their numbers are is for [`RecordOptions::check`] to say.
pub(crate) fn read_options(options: &Value, recording: &Path) -> serde_json::Result<RecordOptions> {
    let mut options = options.clone();
    rebase(&mut options, Some(recording), None);
    serde_json::from_value(options)
}

/// Whether MCAP logs lie beside the tables; yes when nothing is there yet.
pub fn has_logs(recording: &Recording) -> bool {
    let episodes = recording.episodes();
    episodes.is_empty() || episodes.iter().any(|entry| entry.mcap.is_some())
}

/// Whether an episode's table is what was written.
pub fn is_intact(recording: &Recording, entry: &EpisodeEntry) -> bool {
    std::fs::read(recording.path().join(&entry.arrow.path)).is_ok_and(|bytes| sha256_hex(&bytes) == entry.arrow.sha256)
}

/// A state trajectory and how it came about.
#[derive(Clone, Debug)]
pub struct Acted {
    /// The states, actions and rewards.
    pub trajectory: StateTrajectory,
    /// What the manifest says of them.
    pub info: EpisodeInfo,
    /// The distractor trajectory that the policy saw while it acted, of a policy that sees pictures.
    pub acting_distractor: Option<u32>,
}

/// What the manifest says of an episode beside its columns.
pub fn info_of(entry: &EpisodeEntry) -> EpisodeInfo {
    EpisodeInfo { policy: entry.policy.clone(), seed: entry.seed, model_overrides: entry.model_overrides.clone() }
}

/// Where an episode starts.
///
/// # Errors
/// [`Error::Malformed`] for model overrides that cannot be read.
pub fn start_of(recording: &Path, entry: &EpisodeEntry, view: &EpisodeView) -> Result<Start> {
    let overrides = match &entry.model_overrides {
        Value::Null => Ok(ModelOverrides::default()),
        given => serde_json::from_value(given.clone()),
    };
    let model_overrides = overrides.map_err(|error| {
        let fact = format!("episode {}: its model overrides cannot be read ({error})", entry.index);
        Error::malformed(recording, fact, "they name fields, objects and numbers")
    })?;
    Ok(Start { qpos: view.qpos(0).to_vec(), qvel: view.qvel(0).to_vec(), model_overrides, ..Start::default() })
}

/// An episode's states.
///
/// # Errors
/// As [`start_of`].
pub fn states_of(recording: &Path, entry: &EpisodeEntry, view: &EpisodeView) -> Result<StateTrajectory> {
    let wide = |numbers: &[f32]| -> Vec<f64> { numbers.iter().map(|&number| f64::from(number)).collect() };
    Ok(StateTrajectory {
        start: start_of(recording, entry, view)?,
        actions: (0..view.steps()).map(|step| wide(view.action(step))).collect(),
        rewards: (0..view.steps()).map(|step| f64::from(view.reward(step))).collect(),
        observations: (0..view.rows()).map(|row| wide(view.observation(row))).collect(),
        qpos: (0..view.rows()).map(|row| view.qpos(row).to_vec()).collect(),
        qvel: (0..view.rows()).map(|row| view.qvel(row).to_vec()).collect(),
    })
}

/// An episode's distractors.
pub fn distractors_of(view: &EpisodeView) -> DistractorTrajectory {
    DistractorTrajectory {
        cameras: (0..view.rows()).map(|row| view.camera(row)).collect(),
        backgrounds: (0..view.rows()).map(|row| view.background(row)).collect(),
        colors: (0..view.rows()).flat_map(|row| view.colors(row).to_vec()).collect(),
    }
}

/// Turns all states of an episode about the origin, by `degrees`; what is observed is observed again.
///
/// # Errors
/// [`vibes_env::Error::NoRotation`].
pub fn rotate(states: &mut StateTrajectory, environment: &mut Environment, degrees: f64) -> Result<()> {
    let start = states.start.clone();
    environment.rotate(&mut states.start, degrees.to_radians())?;
    for row in 0..states.qpos.len() {
        let mut state = Start { qpos: states.qpos[row].clone(), qvel: states.qvel[row].clone(), ..start.clone() };
        environment.rotate(&mut state, degrees.to_radians())?;
        environment.reset_to(&state)?;
        environment.observe(&mut states.observations[row]);
        states.qpos[row] = state.qpos;
    }
    Ok(())
}

/// How many episodes were asked for; none where the options do not say, and of a part of another recording, which is whole by itself.
pub fn asked(recording: &Recording) -> Option<u64> {
    let options = &recording.manifest().options;
    let asked = options.get("episodes").and_then(Value::as_u64).filter(|&asked| asked > 0);
    asked.filter(|_| options.get(SUBSET).is_none())
}

/// The same as text, where some are missing. It need not have been stopped: what is drawn again of a recording has no more than that had.
pub fn missing(recording: &Recording) -> String {
    let there = recording.episodes().len() as u64;
    let asked = asked(recording).filter(|&asked| asked > there);
    asked.map_or_else(String::new, |asked| format!(" of {asked} (if it was stopped, the same command goes on)"))
}
