//! How much a program says, and in which form.

use clap::Args;

/// Options of every verb of every program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Args)]
pub struct Output {
    /// Print more: options that were typed, read or have one value by default, where each comes from, and the time it took. What a preset, a task or a run decides stands in the files.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Print nothing but errors and results.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print the result as JSON on standard output.
    #[arg(long, global = true)]
    pub json: bool,
}
