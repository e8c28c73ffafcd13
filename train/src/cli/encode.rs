//! `vibes-train encode`: a recording's latents.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use indicatif::ProgressBar;
use vibes_data::Recording;
use vibes_model::Model;
use vibes_model::sac::{SacAgent, SacNetworks};
use vibes_train::encode::{encode_recording, encode_stacks};
use vibes_train::online::model_free::folder::Folder;
use vibes_train::run::Run;

use super::Context;

#[derive(Debug, Args)]
pub(crate) struct EncodeArgs {
    /// A run folder; its newest checkpoint is used. Or a model.safetensors.
    run: PathBuf,
    /// The recording to encode.
    recording: PathBuf,
    /// Where to write the latents [default: RUN/latents.arrow].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(context: &Context, args: &EncodeArgs) -> Result<()> {
    if let Some(folder) = Folder::open(&args.run)? {
        return of_agent(context, args, &folder);
    }
    let is_file = args.run.is_file();
    let checkpoint = if is_file { args.run.clone() } else { Run::open(&args.run)?.newest_model()? };
    let folder = if is_file { args.run.parent().map(PathBuf::from).unwrap_or_default() } else { args.run.clone() };
    let output = args.output.clone().unwrap_or_else(|| folder.join("latents.arrow"));
    let recording = Recording::open(&args.recording)?;
    let device = context.device.open()?;
    let model = Model::load(&checkpoint, &device)?;
    let rows: u64 = recording.episodes().iter().map(|episode| u64::from(episode.steps) + 1).sum();
    let bar =
        if context.quiet || !std::io::stderr().is_terminal() { ProgressBar::hidden() } else { ProgressBar::new(rows) };
    encode_recording(&model, &checkpoint, &recording, &output, &device, &mut |done| bar.set_position(done))?;
    bar.finish_and_clear();
    report(context, rows, model.config.latent, &checkpoint, &output);
    Ok(())
}

/// The features that an agent without a world model sees.
fn of_agent(context: &Context, args: &EncodeArgs, folder: &Folder) -> Result<()> {
    let checkpoint = folder.newest_networks()?;
    let output = args.output.clone().unwrap_or_else(|| folder.path().join("latents.arrow"));
    let recording = Recording::open(&args.recording)?;
    let device = context.device.open()?;
    let mut agent = SacAgent::new(&SacNetworks::load(&checkpoint, &device)?, &device);
    let rows: u64 = recording.episodes().iter().map(|episode| u64::from(episode.steps) + 1).sum();
    let bar =
        if context.quiet || !std::io::stderr().is_terminal() { ProgressBar::hidden() } else { ProgressBar::new(rows) };
    encode_stacks(&mut agent, &checkpoint, &recording, &output, &mut |done| bar.set_position(done))?;
    bar.finish_and_clear();
    report(context, rows, agent.config().feature, &checkpoint, &output);
    Ok(())
}

fn report(context: &Context, rows: u64, dims: usize, checkpoint: &Path, output: &Path) {
    if context.json {
        println!("{}", serde_json::json!({ "latents": output, "rows": rows, "dims": dims, "checkpoint": checkpoint }));
    } else if !context.quiet {
        println!("{rows} latents of {} dimensions by {}: {}", dims, checkpoint.display(), output.display());
    }
}
