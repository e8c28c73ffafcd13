//! `vibes-collect import --format F DIR -o OUT`: makes a recording of somebody else's dataset.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use vibes_data::MOST_ACTION_REPEAT;

use super::{Outcome, OutputArgs};
use crate::care::import::{ImportFormat, ImportOptions, import_until};

/// Make a recording of a Dreamer or Minari dataset.
///
/// What is lost or filled in:
///
/// dreamer: the action and reward before the first observation (zeros there); arrays that are neither image, action, reward, discount, flags nor float
/// vectors.
///
/// minari: infos, texts, second pictures; choices become zeros and a one. A dataset exported from a recording comes back whole.
///
/// Unless it was exported from a recording, a dataset has no physics state and no distractors: qpos and qvel are empty, the camera is at rest.
#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// The dataset's folder.
    path: PathBuf,
    /// The format.
    #[arg(long, value_enum)]
    format: Format,
    /// The new recording's folder.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// The task's name [default: the dataset's].
    #[arg(long)]
    task: Option<String>,
    /// Seconds of a control step, which datasets do not name [default: 1].
    #[arg(long, value_name = "S", value_parser = seconds)]
    control_timestep: Option<f64>,
    /// Control steps a row [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_ACTION_REPEAT)))]
    action_repeat: Option<u32>,
    /// Write no MCAP logs, only Arrow tables.
    #[arg(long)]
    no_mcap: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// A folder of .npz files as Dreamer, DreamerV2 and V-D4RL write them.
    Dreamer,
    /// A Minari dataset, HDF5 or Arrow storage.
    Minari,
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
pub(super) fn run(args: &ImportArgs, output: OutputArgs) -> Result<Outcome> {
    let format = match args.format {
        Format::Dreamer => ImportFormat::Dreamer,
        Format::Minari => ImportFormat::Minari,
    };
    let options = ImportOptions {
        task: args.task.clone(),
        control_timestep: args.control_timestep,
        action_repeat: args.action_repeat,
        with_mcap: !args.no_mcap,
    };
    let stop = vibes_command::stop_on_signals()?;
    let (_, report) = import_until(format, &args.path, &options, &args.output, stop)?;
    if output.json {
        println!("{}", serde_json::json!({ "recording": args.output, "report": report }));
    } else if !output.quiet {
        println!("{}: {} episodes, {} rows", args.output.display(), report.episodes, report.rows);
        if !report.ignored.is_empty() {
            println!("left out: {}", report.ignored.into_iter().collect::<Vec<_>>().join(", "));
        }
    }
    Ok(Outcome::Done)
}

/// A time of at least a nanosecond, the unit of clocks in logs, and at most a day.
fn seconds(text: &str) -> Result<f64, String> {
    let found = text.parse::<f64>().ok().filter(|seconds| (1e-9..=86_400.0).contains(seconds));
    found.ok_or_else(|| "seconds are a number between 0.000000001 and 86400".to_owned())
}
