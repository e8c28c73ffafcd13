//! Before training: what the recordings hold decides the model, and the run folder is begun or found. In: recordings and options. Out: a run.

use std::path::Path;

use vibes_data::{RUN_FORMAT, Recording, Spec, WindowSampler, relative_place};
use vibes_model::{ModelConfig, ObservationKind};

use crate::encode::check_sizes;
use crate::error::{Result, TrainError};
use crate::evaluate::{check_is_grid, check_windows};
use crate::options::Options;
use crate::run::{Run, RunInfo, versions};
use crate::same_world::LearnedWorld;
use crate::settings::Observations;

mod model;

pub(crate) use model::same_model;

/// Opens or begins the run at `path` for these recordings and options; a new one goes on from the newest checkpoint of the run `from`, if one is named.
///
/// # Errors
/// The recordings differ in what they hold, or lack the observations asked for, or have no window of the length asked for, or the folder holds another run, or `from` another model.
pub fn prepare(path: &Path, recordings: &[Recording], options: &Options, from: Option<&Path>) -> Result<Run> {
    let Some(first) = recordings.first() else {
        return Err(TrainError::Options("no recording was named; name at least one".to_owned()));
    };
    if path.join("online.json").exists() {
        let text = format!("an online run is at {}; name another folder with -o", path.display());
        return Err(TrainError::Options(text));
    }
    let spec = &first.manifest().spec;
    let observation = observation_kind(first, options.observations)?;
    for other in &recordings[1..] {
        let kind = observation_kind(other, options.observations)?;
        let repeats = [spec, &other.manifest().spec].map(|spec| spec.action_repeat);
        // An imported recording may be called after its file.
        let is_imported = [first, other].iter().any(|recording| recording.manifest().is_imported());
        let is_of_task = is_imported || other.manifest().spec.task == spec.task;
        let is_alike = is_of_task && other.manifest().spec.action == spec.action;
        if !is_alike || kind != observation || repeats[0] != repeats[1] {
            let (found, wanted) = (describe(&other.manifest().spec, kind), describe(spec, observation));
            return Err(TrainError::OtherRecording { found, wanted, path: other.path().to_owned() });
        }
    }
    // Before anything is written: the same command with another length would find a run of this one.
    recordings.iter().try_for_each(|recording| WindowSampler::check_length(recording, options.settings.length))?;
    check_bounds(spec, first.path())?;
    let options = &settled(options, from);
    let model = options.model(spec, observation, rewards_std(recordings)?);
    let model = match known_scale(path, from) {
        Some(known) => ModelConfig { reward_scale: known.reward_scale, reward_floor: known.reward_floor, ..model },
        None => model,
    };
    if let Some(from) = from {
        same_model(from, options.objective, &model)?;
    }
    let (episodes, steps) = held(recordings);
    let info = RunInfo {
        format: RUN_FORMAT.to_owned(),
        model,
        from: from.map(|from| relative_place(from, path)),
        began_with: None,
        options: options.clone(),
        recordings: recordings.iter().map(|recording| relative_place(recording.path(), path)).collect(),
        episodes,
        steps,
        versions: versions(),
    };
    Run::create_or_open(path, info, recordings)
}

/// That a run on these recordings can be judged on a grid, and its gaps measured there where their critic makes any updates: to be known before its folder is begun.
///
/// # Errors
/// It is no grid, or of other sizes or another world, or has no window for the gaps, or the recordings lack the observations asked for.
pub fn check_held_out(grid: &Recording, recordings: &[Recording], options: &Options, gap_updates: u64) -> Result<()> {
    if let Some(first) = recordings.first() {
        let spec = &first.manifest().spec;
        let observation = observation_kind(first, options.observations)?;
        check_sizes(&spec.task, observation, spec.action.min.len(), grid)?;
        LearnedWorld::of(first).check(grid)?;
    }
    check_is_grid(grid)?;
    if gap_updates > 0 { check_windows(grid, options.settings.length) } else { Ok(()) }
}

