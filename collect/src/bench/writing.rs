//! How fast episodes are written, and how fast anything could be on this machine.
//!
//! In: size and look of the pictures, a folder on the disk in question. Out: a [`WritingRate`], from one real episode written again and
//! again; and the [`Limits`] it stands beside: copying memory, and writing plain bytes to that disk.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Serialize;
use vibes_data::{
    Episode, EpisodeInfo, Manifest, Recording, RecordingWriter, mcap_bytes, sha256_hex, write_atomically,
};

use crate::plan::{ChosenSeeds, RecordOptions};
use crate::recorder::{PolicyMaker, RecordRun, Source, record};
use crate::stored::info_of;
use crate::{Error, Result};
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::RenderSettings;
use vibes_env::videos::{VideoSet, VideoSource};
use vibes_env::{Environment, EnvironmentOptions};

/// How fast files of one kind are written: encoded, summed, and on the disk.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FileRate {
    /// Bytes of an episode.
    pub bytes: usize,
    /// Megabytes a second.
    pub megabytes_per_second: f64,
    /// Episodes a second.
    pub episodes_per_second: f64,
}

impl FileRate {
    fn new(bytes: usize, seconds: f64) -> Self {
        Self { bytes, megabytes_per_second: bytes as f64 / 1e6 / seconds, episodes_per_second: 1.0 / seconds }
    }
}

/// How fast a task is recorded and written.
#[derive(Clone, Debug, Serialize)]
pub struct WritingRate {
    /// The task.
    pub task: String,
    /// Size and look.
    pub pictures: RenderSettings,
    /// Threads of the recording.
    pub threads: usize,
    /// Rows of an episode.
    pub rows: usize,
    /// Rows a second of a whole recording, start-up included: simulated, drawn, and written as both kinds of file.
    pub recorded_rows_per_second: f64,
    /// Arrow tables alone, on one thread.
    pub arrow: FileRate,
    /// MCAP logs alone, on one thread.
    pub mcap: FileRate,
    /// Microseconds a row on one thread, by [`WRITING_STAGES`], both kinds of file together.
    pub microseconds: [f64; 4],
}

/// The names of [`WritingRate::microseconds`].
pub const WRITING_STAGES: [&str; 4] = ["encode Arrow", "encode MCAP", "checksum", "write"];

/// What this machine could do if nothing but bytes had to be moved.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Limits {
    /// Bytes a second copied from memory to memory on one core.
    pub memory_copy: f64,
    /// Bytes a second written to the disk and flushed.
    pub disk_write: f64,
}

/// Megabytes moved to find the limits.
const LIMIT_MEGABYTES: usize = 64;
/// Times the episode is written.
const WRITES: u32 = 8;

impl Limits {
    /// Measures them, with a file in `folder`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn measure(folder: &Path) -> Result<Self> {
        let bytes: Vec<u8> = (0..LIMIT_MEGABYTES << 20).map(|place| (place ^ (place >> 9)) as u8).collect();
        let mut copy = vec![0_u8; bytes.len()];
        let copying = fastest(3, || {
            copy.copy_from_slice(std::hint::black_box(&bytes));
            std::hint::black_box(&copy);
            Ok(())
        })?;
        let path = folder.join("plain-bytes");
        let writing = fastest(3, || Ok(write_atomically(&path, &bytes)?))?;
        Ok(Self { memory_copy: bytes.len() as f64 / copying, disk_write: bytes.len() as f64 / writing })
    }
}

/// Seconds of the fastest of some runs.
fn fastest(runs: usize, mut run: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut seconds = f64::INFINITY;
    for _ in 0..runs {
        let begin = Instant::now();
        run()?;
        seconds = seconds.min(begin.elapsed().as_secs_f64());
    }
    Ok(seconds.max(1e-9))
}

