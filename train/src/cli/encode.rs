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
use vibes_train::same_world::LearnedWorld;
use vibes_train::trained::TrainedRun;

use super::device::DeviceArgs;
use super::{Context, check_arrow_place};

#[derive(Debug, Args)]
pub(crate) struct EncodeArgs {
    /// A run folder; its newest checkpoint is used. Or a model.safetensors.
    run: PathBuf,
    /// The recording to encode.
    recording: PathBuf,
    /// Where to write the latents [default: RUN/latents.arrow, also of a model.safetensors in RUN; of one elsewhere latents.arrow beside it].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(crate) fn run(context: &Context, args: &EncodeArgs) -> Result<()> {
    let device = args.device.open()?;
    let (trained, checkpoint, run) = if args.run.is_file() {
        let model = Model::load(&args.run, &device)?;
        (Trained::World(Box::new(model)), args.run.clone(), run_of(&args.run))
    } else {
        let (trained, checkpoint) = TrainedRun::open(&args.run)?.load(&device)?;
        (trained, checkpoint, Some(args.run.clone()))
    };
    let beside = || args.run.parent().unwrap_or(Path::new("")).to_owned();
    let place = || run.clone().unwrap_or_else(beside).join("latents.arrow");
    let output = args.output.clone().unwrap_or_else(place);
    let recording = Recording::open(&args.recording)?;
    make_room(&output)?;
    check_arrow_place(&output)?;
    let rows: u64 = recording.episodes().iter().map(|episode| u64::from(episode.steps) + 1).sum();
    let bar =
        if context.quiet || !std::io::stderr().is_terminal() { ProgressBar::hidden() } else { ProgressBar::new(rows) };
    let encoder = trained.encoder();
    let other = world_of(run.as_deref(), encoder.task()).difference(&LearnedWorld::of(&recording));
    if let Some((found, learned)) = other.filter(|_| !context.quiet) {
        eprintln!("note: the run was trained on {learned}; this is a recording of {found}");
    }
    encode_recording(encoder, &checkpoint, &recording, &output, &device, &mut |done| bar.set_position(done))?;
    bar.finish_and_clear();
    report(context, rows, encoder.latent(), &checkpoint, &output);
    Ok(())
}

/// The run in which a model file is that of a checkpoint, as `RUN/checkpoints/000500/model.safetensors`: what is written beside the file itself would be taken for a part of the
/// checkpoint.
fn run_of(file: &Path) -> Option<PathBuf> {
    let file = std::path::absolute(file).ok()?;
    let checkpoints = file.parent()?.parent()?;
    let run = checkpoints.parent().filter(|run| run.join("run.json").is_file())?;
    (checkpoints.file_name()? == "checkpoints").then(|| run.to_owned())
}

/// The world that was learned from: of a run that can be opened as it says, of a model file the task alone.
fn world_of(run: Option<&Path>, task: &str) -> LearnedWorld {
    let known = run.and_then(|run| TrainedRun::open(run).ok()?.world().ok());
    known.unwrap_or_else(|| LearnedWorld { task: task.to_owned(), action_repeat: None, is_imported: false })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_file_of_a_checkpoint_is_known_by_its_run() {
        let folder = tempfile::tempdir().unwrap();
        let run = std::path::absolute(folder.path()).unwrap();
        let checkpoint = run.join("checkpoints/000500");
        std::fs::create_dir_all(&checkpoint).unwrap();
        let file = checkpoint.join("model.safetensors");
        assert_eq!(run_of(&file), None, "no run is there");
        std::fs::write(run.join("run.json"), "{}").unwrap();
        assert_eq!(run_of(&file), Some(run.clone()));
        assert_eq!(run_of(&run.join("copies/000500/model.safetensors")), None, "no checkpoint of its own");
        assert_eq!(run_of(&run.join("model.safetensors")), None);
    }
}
