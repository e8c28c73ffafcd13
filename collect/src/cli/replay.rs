//! `vibes-collect replay TRACE.json`: simulates a trace again and compares, or feeds a distractor trace through the distractors.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use super::replay_distractors::{self, Pictures};
use super::{Outcome, OutputArgs};
use crate::distractor_trace::FORMAT as DISTRACTOR_FORMAT;
use crate::render::Look;
use crate::{Error, Trace};

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// A trace in the vibes-trace/1 format, or a vibes-distractor-trace/1.
    trace: PathBuf,
    /// Write what this simulator makes of it, in the same format.
    #[arg(long, value_name = "GOT.json")]
    out: Option<PathBuf>,
    /// Largest error that still counts as agreement.
    #[arg(long, default_value_t = 1e-9)]
    tolerance: f64,
    /// Folder with a distractor trace's video: draw its pictures too, and compare them.
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// The look of those pictures: suite (at most 2 levels of 255 off) or fast (at least 28 dB).
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

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &ReplayArgs, output: OutputArgs) -> Result<Outcome> {
    if is_distractor_trace(&args.trace)? {
        let pictures = args.videos.as_deref().map(|videos| Pictures { videos, look: args.render });
        return replay_distractors::run(&args.trace, args.tolerance, pictures, output);
    }
    let trace = Trace::read(&args.trace)?;
    let got = trace.replay()?;
    if let Some(path) = &args.out {
        got.write(path).with_context(|| "the replayed trace".to_owned())?;
    }
    let errors = trace.compare(&got);
    if output.json {
        println!("{}", serde_json::to_string(&errors)?);
    } else if !output.quiet {
        let shown = |error: Option<f64>| error.map_or("not in the trace".to_owned(), |error| format!("{error:.3e}"));
        let [observations, rewards, qpos] = [errors.observations, errors.rewards, errors.qpos].map(shown);
        println!("largest error: observations {observations}, rewards {rewards}, qpos {qpos}");
    }
    Ok(if errors.largest() <= args.tolerance { Outcome::Done } else { Outcome::Failed })
}
