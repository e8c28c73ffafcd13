//! The command line of `vibes-collect`: arguments, dispatch, progress, exit codes. The only part of this package that prints.

mod axis_seeds;
mod bench;
mod export;
mod extend;
mod filter;
mod idle;
mod import;
mod info;
mod merge;
mod number;
mod preview;
mod record;
mod render;
mod replay;
mod replay_distractors;
mod show;
mod split;
mod verify;
mod videos;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vibes_command::{Ending as Outcome, Output as OutputArgs};

use crate::Error;

/// Record MuJoCo rollouts under the Distracting Control Suite's distractors.
///
/// Without a verb it records: `vibes-collect --grid 10x10` records the task reacher-easy, 10 state trajectories under 10 distractor trajectories each.
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

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print what a recording holds.
    Info(info::InfoArgs),
    /// Check a recording: checksums and alignment; simulate it and draw a sample of its pictures anew, and compare.
    Verify(verify::VerifyArgs),
    // These five say what they are themselves, at length: a line here would stand in the place of all of it.
    Merge(merge::MergeArgs),
    Split(split::SplitArgs),
    Filter(filter::FilterArgs),
    Export(export::ExportArgs),
    Import(import::ImportArgs),
    /// Simulate a trace or a recorded episode anew and compare.
    Replay(replay::ReplayArgs),
    /// Make a recording larger: more rows, columns or episodes, as if it had been recorded that large from the start.
    Extend(extend::ExtendArgs),
    /// Draw a recording anew: with other distractors, at another size, in another look, or without distractors.
    Render(Box<render::RenderArgs>),
    /// Draw one sheet of pictures per task and difficulty.
    Preview(preview::PreviewArgs),
    /// Measure how fast this machine simulates, draws and writes.
    Bench(bench::BenchArgs),
}

/// Runs the program on this process's arguments.
pub fn main() -> ExitCode {
    vibes_command::run(dispatch, judge)
}

fn dispatch(cli: Cli) -> anyhow::Result<Outcome> {
    match cli.verb {
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
    }
}

/// How an error ends the program: a name or text that cannot be is the caller's to mend, a folder that another process writes into will be free, and what was
/// stopped is to be begun again.
fn judge(error: &anyhow::Error) -> Outcome {
    use vibes_data::Error::Owned;
    let is_wrong = match error.downcast_ref::<Error>() {
        Some(Error::Data(Owned { .. }) | Error::Stopped | Error::World(vibes_env::Error::Stopped)) => {
            return Outcome::Again;
        }
        Some(Error::World(world)) => is_wrong_argument(world),
        Some(error) => {
            matches!(error, Error::UnknownName { .. } | Error::Shrinks { .. } | Error::Selection { .. })
        }
        None => error.downcast_ref::<vibes_env::Error>().is_some_and(is_wrong_argument),
    };
    if is_wrong { Outcome::Wrong } else { Outcome::Failed }
}

/// Whether the world refused because of what was typed.
fn is_wrong_argument(error: &vibes_env::Error) -> bool {
    use vibes_env::Error as World;
    matches!(
        error,
        World::UnknownTask { .. } | World::UnknownName { .. } | World::Policy { .. } | World::NoRotation { .. }
    )
}
