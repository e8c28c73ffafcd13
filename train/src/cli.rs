//! The command line of `vibes-train`: what may be typed, and the exit code it ends with.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the command line is where results and errors are printed"
)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vibes_train::TrainError;

mod bench;
mod decode;
mod device;
mod encode;
mod evaluate;
mod flags;
mod info;
mod model_free;
mod offline;
mod online;
mod online_progress;
mod progress;

/// Fit VIBES and its ablations to recordings, and encode recordings into latents.
#[derive(Debug, Parser)]
#[command(name = "vibes-train", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    context: Context,
}

/// Options of every command.
#[derive(Debug, Clone, clap::Args)]
struct Context {
    /// Say more.
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Say nothing but errors and results.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Results as JSON on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Where tensors live.
    #[arg(long, global = true, default_value = "flex", value_name = "DEVICE")]
    device: device::DeviceName,
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
    /// Measure how long an update takes, by part.
    Bench(bench::BenchArgs),
}

/// Reads the arguments, runs the command, and turns its outcome into an exit code: 0 done, 1 failed, 2 wrong arguments.
pub(crate) fn run() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        Command::Offline(args) => offline::run(&cli.context, args),
        Command::Online(args) => online::run(&cli.context, &args),
        Command::Encode(args) => encode::run(&cli.context, &args),
        Command::Decode(args) => decode::run(&cli.context, &args),
        Command::Evaluate(args) => evaluate::run(&cli.context, &args),
        Command::Info(args) => info::run(&cli.context, &args),
        Command::Bench(args) => match args.system.clone() {
            Some(system) => bench::of_agent(&cli.context, &args, &system),
            None => bench::run(&cli.context, &args),
        },
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            match error.downcast_ref() {
                Some(TrainError::Options(_)) => ExitCode::from(2),
                _ => ExitCode::FAILURE,
            }
        }
    }
}

/// `runs/<recording>-<objective>` beside nothing in particular: in the current folder.
fn default_run(recording: &std::path::Path, objective: &str) -> PathBuf {
    let absolute = std::path::absolute(recording).unwrap_or_else(|_| recording.to_owned());
    let name = absolute.file_name().map_or_else(|| "recording".into(), |name| name.to_string_lossy().into_owned());
    PathBuf::from("runs").join(format!("{name}-{objective}"))
}
