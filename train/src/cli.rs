//! The command line of `vibes-train`: what may be typed, and the exit code it ends with.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the command line is where results and errors are printed"
)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vibes_command::{Ending, Output};
use vibes_train::TrainError;

mod bench;
mod decode;
mod device;
mod encode;
mod evaluate;
mod flags;
mod info;
mod keep;
mod model_free;
mod offline;
mod online;
mod online_progress;
mod progress;
mod sweep;
mod videos;
mod window_log;

/// Fit VIBES and its ablations to recordings, and encode recordings into latents.
#[derive(Debug, Parser)]
#[command(name = "vibes-train", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    output: Output,
}

/// What every command gets beside its own options.
#[derive(Debug, Clone)]
struct Context {
    verbose: bool,
    quiet: bool,
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train on recordings; a run that is there goes on where it stopped.
    Offline(offline::OfflineArgs),
    /// Train in the environment, from nothing or on from an offline run; a run that is there goes on where it stopped.
    Online(Box<online::OnlineArgs>),
    /// Write the latents of a recording (posterior means of every row).
    Encode(encode::EncodeArgs),
    /// Fit a picture decoder on frozen latents, and draw what they show and what the dynamics predict.
    Decode(decode::DecodeArgs),
    /// Measure how good a run's latents are, on a held-out grid.
    Evaluate(evaluate::EvaluateArgs),
    /// Say what a run holds and how far it got.
    Info(info::InfoArgs),
    /// Make a small copy of a run: newest weights in half precision, options, curves.
    Keep(keep::KeepArgs),
    /// Measure how long an update takes, by part.
    Bench(bench::BenchArgs),
    /// Train many runs from one plan: grids, lists, seeds; here or by Slurm, xargs, GNU parallel.
    Sweep(sweep::SweepArgs),
}

/// Runs the program on this process's arguments.
pub(crate) fn main() -> ExitCode {
    vibes_command::run(dispatch, judge)
}

/// How an error ends the program: options that cannot be are the caller's to mend, a folder that another process writes into will be free, and what was stopped goes on.
fn judge(error: &anyhow::Error) -> Ending {
    match error.downcast_ref() {
        Some(TrainError::Options(_)) => Ending::Wrong,
        Some(TrainError::Data(vibes_data::Error::Owned { .. }) | TrainError::World(vibes_env::Error::Stopped)) => {
            Ending::Again
        }
        _ => Ending::Failed,
    }
}

fn dispatch(cli: Cli) -> anyhow::Result<Ending> {
    let Output { verbose, quiet, json } = cli.output;
    let context = Context { verbose, quiet, json };
    match cli.command {
        Command::Offline(args) => return offline::run(&context, args),
        Command::Online(args) => return online::run(&context, &args),
        Command::Sweep(args) => return sweep::run(&context, &args, dispatch),
        Command::Encode(args) => encode::run(&context, &args)?,
        Command::Decode(args) => decode::run(&context, &args)?,
        Command::Evaluate(args) => evaluate::run(&context, &args)?,
        Command::Info(args) => info::run(&context, &args)?,
        Command::Keep(args) => keep::run(&context, &args)?,
        Command::Bench(args) => match args.system.clone() {
            Some(system) => bench::of_agent(&context, &args, &system)?,
            None => bench::run(&context, &args)?,
        },
    }
    Ok(Ending::Done)
}

/// That a file can be written at a place: its folder is there, and it is none itself. To be known before anything is computed.
fn check_place(output: &std::path::Path) -> anyhow::Result<()> {
    if output.is_dir() {
        let text = format!("-o names a folder; name a file in it: {}", output.display());
        return Err(TrainError::Options(text).into());
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir());
    folder.map_or(Ok(()), |folder| {
        let text = format!("-o names a folder that is not there: {}", folder.display());
        Err(TrainError::Options(text).into())
    })
}

/// That an Arrow file can be written at a place that was named, and is called one.
fn check_arrow_place(output: &std::path::Path) -> anyhow::Result<()> {
    check_place(output)?;
    if output.extension().is_some_and(|extension| extension == "arrow") {
        return Ok(());
    }
    Err(TrainError::Options(format!("-o names an Arrow file, which must end in .arrow: {}", output.display())).into())
}

/// `runs/<recording>-<objective>` beside nothing in particular: in the current folder.
fn default_run(recording: &std::path::Path, objective: &str) -> PathBuf {
    let absolute = std::path::absolute(recording).unwrap_or_else(|_| recording.to_owned());
    let name = absolute.file_name().map_or_else(|| "recording".into(), |name| name.to_string_lossy().into_owned());
    PathBuf::from("runs").join(format!("{name}-{objective}"))
}
