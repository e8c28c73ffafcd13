//! The one loop that records: state trajectories are simulated once each, drawn once per distractor trajectory, and written episode by episode.
//!
//! In: [`RecordOptions`], a seed, a folder. Out: a recording. Every worker thread has a simulation, policies and a render context of its own; which
//! thread does what never changes a byte.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use vibes_data::{EpisodeInfo, FORMAT, ImageSize, Manifest, Recording, RecordingWriter, Spec, Video};

use crate::plan::{PlannedEpisode, RecordOptions, state_seed};
use crate::render::{material_colors, material_names};
use crate::studio::{Studio, StudioSettings};
use crate::videos::VideoLibrary;
use crate::{Environment, EnvironmentOptions, Error, Policy, PolicyMix, PolicySpec, Result, StateTrajectory, rollout};

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
    /// Set from outside to stop after the episodes at hand.
    pub stop: &'a AtomicBool,
}

/// A state trajectory that is simulated by whoever needs it first, and forgotten after its last cell.
#[derive(Debug, Default)]
struct Row(OnceLock<Option<StateTrajectory>>);

/// An episode to be made.
type Job = (PlannedEpisode, Arc<Row>);

/// What all workers share.
struct Shared<'a> {
    run: &'a RecordRun<'a>,
    mix: PolicyMix,
    studio: StudioSettings<'a>,
    writer: &'a RecordingWriter,
    jobs: Mutex<std::vec::IntoIter<Job>>,
    failure: Mutex<Option<Error>>,
    rows: AtomicU64,
    report: &'a (dyn Fn(Progress) + Sync),
}

/// Records what is not there yet.
///
/// # Errors
/// The first thing that goes wrong; every episode finished by then is kept. [`Error::NoEgl`] on a machine that cannot draw.
pub fn record(path: &Path, run: &RecordRun<'_>, report: &(dyn Fn(Progress) + Sync)) -> Result<Recording> {
    let options = run.options;
    let environment = environment_of(options)?;
    let videos = open_videos(options)?;
    let manifest = manifest_of(options, run.seed, &environment, videos.videos());
    let writer = RecordingWriter::create_or_resume(path, manifest, run.with_mcap)?;
    let jobs = jobs_of(options, &writer, run.threads);
    let wanted = jobs.len();
    let shared = Shared {
        run,
        mix: options.policy.parse()?,
        studio: StudioSettings::new(options, run.seed, &environment, &videos)?,
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
    let recording = writer.finish()?;
    failure.map_or(Ok(recording), Err)
}

/// The environment of a recording.
///
/// # Errors
/// [`Error::UnknownTask`].
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
fn jobs_of(options: &RecordOptions, writer: &RecordingWriter, threads: usize) -> Vec<Job> {
    let mut rows: BTreeMap<u32, Arc<Row>> = BTreeMap::new();
    let missing = options.episodes().filter(|episode| !writer.has(episode.index));
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

/// One thread's simulation, policies and render context.
struct Worker<'a> {
    shared: &'a Shared<'a>,
    environment: Environment,
    policies: Vec<(PolicySpec, Policy)>,
    studio: Studio<'a>,
}

impl<'a> Worker<'a> {
    fn new(shared: &'a Shared<'a>) -> Result<Self> {
        let environment = environment_of(shared.run.options)?;
        let studio = Studio::new(&shared.studio, &environment)?;
        Ok(Self { shared, environment, policies: Vec::new(), studio })
    }

    fn work(&mut self) -> Result<()> {
        while let Some((planned, row)) = self.shared.next_job() {
            let trajectory = row
                .0
                .get_or_init(|| self.simulate(planned.state).map_err(|error| self.shared.fail_on(Err(error))).ok());
            let Some(trajectory) = trajectory else { return Ok(()) };
            let episode = self.studio.draw_episode(planned, trajectory, &mut self.environment)?;
            let info = EpisodeInfo {
                policy: self.shared.mix.policy(planned.state).to_string(),
                seed: state_seed(self.shared.run.seed, planned.state),
                model_overrides: serde_json::to_value(&trajectory.start.model_overrides).unwrap_or_default(),
            };
            self.shared.writer.write(&episode, info)?;
            self.shared.rows.fetch_add(episode.rows() as u64, Ordering::Relaxed);
            self.shared.tell();
        }
        Ok(())
    }

    fn simulate(&mut self, state: u32) -> Result<StateTrajectory> {
        let run = self.shared.run;
        let spec = self.shared.mix.policy(state);
        let known = self.policies.iter().position(|(made, _)| made == spec);
        let place = match known {
            Some(place) => place,
            None => {
                let RecordOptions { action_repeat, raw_torques, .. } = *run.options;
                let options = EnvironmentOptions { action_repeat: Some(action_repeat), raw_torques };
                self.policies.push((spec.clone(), Policy::new(spec, &run.options.task, options)?));
                self.policies.len() - 1
            }
        };
        rollout(&mut self.environment, &mut self.policies[place].1, run.options.steps, state_seed(run.seed, state))
    }
}

/// The model's own material colours, where the colour axis is off.
pub(crate) fn own_colors(environment: &Environment) -> Vec<f32> {
    material_colors(environment.physics().model())
}
