//! `vibes-collect export REC --format F -o OUT`: writes a recording in the formats of others.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use vibes_data::Recording;

use super::{Outcome, OutputArgs, show};
use crate::care::export::{ExportFormat, Pictures, export_until};

/// Write a recording as a Minari or LeRobot dataset, or as plain Parquet.
///
/// What is lost:
///
/// minari: nothing of a row; the logs. Observations become a Dict of pixels and parts, states and distractors go into infos, and an import
/// brings all of it back.
///
/// lerobot: the last observation of every episode (a frame has an action), the model overrides, policies and seeds, the logs; in videos half the
/// resolution of colours (H.264, 4:2:0, otherwise exact to rounding), with --pictures png nothing of a picture.
///
/// parquet: the logs. recording.json is the manifest.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// The recording's folder.
    path: PathBuf,
    /// The format.
    #[arg(long, value_enum)]
    format: Format,
    /// How pictures are stored [default: minari raw, lerobot video, parquet png].
    #[arg(long, value_enum)]
    pictures: Option<PicturesArg>,
    /// The new folder; a Minari dataset is named after it.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Minari 0.5, Arrow storage.
    Minari,
    /// LeRobot v3.
    Lerobot,
    /// The recording's own columns, one Parquet file an episode.
    Parquet,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PicturesArg {
    /// Three bytes a pixel.
    Raw,
    /// A PNG each.
    Png,
    /// H.264 in MP4.
    Video,
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
pub(super) fn run(args: &ExportArgs, output: OutputArgs) -> Result<Outcome> {
    let recording = Recording::open(&args.path)?;
    let format = match args.format {
        Format::Minari => ExportFormat::Minari,
        Format::Lerobot => ExportFormat::Lerobot,
        Format::Parquet => ExportFormat::Parquet,
    };
    let pictures = args.pictures.map(|pictures| match pictures {
        PicturesArg::Raw => Pictures::Raw,
        PicturesArg::Png => Pictures::Png,
        PicturesArg::Video => Pictures::Video,
    });
    let report = export_until(&recording, format, pictures, &args.output, vibes_command::stop_on_signals()?)?;
    if output.json {
        println!("{}", serde_json::json!({ "output": args.output, "report": report }));
    } else if !output.quiet {
        let size = show::bytes(report.bytes);
        println!("{}: {} episodes, {} rows, {size}", args.output.display(), report.episodes, report.rows);
        if report.left_out > 0 {
            println!("left out: {} episodes without a step, which the format cannot hold", report.left_out);
        }
    }
    Ok(Outcome::Done)
}