/// Records `threads` episodes of a task into `folder`, with all easy dynamic distractors, and writes one of them again and again.
///
/// # Errors
/// For an unknown task, a machine that cannot draw, or a disk that cannot be written.
pub fn writing_rate(task: &str, pictures: RenderSettings, threads: usize, folder: &Path) -> Result<WritingRate> {
    let path = folder.join(format!("{task}-{}-{}", pictures.size, pictures.look));
    let begin = Instant::now();
    let recording = record_some(task, pictures, threads, &path)?;
    let recorded = begin.elapsed().as_secs_f64();
    let entry = &recording.episodes()[0];
    let episode = recording.episode(entry.index)?.to_episode();
    let (manifest, info) = (recording.manifest(), info_of(entry));
    let read = |name: &str| std::fs::read(path.join(name)).map_err(Error::io("read", path.join(name)));
    let arrow = read(&entry.arrow.path)?;
    let mcap = mcap_bytes(&episode, &manifest.spec, entry)?;
    let seconds_arrow = write_again(&path.join("tables"), manifest, &episode, &info, false)?;
    let seconds_both = write_again(&path.join("both"), manifest, &episode, &info, true)?;
    let encode_mcap = fastest(3, || {
        std::hint::black_box(mcap_bytes(&episode, &manifest.spec, entry)?);
        Ok(())
    })?;
    let checksum = |bytes: &[u8]| {
        fastest(3, || {
            std::hint::black_box(sha256_hex(bytes));
            Ok(())
        })
    };
    let write = |bytes: &[u8]| fastest(3, || Ok(write_atomically(&path.join("plain-bytes"), bytes)?));
    let (sum_arrow, sum_mcap) = (checksum(&arrow)?, checksum(&mcap)?);
    let (write_arrow, write_mcap) = (write(&arrow)?, write(&mcap)?);
    let encode_arrow = (seconds_arrow - sum_arrow - write_arrow).max(0.0);
    let per_row = |seconds: f64| seconds * 1e6 / episode.rows() as f64;
    Ok(WritingRate {
        task: task.to_owned(),
        pictures,
        threads,
        rows: episode.rows(),
        recorded_rows_per_second: (episode.rows() * recording.episodes().len()) as f64 / recorded,
        arrow: FileRate::new(arrow.len(), seconds_arrow),
        mcap: FileRate::new(mcap.len(), (seconds_both - seconds_arrow).max(encode_mcap)),
        microseconds: [encode_arrow, encode_mcap, sum_arrow + sum_mcap, write_arrow + write_mcap].map(per_row),
    })
}

fn record_some(task: &str, pictures: RenderSettings, threads: usize, path: &Path) -> Result<Recording> {
    let environment = Environment::new(task, EnvironmentOptions::default())?;
    let options = RecordOptions {
        task: task.to_owned(),
        policy: "random:1".to_owned(),
        grid: None,
        episodes: threads as u32,
        steps: environment.episode_steps(),
        action_repeat: environment.action_repeat(),
        raw_torques: false,
        distractors: DistractorSettings::default(),
        videos: VideoSource::Procedural,
        video_set: VideoSet::Train,
        video_count: None,
        size: Some(pictures.size as u32),
        look: pictures.look,
        axis_seeds: ChosenSeeds::default(),
        acting: Vec::new(),
        actions: Vec::new(),
        protocol: None,
        rotated: None,
        redrawn: false,
    };
    let stop = AtomicBool::new(false);
    let run = RecordRun {
        options: &options,
        seed: 0,
        threads,
        with_mcap: true,
        source: Source::Simulation,
        turn: 0.0,
        policies: PolicyMaker::default(),
        stop: &stop,
    };
    record(path, &run, &|_| {})
}

/// Mean seconds to write the episode.
fn write_again(
    path: &Path,
    manifest: &Manifest,
    episode: &Episode,
    info: &EpisodeInfo,
    with_mcap: bool,
) -> Result<f64> {
    let manifest = Manifest { episodes: Vec::new(), ..manifest.clone() };
    let writer = RecordingWriter::create_or_resume(path, manifest, with_mcap)?;
    let begin = Instant::now();
    for index in 0..WRITES {
        writer.write(&Episode { index, ..episode.clone() }, info.clone())?;
    }
    Ok(begin.elapsed().as_secs_f64() / f64::from(WRITES))
}
