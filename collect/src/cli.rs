//! The command line of `vibes-collect`: arguments, dispatch, progress, exit codes. The only part of this package that prints.

mod axis_seeds;
mod bench;
mod config;
mod export;
mod extend;
mod filter;
mod import;
mod info;
mod merge;
mod preview;
mod record;
mod render;
mod replay;
mod replay_distractors;
mod show;
mod split;
mod verify;

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::Error;

/// Record MuJoCo rollouts under the Distracting Control Suite's distractors.
///
/// Without a verb it records: `vibes-collect --grid 10x10` makes reacher-easy, 10 state trajectories under 10 distractor trajectories each.
/// A recording that was stopped goes on with the same command.
#[derive(Debug, Parser)]
#[command(name = "vibes-collect", version, args_conflicts_with_subcommands = true, args_override_self = true)]
struct Cli {
    #[command(subcommand)]
    verb: Option<Verb>,
    #[command(flatten)]
    record: record::RecordArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// How much is said, and in which form.
#[derive(Clone, Copy, Debug, Default, Args)]
struct OutputArgs {
    /// Say more.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Say nothing but errors.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Print the result as one JSON object.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print what a recording holds.
    Info(info::InfoArgs),
    /// Check a recording: checksums, alignment, physics simulated again, and a sample drawn again.
    Verify(verify::VerifyArgs),
    /// Join recordings of one spec into a new one.
    Merge(merge::MergeArgs),
    /// Divide a recording by share, so that what is held out is clean.
    Split(split::SplitArgs),
    /// Keep some of a recording's episodes, by return, policy, or place in the grid.
    Filter(filter::FilterArgs),
    /// Write a recording as a Minari or LeRobot dataset, or as plain Parquet.
    Export(export::ExportArgs),
    /// Make a recording of a Dreamer or Minari dataset.
    Import(import::ImportArgs),
    /// Simulate a trace or a recorded episode again and compare.
    Replay(replay::ReplayArgs),
    /// Make a recording larger: more rows, columns or episodes, as if it had been recorded so large.
    Extend(extend::ExtendArgs),
    /// Draw a recording again: other distractors, another size or look, or none.
    Render(Box<render::RenderArgs>),
    /// Draw one contact sheet per task and difficulty.
    Preview(preview::PreviewArgs),
    /// Print the rate card: how fast this machine simulates and draws.
    Bench(bench::BenchArgs),
}

/// How a run ended, as the exit code says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Everything asked for is there.
    Done,
    /// It ran, and the answer is no.
    Failed,
    /// It finished, but something recorded is damaged or missing.
    DataLost,
}

/// Runs the program on this process's arguments.
pub fn main() -> ExitCode {
    let arguments = match config::with_config_file(std::env::args_os().collect()) {
        Ok(arguments) => arguments,
        Err(error) => return report(&error),
    };
    let cli = Cli::parse_from(arguments);
    let outcome = match cli.verb {
        None => record::run(cli.record, cli.output),
        Some(Verb::Info(args)) => info::run(&args, cli.output),
        Some(Verb::Verify(args)) => verify::run(&args, cli.output),
        Some(Verb::Merge(args)) => merge::run(&args, cli.output),
        Some(Verb::Split(args)) => split::run(&args, cli.output),
        Some(Verb::Filter(args)) => filter::run(&args, cli.output),
        Some(Verb::Export(args)) => export::run(&args, cli.output),
        Some(Verb::Import(args)) => import::run(&args, cli.output),
        Some(Verb::Replay(args)) => replay::run(&args, cli.output),
        Some(Verb::Extend(args)) => extend::run(&args, cli.output),
        Some(Verb::Render(args)) => render::run(&args, cli.output),
        Some(Verb::Preview(args)) => preview::run(&args, cli.output),
        Some(Verb::Bench(args)) => bench::run(&args, cli.output),
    };
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::DataLost) => ExitCode::from(3),
        Err(error) => report(&error),
    }
}

/// Prints an error; a name or text that cannot be is the caller's to mend, and exits with 2 like clap's own.
#[allow(clippy::print_stderr, reason = "the command line reports errors")]
fn report(error: &anyhow::Error) -> ExitCode {
    eprintln!("vibes-collect: {error:#}");
    let is_wrong = match error.downcast_ref::<Error>() {
        Some(Error::World(world)) => is_wrong_argument(world),
        Some(error) => {
            matches!(error, Error::UnknownName { .. } | Error::Shrinks { .. } | Error::Selection { .. })
        }
        None => error.downcast_ref::<vibes_env::Error>().is_some_and(is_wrong_argument),
    };
    ExitCode::from(if is_wrong { 2 } else { 1 })
}

/// Whether the world refused because of what was typed.
fn is_wrong_argument(error: &vibes_env::Error) -> bool {
    use vibes_env::Error as World;
    matches!(
        error,
        World::UnknownTask { .. } | World::UnknownName { .. } | World::Policy { .. } | World::NoRotation { .. }
    )
}
