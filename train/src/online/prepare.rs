//! Before online training: the options and the run folder, from what was asked for. In: a task, or a run to go on from. Out: a run and its options.

use std::path::Path;

use vibes_data::{RUN_FORMAT, Recording, RunFolder, Spec, relative_place};
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::Look;
use vibes_env::videos::VideoSource;
use vibes_env::{Environment, EnvironmentOptions};
use vibes_model::{ModelConfig, ObservationKind};

use super::beginning;
use super::checkpoint::check_whole;
use super::options::{OnlineOptions, WorldOptions};
use crate::error::{Result, TrainError};
use crate::learners::behaviour::BehaviourOptions;
use crate::options::Options;
use crate::prepare::{held, observations_of, same_model};
use crate::run::{Run, RunInfo, versions};
use crate::settings::Observations;

/// Standard deviation of an agent step's reward per control step, before any was seen: what a unit of reward is when `--reward-scale` is 0.
const REWARD_STD: f64 = 0.3;

/// A run that is ready to train online, and the recordings it was given.
#[derive(Debug)]
pub struct Prepared {
    /// The run folder, owned by this process.
    pub run: Run,
    /// Its options.
    pub options: OnlineOptions,
    /// The recordings whose windows are mixed in.
    pub given: Vec<Recording>,
}

impl Prepared {
    /// What is to be known of the run's beginning before it is trained, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        beginning::notes(&self.run, &self.options)
    }
}

/// The world of a task as the suite has it, with easy dynamic distractors.
///
/// # Errors
/// There is no such task.
pub fn default_world(task: &str) -> Result<WorldOptions> {
    let environment = Environment::new(task, EnvironmentOptions::default())?;
    Ok(WorldOptions {
        task: task.to_owned(),
        action_repeat: environment.action_repeat(),
        steps: environment.episode_steps(),
        distractors: DistractorSettings::default(),
        videos: VideoSource::Procedural,
        video_count: None,
        size: Some(64),
        look: Look::Fast,
    })
}

/// What a run learned from, which a share of every batch is to come from.
fn recordings_of(run: &Run) -> Result<Vec<Recording>> {
    run.open_recordings().map_err(|error| match error {
        TrainError::Data(vibes_data::Error::NoRecording { path }) => TrainError::Options(format!(
            "the recordings of this run are gone (a kept copy has none): {}; put them there, or go on without them with --given-share 0",
            path.display()
        )),
        other => other,
    })
}

/// Options that work, for a world; `is_given` says whether there are recordings to begin with.
pub fn default_options(world: WorldOptions, is_given: bool) -> OnlineOptions {
    OnlineOptions {
        protocol: None,
        world,
        behaviour: BehaviourOptions::default(),
        control_steps: 500_000,
        rows_per_step: 128.0,
        prefill: if is_given { 0 } else { 5 },
        given_share: 0.5,
        first_updates: if is_given { 1000 } else { 200 },
        critic_first: OnlineOptions::default_critic_first(is_given),
        short_horizon: 0,
        short_for: 0,
        reset_at: Vec::new(),
        reset_updates: 0,
        exploration: 0.3,
        evaluate_every: 10_000,
        evaluation_episodes: 5,
        final_episodes: 20,
        evaluate_mode: true,
        held_out_videos: None,
        given_control_steps: None,
        given_from: None,
        held_out_seen: Vec::new(),
    }
}

/// Begins a run from nothing, or goes on with the one at `path`.
///
/// # Errors
/// The folder holds another run, or cannot be written, or the task has no such observations.
pub fn from_nothing(path: &Path, model: &Options, options: OnlineOptions) -> Result<Prepared> {
    options.check()?;
    check_rows(&options, model)?;
    let spec = options.world.spec()?;
    let kind = observation_kind(&spec, model.observations)?;
    check_seen(&options, kind)?;
    let unit = REWARD_STD * f64::from(options.world.action_repeat);
    let info = RunInfo {
        format: RUN_FORMAT.to_owned(),
        model: model.model(&spec, kind, unit),
        from: None,
        began_with: None,
        options: model.clone(),
        recordings: Vec::new(),
        episodes: 0,
        steps: 0,
        versions: versions(),
    };
    Ok(Prepared { run: begun(path, info, &[], &options)?, options, given: Vec::new() })
}

