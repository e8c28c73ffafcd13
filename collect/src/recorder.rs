//! The one loop that records: state trajectories are simulated once each, drawn once per distractor trajectory, and written episode by episode.
//!
//! In: [`RecordOptions`], a seed, a folder, and a [`Source`] of what need not be made anew. Out: a recording. Every worker thread has a simulation,
//! policies and a render context of its own; which thread does what never changes a byte.

mod source;
mod worker;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use vibes_data::{EpisodeInfo, FORMAT, ImageSize, Manifest, Recording, RecordingWriter, Spec, Video};

pub use source::Source;

use crate::plan::{PlannedEpisode, RecordOptions};
use crate::studio::StudioSettings;
use crate::{Error, Result};
use source::Stored;
use vibes_env::render::{check_drawing, material_colors, material_names};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, EnvironmentOptions, PolicyMix, StateTrajectory};
use worker::Worker;

/// What is told while a recording grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Episodes that are there.
    pub episodes: u64,
    /// Episodes asked for.
    pub wanted: u64,
    /// Rows written by this run.
    pub rows: u64,
}

/// How a recording is made, beside what it holds.
#[derive(Debug)]
pub struct RecordRun<'a> {
    /// What the recording holds.
    pub options: &'a RecordOptions,
    /// The seed of everything.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
    /// Whether MCAP logs are written too.
    pub with_mcap: bool,
    /// What is taken from another recording.
    pub source: Source<'a>,
    /// Degrees by which states are turned before they are drawn; see [`vibes_env::Task::rotate`].
    pub turn: f64,
    /// Set from outside to stop after the episodes at hand.
    pub stop: &'a AtomicBool,
}

/// A state trajectory, with what the manifest says of it, that is made by whoever needs it first, and forgotten after its last cell.
#[derive(Debug, Default)]
struct Row(OnceLock<Option<(StateTrajectory, EpisodeInfo)>>);

/// An episode to be made.
type Job = (PlannedEpisode, Arc<Row>);

/// What all workers share.
struct Shared<'a> {
    run: &'a RecordRun<'a>,
    mix: PolicyMix,
    studio: StudioSettings<'a>,
    stored: Stored<'a>,
    writer: &'a RecordingWriter,
    jobs: Mutex<std::vec::IntoIter<Job>>,
    failure: Mutex<Option<Error>>,
    rows: AtomicU64,
    report: &'a (dyn Fn(Progress) + Sync),
}

/// Records what is not there yet.
///
/// # Errors
/// The first thing that goes wrong; every episode finished by then is kept. [`vibes_env::Error::NoEgl`] on a machine that cannot draw.
pub fn record(path: &Path, run: &RecordRun<'_>, report: &(dyn Fn(Progress) + Sync)) -> Result<Recording> {
    let options = run.options;
    let environment = environment_of(options)?;
    if options.size.is_some() {
        // Before anything is on disk: a machine without EGL leaves no empty recording behind.
        check_drawing()?;
    }
    let videos = open_videos(options)?;
    let manifest = manifest_of(options, run.seed, &environment, videos.videos());
    run.source.check_videos(videos.videos())?;
    let writer = RecordingWriter::create_or_resume(path, manifest, run.with_mcap)?;
    let resumed = Recording::open(path)?;
    let jobs = jobs_of(run.source.episodes(options), &writer, run.threads);
    let wanted = jobs.len();
    let shared = Shared {
        run,
        mix: options.policy.parse()?,
        studio: StudioSettings::new(options, run.seed, &environment, &videos)?,
        stored: Stored::new(run.source, &resumed),
        writer: &writer,
        jobs: Mutex::new(jobs.into_iter()),
        failure: Mutex::new(None),
        rows: AtomicU64::new(0),
        report,
    };
    shared.tell();
    std::thread::scope(|scope| {
        for _ in 0..run.threads.clamp(1, wanted.max(1)) {
            scope.spawn(|| shared.fail_on(Worker::new(&shared).and_then(|mut worker| worker.work())));
        }
    });
    let failure = shared.failure.into_inner().unwrap_or_else(PoisonError::into_inner);
    let recording = writer.finish();
    // What went wrong first is what to say, even when the manifest could not be completed after it.
    failure.map_or_else(|| Ok(recording?), Err)
}

