//! The one loop that records: state trajectories are simulated once each, drawn once per distractor trajectory, and written episode by episode.
//!
//! In: [`RecordOptions`], a seed, a folder, and a [`Source`] of what need not be made anew. Out: a recording. Every worker thread has a simulation,
//! policies and a render context of its own; which thread does what never changes a byte.

mod acting;
mod evaluate;
mod found;
mod queue;
mod source;
mod worker;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use vibes_data::{Recording, RecordingWriter};

pub use evaluate::evaluate;
pub use source::Source;

use crate::keys::SUBSET;
use crate::plan::{PlannedEpisode, RecordOptions};
use crate::sound::{unplanned, unplanned_in_words};
use crate::stored::Acted;
use crate::trained::policy;
use crate::{Error, Result};
use acting::Stage;
use queue::Queue;
use source::Stored;
use vibes_env::render::RenderSettings;
use vibes_env::videos::VideoLibrary;
use vibes_env::{EnvironmentOptions, Policy, PolicyMix, PolicySpec};
use worker::Worker;

/// How far a recording has grown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Background videos that are being made before anything is drawn under them; none once they are there.
    pub preparing: usize,
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
    /// Who makes the policies: the function [`policy`], or a caller with policies of its own.
    pub policies: PolicyMaker<'a>,
    /// Set from outside to stop after the episodes at hand.
    pub stop: &'a AtomicBool,
}

impl RecordRun<'_> {
    /// Tells how many background videos are being made, and says whether to go on with it.
    fn prepares(&self, preparing: usize, report: &(dyn Fn(Progress) + Sync)) -> bool {
        report(Progress { preparing, wanted: u64::from(self.options.episodes), ..Progress::default() });
        !self.stop.load(Ordering::Relaxed)
    }

    /// The background videos for pictures of these settings: those that a recording names which is drawn again or grows, else those of the options.
    fn videos_for(&self, pictures: RenderSettings, report: &(dyn Fn(Progress) + Sync)) -> Result<Arc<VideoLibrary>> {
        let go_on = |missing: usize| self.prepares(missing, report);
        match self.source.videos() {
            Some((place, names)) => {
                self.source.check_there(self.options)?;
                self.options.named_videos(place, &names, pictures, &go_on)
            }
            None => self.options.videos_for(pictures, &go_on),
        }
    }
}

/// A function that makes a policy, as asked for, for a task in an environment of these options.
type MakePolicy<'a> = dyn Fn(&PolicySpec, &str, EnvironmentOptions) -> Result<Box<dyn Policy>> + Sync + 'a;

/// Makes the policies of a recording; called once a worker thread and policy.
#[derive(Clone, Copy)]
pub struct PolicyMaker<'a>(pub &'a MakePolicy<'a>);

impl std::fmt::Debug for PolicyMaker<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PolicyMaker").finish_non_exhaustive()
    }
}

impl Default for PolicyMaker<'_> {
    fn default() -> Self {
        Self(&policy)
    }
}

/// A state trajectory that is made by whoever needs it first, and forgotten after its last cell.
#[derive(Debug, Default)]
struct Row(OnceLock<Option<Acted>>);

/// An episode to be made.
type Job = (PlannedEpisode, Arc<Row>);

/// What all workers share.
struct Shared<'a> {
    path: &'a Path,
    stage: Stage<'a>,
    /// None where nothing is acted out.
    mix: Option<PolicyMix>,
    stored: Stored<'a>,
    writer: &'a RecordingWriter,
    queue: Queue<'a, Job>,
    rows: AtomicU64,
}

/// Records what is not there yet.
///
/// # Errors
/// The first thing that goes wrong; every episode finished by then is kept. [`vibes_env::Error::NoEgl`] on a machine that cannot draw,
/// [`vibes_env::Error::Stopped`] when asked to stop while background videos are made.
pub fn record(path: &Path, run: &RecordRun<'_>, report: &(dyn Fn(Progress) + Sync)) -> Result<Recording> {
    let options = run.options;
    options.check(path)?;
    let environment = options.environment().map_err(|error| match run.source.recording() {
        Some(recording) => error.in_file(recording.path()),
        None => error,
    })?;
    // Before anything is on disk: a machine without EGL leaves no empty recording behind.
    let stage = Stage::open((run, path), &environment, report)?;
    let videos = stage.studio.videos().videos();
    // What is drawn again was acted out by whoever its recording names, which need be no mix: an online run says `random`, and Python says `python`.
    let mix = run.source.acts().then(|| options.mix()).transpose()?;
    if let Some(mix) = &mix
        && run.source.recording().is_none()
        && !path.join("manifest.json").exists()
    {
        // Nor does a file of actions that does not fit.
        mix.shares().iter().try_for_each(|(policy, _)| policy.check(options.steps, &environment))?;
    }
    let mut manifest = options.manifest(path, run.seed, &environment, videos);
    if let Some(part) = run.source.subset() {
        manifest.options[SUBSET] = part.clone();
    }
    run.source.check_videos(videos)?;
    found::in_its_words(path, &mut manifest, options)?;
    let writer = RecordingWriter::create_or_resume(path, manifest, run.with_mcap)?;
    let resumed = Recording::open(path)?;
    if run.source.acts() {
        check_planned(&resumed, options)?;
    }
    let jobs = jobs_of(run.source.episodes(options), &writer, run.threads);
    let shared = Shared {
        path,
        stage,
        mix,
        stored: Stored::new(run.source, &resumed),
        writer: &writer,
        queue: Queue::new(jobs, run.stop),
        rows: AtomicU64::new(0),
    };
    shared.tell();
    shared.queue.share(run.threads, || Worker::new(&shared).and_then(|mut worker| worker.work()));
    let failure = shared.queue.into_failure();
    let recording = writer.finish();
    // What went wrong first is what to say, even when the manifest could not be completed after it.
    failure.map_or_else(|| Ok(recording?), Err)
}

/// That what is gone on with is of this recording: under its number an episode of another seed would pass for one of it.
fn check_planned(resumed: &Recording, options: &RecordOptions) -> Result<()> {
    let Some(entry) = unplanned(resumed, options).first().copied() else { return Ok(()) };
    let fact = format!("{}; remove {}", unplanned_in_words(entry, options), entry.arrow.path);
    Err(Error::NotAsPlanned { fact, path: resumed.path().into() })
}

/// Cores that this process may use: more contexts than that only wait for each other.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// What is not there yet, or lacks its log. Cells are ordered so that as many rows are simulated at once as there are threads: nobody waits for another's physics.
fn jobs_of(planned: Vec<PlannedEpisode>, writer: &RecordingWriter, threads: usize) -> Vec<Job> {
    let mut rows: BTreeMap<u32, Arc<Row>> = BTreeMap::new();
    let is_missing = |episode: &PlannedEpisode| !writer.has(episode.index) || writer.lacks_log(episode.index);
    let missing = planned.into_iter().filter(is_missing);
    let mut jobs: Vec<Job> = missing.map(|episode| (episode, rows.entry(episode.state).or_default().clone())).collect();
    jobs.sort_by_key(|(episode, _)| (episode.state as usize / threads.max(1), episode.distractor, episode.state));
    jobs
}

impl Shared<'_> {
    fn tell(&self) {
        (self.stage.report)(Progress {
            preparing: 0,
            episodes: self.writer.len() as u64,
            wanted: u64::from(self.stage.run.options.episodes),
            rows: self.rows.load(Ordering::Relaxed),
        });
    }
}
