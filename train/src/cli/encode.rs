//! `vibes-train encode`: a recording's latents.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use clap::Args;
use indicatif::ProgressBar;
use vibes_data::Recording;
use vibes_model::Model;
use vibes_model::trained::Trained;
use vibes_train::encode::encode_recording;
use vibes_train::trained::TrainedRun;

use super::device::DeviceArgs;
use super::{Context, check_arrow_place};

#[derive(Debug, Args)]
pub(crate) struct EncodeArgs {
    /// A run folder; its newest checkpoint is used. Or a model.safetensors.
    run: PathBuf,
    /// The recording to encode.
    recording: PathBuf,
    /// Where to write the latents [default: RUN/latents.arrow].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(crate) fn run(context: &Context, args: &EncodeArgs) -> Result<()> {
    let device = args.device.open()?;
    let (trained, checkpoint) = if args.run.is_file() {
        (Trained::World(Box::new(Model::load(&args.run, &device)?)), args.run.clone())
    } else {
        TrainedRun::open(&args.run)?.load(&device)?
    };
    let folder = if args.run.is_file() { args.run.parent().unwrap_or(Path::new("")) } else { &args.run };
    let output = args.output.clone().unwrap_or_else(|| folder.join("latents.arrow"));
    let recording = Recording::open(&args.recording)?;
    make_room(&output)?;
    check_arrow_place(&output)?;
    let rows: u64 = recording.episodes().iter().map(|episode| u64::from(episode.steps) + 1).sum();
    let bar =
        if context.quiet || !std::io::stderr().is_terminal() { ProgressBar::hidden() } else { ProgressBar::new(rows) };
    let encoder = trained.encoder();
    let task = &recording.manifest().spec.task;
    if task != encoder.task() && !context.quiet {
        eprintln!("note: the run was trained on {}; this is a recording of {task}", encoder.task());
    }
    encode_recording(encoder, &checkpoint, &recording, &output, &device, &mut |done| bar.set_position(done))?;
    bar.finish_and_clear();
    report(context, rows, encoder.latent(), &checkpoint, &output);
    Ok(())
}

/// Makes the folder that a file is to be written into, as the other programs do.
pub(super) fn make_room(output: &Path) -> Result<()> {
    let folder = output.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))
}

fn report(context: &Context, rows: u64, dims: usize, checkpoint: &Path, output: &Path) {
    if context.json {
        println!("{}", serde_json::json!({ "latents": output, "rows": rows, "dims": dims, "checkpoint": checkpoint }));
    } else if !context.quiet {
        println!("{rows} latents of {} dimensions by {}: {}", dims, checkpoint.display(), output.display());
    }
}
