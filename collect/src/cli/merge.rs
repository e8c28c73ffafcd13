//! `vibes-collect merge A B … -o OUT`: joins recordings of one spec.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{FileTransfer, Recording};

use super::{Outcome, OutputArgs};
use crate::care::merge::merge_until;

/// Join recordings of one spec into a new one.
///
/// Parts of one recording (of a split or a filter, or of the same command on two machines) come together as they were, grid and numbers
/// included. Recordings of different commands become plain episodes, numbered from 0 in the order given: they lose their cells, since
/// row 3 of one grid is not row 3 of another, and files that hold the old number, cell or video are written again. An episode that is in
/// several of them, whatever its number there, is in the new one once.
#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    /// The recordings, two or more.
    #[arg(required = true, num_args = 2..)]
    paths: Vec<PathBuf>,
    /// The new recording's folder.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Copy files instead of linking them.
    #[arg(long)]
    copy: bool,
}

/// How files come over.
pub(super) fn transfer(copy: bool) -> FileTransfer {
    if copy { FileTransfer::Copy } else { FileTransfer::Link }
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
pub(super) fn run(args: &MergeArgs, output: OutputArgs) -> Result<Outcome> {
    let parts = args.paths.iter().map(|path| Recording::open(path)).collect::<vibes_data::Result<Vec<_>>>()?;
    let stop = vibes_command::stop_on_signals()?;
    let (merged, report) = merge_until(&parts, &args.output, transfer(args.copy), stop)?;
    if output.json {
        println!(
            "{}",
            serde_json::json!({ "recording": args.output, "episodes": merged.episodes().len(), "report": report })
        );
    } else if !output.quiet {
        let numbers = if report.kept_numbers {
            "parts of one recording, numbers and cells kept"
        } else {
            "numbered anew, without cells"
        };
        let repeated = match report.repeated {
            0 => String::new(),
            count => format!("; {count} left out that are in an earlier one too"),
        };
        println!(
            "{}: {} episodes, {numbers}; {} taken as they are, {} written again{repeated}",
            args.output.display(),
            merged.episodes().len(),
            report.taken,
            report.rewritten
        );
    }
    Ok(Outcome::Done)
}
