//! `vibes-collect extend RECORDING`: more rows, columns or episodes.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{Grid, Recording};

use super::record::{parse_grid, record_with_progress};
use super::{Outcome, OutputArgs};
use crate::extend::{ExtendRun, Size, extend};
use crate::recorder::cores;
use crate::trained::Home;

#[derive(Debug, Args)]
pub(super) struct ExtendArgs {
    /// The recording's folder.
    recording: PathBuf,
    /// State trajectories × distractor trajectories it is to have, as in 12x10.
    #[arg(long, value_parser = parse_grid, conflicts_with = "episodes", required_unless_present = "episodes")]
    grid: Option<Grid>,
    /// Episodes a recording without a grid is to have.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(vibes_data::MOST_EPISODES)))]
    episodes: Option<u32>,
    /// Worker threads, each with a render context; at most one per core, the default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

pub(super) fn run(args: &ExtendArgs, output: OutputArgs) -> Result<Outcome> {
    let size = args.grid.map_or_else(|| Size::Episodes(args.episodes.unwrap_or(1)), Size::Grid);
    let run =
        ExtendRun { threads: args.threads.map_or_else(cores, usize::from), stop: vibes_command::stop_on_signals()? };
    let home = Home::default();
    let folder = Recording::folder_of(&args.recording);
    record_with_progress(folder, (u64::from(size.episodes()), &home), output, |report| {
        extend(folder, size, run, report)
    })
}
