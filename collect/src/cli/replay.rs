//! `vibes-collect replay TRACE.json`: simulates a trace again and compares; draws its frames on request.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use super::{Outcome, OutputArgs};
use crate::Trace;

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// A trace in the vibes-trace/1 format.
    trace: PathBuf,
    /// Write what this simulator makes of it, in the same format.
    #[arg(long, value_name = "GOT.json")]
    out: Option<PathBuf>,
    /// Largest error that still counts as agreement.
    #[arg(long, default_value_t = 1e-9)]
    tolerance: f64,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &ReplayArgs, output: OutputArgs) -> Result<Outcome> {
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