/// That actions can be scaled to −1..1 in single precision, in which a model holds their bounds.
fn check_bounds(spec: &Spec, path: &Path) -> Result<()> {
    let extents = spec.action.max.iter().zip(&spec.action.min).map(|(&high, &low)| high as f32 - low as f32);
    match extents.into_iter().find(|extent| !extent.is_finite()) {
        None => Ok(()),
        Some(_) => Err(TrainError::OtherRecording {
            found: "bounds of an action too far apart for single precision".to_owned(),
            wanted: "bounds that the actions come near".to_owned(),
            path: path.to_owned(),
        }),
    }
}

/// Episodes and rows of some recordings.
pub(crate) fn held(recordings: &[Recording]) -> (usize, u64) {
    let episodes = recordings.iter().flat_map(Recording::episodes);
    episodes.fold((0, 0), |(count, steps), episode| (count + 1, steps + u64::from(episode.steps)))
}

/// The options with the unit of reward as the run `from` has it: its model is gone on with.
fn settled(options: &Options, from: Option<&Path>) -> Options {
    let mut settled = options.clone();
    if let Some(before) = from.and_then(|from| Run::open(from).ok()) {
        let before = &before.info().options.settings;
        (settled.settings.reward_scale, settled.settings.reward_floor) = (before.reward_scale, before.reward_floor);
    }
    settled
}

/// Standard deviation of all rewards of the recordings.
///
/// # Errors
/// An episode cannot be read, or a reward is no number: a run begun with such a unit of reward would keep it.
fn rewards_std(recordings: &[Recording]) -> Result<f64> {
    let (mut count, mut sum, mut squares) = (0.0_f64, 0.0, 0.0);
    for recording in recordings {
        for entry in recording.episodes() {
            let episode = recording.episode(entry.index)?;
            for reward in (0..episode.steps()).map(|step| f64::from(episode.reward(step))) {
                count += 1.0;
                sum += reward;
                squares += reward * reward;
            }
            if !sum.is_finite() {
                episode.check_numbers()?;
            }
        }
    }
    let mean = sum / count.max(1.0);
    Ok((squares / count.max(1.0) - mean * mean).max(0.0).sqrt())
}

/// The model that has learned before, whose unit of reward stays although the recordings may have grown.
fn known_scale(path: &Path, from: Option<&Path>) -> Option<ModelConfig> {
    let own = Run::open(path).ok().filter(|run| !run.checkpoints().is_empty());
    let before = own.or_else(|| Run::open(from?).ok())?;
    Some(before.info().model.clone())
}

/// The observations of a recording or a world that are wanted, pictures before vectors; none where it has none.
pub(crate) fn observations_of(spec: &Spec, wanted: Observations) -> Option<ObservationKind> {
    let pixels =
        spec.pixels.map(|size| ObservationKind::Pixels { height: size.height as usize, width: size.width as usize });
    let vector = Some(spec.observation_len()).filter(|&len| len > 0).map(|len| ObservationKind::Vector { len });
    match wanted {
        Observations::Auto => pixels.or(vector),
        Observations::Pixels => pixels,
        Observations::Vectors => vector,
    }
}

fn observation_kind(recording: &Recording, wanted: Observations) -> Result<ObservationKind> {
    let name = match wanted {
        Observations::Auto => "observations",
        Observations::Pixels => "pixels",
        Observations::Vectors => "vector observations",
    };
    let kind = observations_of(&recording.manifest().spec, wanted);
    kind.ok_or_else(|| TrainError::OtherRecording {
        found: format!("no {name}"),
        wanted: name.to_owned(),
        path: recording.path().to_owned(),
    })
}

fn describe(spec: &Spec, kind: ObservationKind) -> String {
    let (actions, repeat) = (spec.action.min.len(), spec.action_repeat);
    format!("{} with {kind} and {actions} actions, each held for {repeat} control steps", spec.task)
}