/// The environment of a recording.
///
/// # Errors
/// [`vibes_env::Error::UnknownTask`].
pub fn environment_of(options: &RecordOptions) -> Result<Environment> {
    let RecordOptions { action_repeat, raw_torques, .. } = *options;
    Environment::new(&options.task, EnvironmentOptions { action_repeat: Some(action_repeat), raw_torques })
}

/// The background videos of a recording; none where no picture would show them.
///
/// # Errors
/// A folder that holds too few videos, a frame that cannot be decoded.
pub fn open_videos(options: &RecordOptions) -> Result<VideoLibrary> {
    let Some(size) = options.size.filter(|_| options.distractors.axes.background) else {
        return Ok(VideoLibrary::none());
    };
    let count = options.video_count.or(options.distractors.difficulty.videos());
    let names = options.videos.list(options.video_set, count)?;
    VideoLibrary::open(&options.videos, options.video_set, &names, options.look.sky_side(size as usize))
}

/// The shape of a recording's episodes.
pub fn spec_of(options: &RecordOptions, environment: &Environment) -> Spec {
    let model = environment.physics().model();
    Spec {
        task: options.task.clone(),
        action: environment.action_spec(),
        observation: environment.observation_spec(),
        qpos: environment.physics().qpos().len(),
        qvel: environment.physics().qvel().len(),
        pixels: options.size.map(|side| ImageSize { height: side, width: side }),
        materials: material_names(model),
        control_timestep: environment.control_timestep(),
        action_repeat: environment.action_repeat(),
    }
}

fn manifest_of(options: &RecordOptions, seed: u64, environment: &Environment, videos: &[Video]) -> Manifest {
    let versions = [("vibes", env!("CARGO_PKG_VERSION")), ("mujoco", "3.17.0"), ("dm_control models", "1.0.50")];
    Manifest {
        format: FORMAT.into(),
        spec: spec_of(options, environment),
        options: serde_json::to_value(options).unwrap_or_default(),
        seed,
        versions: versions.map(|(name, version)| (name.into(), version.into())).into_iter().collect::<BTreeMap<_, _>>(),
        grid: options.grid,
        videos: videos.to_vec(),
        episodes: Vec::new(),
    }
}

/// What is not there yet. Cells are ordered so that as many rows are simulated at once as there are threads: nobody waits for another's physics.
fn jobs_of(planned: Vec<PlannedEpisode>, writer: &RecordingWriter, threads: usize) -> Vec<Job> {
    let mut rows: BTreeMap<u32, Arc<Row>> = BTreeMap::new();
    let missing = planned.into_iter().filter(|episode| !writer.has(episode.index));
    let mut jobs: Vec<Job> = missing.map(|episode| (episode, rows.entry(episode.state).or_default().clone())).collect();
    jobs.sort_by_key(|(episode, _)| (episode.state as usize / threads.max(1), episode.distractor, episode.state));
    jobs
}

impl Shared<'_> {
    fn next_job(&self) -> Option<Job> {
        if self.run.stop.load(Ordering::Relaxed) {
            return None;
        }
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner).next()
    }

    fn fail_on(&self, outcome: Result<()>) {
        if let Err(error) = outcome {
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            // Nobody takes another job.
            *self.jobs.lock().unwrap_or_else(PoisonError::into_inner) = Vec::new().into_iter();
        }
    }

    fn tell(&self) {
        (self.report)(Progress {
            episodes: self.writer.len() as u64,
            wanted: u64::from(self.run.options.episodes),
            rows: self.rows.load(Ordering::Relaxed),
        });
    }
}

/// The model's own material colours, where the colour axis is off.
pub(crate) fn own_colors(environment: &Environment) -> Vec<f32> {
    material_colors(environment.physics().model())
}
