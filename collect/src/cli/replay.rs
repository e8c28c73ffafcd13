//! `vibes-collect replay`: simulates a trace or a recorded episode again and compares, or feeds a distractor trace through the distractors.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use serde_json::Value;
use vibes_command::Given;
use vibes_data::Recording;

use super::number::number;
use super::replay_distractors::{self, Pictures};
use super::{Outcome, OutputArgs, idle};
use crate::distractor_trace::FORMAT as DISTRACTOR_FORMAT;
use crate::frames::draw_frames;
use crate::replay::{EpisodeErrors, environment_of, replay_episode};
use crate::{Error, Trace};
use vibes_env::render::{Look, MAX_SIZE, RenderSettings};
use vibes_env::{Environment, EnvironmentOptions};

/// An error that two numbers may have, from 0 up.
fn error_of_at_least_0(text: &str) -> Result<f64, String> {
    let found = text.parse::<f64>().ok().filter(|error| error.is_finite() && *error >= 0.0);
    found.ok_or_else(|| "an error is a finite number of at least 0".to_owned())
}

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    #[command(flatten)]
    given: Given,
    /// A trace in the format vibes-trace/1 or vibes-distractor-trace/1, or a recording.
    trace: PathBuf,
    /// Which episode of a recording.
    #[arg(long, value_name = "N", default_value_t = 0)]
    episode: u32,
    /// Write what this simulator computes, in the format vibes-trace/1.
    #[arg(long, value_name = "GOT.json")]
    out: Option<PathBuf>,
    /// Largest error that still counts as agreement.
    #[arg(long, default_value_t = 1e-9, value_parser = error_of_at_least_0)]
    tolerance: f64,
    /// Draw every step without distractors into this folder, one PNG each (not of a distractor trace).
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Side of those pictures, pixels.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=MAX_SIZE as i64))]
    size: u32,
    /// Folder with a distractor trace's video: draw its pictures too, and compare them.
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// The look of the pictures: suite, or fast. Those of a distractor trace agree: suite if it is off by at most 2 of 255 on average, and fast if it has a PSNR of at least 28 dB.
    #[arg(long, default_value = "suite")]
    render: Look,
}

/// Only what says which kind of trace a file is.
#[derive(serde::Deserialize)]
struct Header {
    format: String,
}

fn is_distractor_trace(path: &PathBuf) -> Result<bool> {
    let text = std::fs::read_to_string(path).map_err(Error::io("read the trace", path))?;
    Ok(serde_json::from_str::<Header>(&text).is_ok_and(|header| header.format == DISTRACTOR_FORMAT))
}

pub(super) fn run(args: &ReplayArgs, output: OutputArgs) -> Result<Outcome> {
    if Recording::folder_of(&args.trace).is_dir() {
        args.refuse(&["videos"], "a recording is replayed without its videos")?;
        return replay_recording(args, output);
    }
    if is_distractor_trace(&args.trace)? {
        let why = "a trace of distractors is compared, and nothing of it written or drawn into a folder";
        args.refuse(&["episode", "out", "frames", "size"], why)?;
        if args.videos.is_none() {
            args.refuse(&["render"], "without --videos no picture is drawn")?;
        }
        let pictures = args.videos.as_deref().map(|videos| Pictures { videos, look: args.render });
        return replay_distractors::run(&args.trace, args.tolerance, pictures, output);
    }
    args.refuse(&["episode", "videos"], "a trace has one episode and no videos")?;
    args.refuse_pictures()?;
    let trace = Trace::read(&args.trace)?;
    let got = trace.replay().map_err(|error| error.in_file(&args.trace))?;
    let mut environment = Environment::new(&trace.task, EnvironmentOptions::default())?;
    args.write(&mut environment, &got, &got.qpos_trace)?;
    let errors = trace.compare(&got);
    let named = [("observations", errors.observations), ("rewards", errors.rewards), ("qpos", errors.qpos)];
    args.say(&named, errors.largest(), output)
}

/// Simulates one episode of a recording again.
fn replay_recording(args: &ReplayArgs, output: OutputArgs) -> Result<Outcome> {
    args.refuse_pictures()?;
    let recording = Recording::open(&args.trace)?;
    let again = replay_episode(&recording, args.episode).map_err(|error| error.in_file(recording.path()))?;
    let mut environment = environment_of(&recording, args.episode)?;
    args.write(&mut environment, &again.trace, &again.positions)?;
    let EpisodeErrors { qpos, qvel, observations, rewards } = again.errors;
    let named = [("observations", observations), ("rewards", rewards), ("qpos", qpos), ("qvel", qvel)];
    args.say(&named.map(|(name, error)| (name, Some(error))), again.errors.largest(), output)
}

impl ReplayArgs {
    /// Refuses options that have no effect on what is replayed.
    fn refuse(&self, options: &[&str], why: &str) -> crate::Result<()> {
        let given = self.given.first_of(options.iter().copied());
        given.map_or(Ok(()), |option| Err(idle::option(&option, why, "leave it out")))
    }

    /// Refuses options about pictures where none are drawn.
    fn refuse_pictures(&self) -> crate::Result<()> {
        if self.frames.is_some() {
            Ok(())
        } else {
            self.refuse(&["size", "render"], "pictures are drawn with --frames")
        }
    }

    /// The trace and the pictures, where they are asked for.
    fn write(&self, environment: &mut Environment, got: &Trace, positions: &[Vec<f64>]) -> Result<()> {
        if let Some(path) = &self.out {
            got.write(path).with_context(|| "the replayed trace".to_owned())?;
        }
        if let Some(folder) = &self.frames {
            let settings = RenderSettings { size: self.size as usize, look: self.render };
            draw_frames(environment, &got.start, positions, settings, folder)?;
        }
        Ok(())
    }

    #[allow(clippy::print_stdout, reason = "the command line's result")]
    fn say(&self, named: &[(&str, Option<f64>)], largest: f64, output: OutputArgs) -> Result<Outcome> {
        if output.json {
            let errors = named.iter().map(|(name, error)| ((*name).to_owned(), number(*error)));
            println!("{}", Value::Object(errors.collect()));
        } else if !output.quiet {
            let shown =
                |error: &Option<f64>| error.map_or("not in the trace".to_owned(), |error| format!("{error:.3e}"));
            let errors: Vec<String> = named.iter().map(|(name, error)| format!("{name} {}", shown(error))).collect();
            println!("largest error: {}", errors.join(", "));
        }
        Ok(if largest <= self.tolerance { Outcome::Done } else { Outcome::Failed })
    }
}