/// Begins a run at `path` that goes on from the newest checkpoint of the offline run `from` and mixes in the recordings that one learned from, or goes on with the one at
/// `path`.
///
/// # Errors
/// `from` has no checkpoint or its recordings are gone, or the folder holds another run, or cannot be written, or a protocol cannot be followed from there: it is not known what it has
/// learned from, or that has seen videos which the protocol holds out.
pub fn from_run(path: &Path, from: &Run, model: &Options, options: OnlineOptions) -> Result<Prepared> {
    options.check()?;
    check_rows(&options, model)?;
    let there = RunFolder::at(path);
    if OnlineOptions::read(path)?.is_none() && !there.checkpoints().is_empty() {
        let text = format!(
            "an offline run is at {}; online training goes on from it in a folder of its own, -o",
            path.display()
        );
        return Err(TrainError::Options(text));
    }
    // A share of 0 goes on without them, as where they are gone.
    let given = if options.given_share > 0.0 { recordings_of(from)? } else { Vec::new() };
    check_repeats(&given, options.world.action_repeat)?;
    let spec = options.world.spec()?;
    let kind = observation_kind(&spec, model.observations)?;
    check_seen(&options, kind)?;
    let found = &from.info().model;
    let made = model.model(&spec, kind, 1.0);
    // The unit of reward stays as the run has it.
    let wanted = ModelConfig { reward_scale: found.reward_scale, reward_floor: found.reward_floor, ..made };
    same_model(from.path(), model.objective, &wanted)?;
    let options = beginning::settled(path, from, kind, options)?;
    let (episodes, steps) = held(&given);
    let info = RunInfo {
        format: RUN_FORMAT.to_owned(),
        model: wanted,
        from: Some(relative_place(from.path(), path)),
        began_with: None,
        options: model.clone(),
        recordings: given.iter().map(|recording| relative_place(recording.path(), path)).collect(),
        episodes,
        steps,
        versions: versions(),
    };
    Ok(Prepared { run: begun(path, info, &given, &options)?, options, given })
}

/// Goes on with the online run at `path` under its own options but for `options`, which may differ in how long to go on.
///
/// # Errors
/// The run's recordings are gone, or something else differs, or the run is under a protocol and has seen videos which that holds out.
pub fn again(path: &Path, model: &Options, options: OnlineOptions) -> Result<Prepared> {
    options.check()?;
    check_rows(&options, model)?;
    check_whole(path)?;
    let found = Run::open(path)?;
    let given = found.open_recordings()?;
    let options = beginning::settled(path, &found, found.info().model.observation, options)?;
    let (episodes, steps) = held(&given);
    let info = RunInfo { options: model.clone(), episodes, steps, ..found.info().clone() };
    Ok(Prepared { run: begun(path, info, &given, &options)?, options, given })
}

/// The run at `path`, new or gone on with. Nothing of one that is there is written before it is known to be the same.
///
/// # Errors
/// The folder holds another run, or a kept copy, or cannot be written.
fn begun(path: &Path, info: RunInfo, given: &[Recording], options: &OnlineOptions) -> Result<Run> {
    check_whole(path)?;
    options.check_found(path)?;
    if OnlineOptions::read(path)?.is_none() {
        let is_given = !info.recordings.is_empty();
        options.check_new(is_given)?;
        options.check_actor_moves(info.options.length * info.options.batch, is_given)?;
    }
    let run = Run::create_or_open(path, info, given)?;
    options.keep(run.path())?;
    Ok(run)
}

/// That an episode of the world is as long as a window of the learner's, and that imagination starts somewhere in every window.
///
/// # Errors
/// Either is not so.
fn check_rows(options: &OnlineOptions, model: &Options) -> Result<()> {
    check_length(options, model.length)?;
    let (every, counted) = (options.behaviour.every_start, model.length.saturating_sub(model.burn_in));
    if every <= counted {
        return Ok(());
    }
    let text = format!("--every-start is {every}, and a window has {counted} rows that count; it must be at most that");
    Err(TrainError::Options(text))
}

/// That what a protocol says of observations is so.
///
/// # Errors
/// The model looks at others.
fn check_seen(options: &OnlineOptions, kind: ObservationKind) -> Result<()> {
    match (options.protocol, kind) {
        (Some(protocol), ObservationKind::Vector { .. }) => {
            let text =
                format!("{protocol} has observations pictures, not vectors; leave out --protocol for other settings");
            Err(TrainError::Options(text))
        }
        _ => Ok(()),
    }
}

/// That an episode of the world is as long as a window of the learner's.
///
/// # Errors
/// It is shorter: nothing could ever be learned from it.
pub(super) fn check_length(options: &OnlineOptions, window: usize) -> Result<()> {
    let steps = options.world.steps;
    if steps as usize >= window {
        return Ok(());
    }
    let text = format!("--steps is {steps}, and a window has {window} rows; an episode must have as many at least");
    Err(TrainError::Options(text))
}

/// That recordings hold every action for as long as the world does: their rewards are sums over it.
fn check_repeats(given: &[Recording], action_repeat: u32) -> Result<()> {
    let other = given.iter().find(|recording| recording.manifest().spec.action_repeat != action_repeat);
    other.map_or(Ok(()), |recording| {
        Err(TrainError::OtherRecording {
            found: format!("actions held for {} control steps", recording.manifest().spec.action_repeat),
            wanted: format!("actions held for {action_repeat} (--action-repeat)"),
            path: recording.path().to_owned(),
        })
    })
}

fn observation_kind(spec: &Spec, wanted: Observations) -> Result<ObservationKind> {
    observations_of(spec, wanted).ok_or_else(|| {
        let wanted = format!("{wanted:?}").to_lowercase();
        let text = format!("--observations {wanted} asks for what there is not: with --no-pixels nothing is drawn; leave out one of the two");
        TrainError::Options(text)
    })
}
