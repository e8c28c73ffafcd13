//! `vibes-train decode`: pictures of what a run's latents hold.

use std::collections::HashMap;
use std::io::IsTerminal;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use indicatif::ProgressBar;
use vibes_data::Recording;
use vibes_model::Model;
use vibes_model::checkpoint::save_tensors;
use vibes_train::decode::{DecodeOptions, decode, decoder_tensors};
use vibes_train::run::Run;

use super::device::DeviceArgs;
use super::{Context, check_arrow_place};

#[derive(Debug, Args)]
pub(crate) struct DecodeArgs {
    /// A run folder; its newest checkpoint is used and stays as it is.
    run: PathBuf,
    /// The recording that the decoder is fitted on, as one of those that the run was trained on.
    recording: PathBuf,
    /// The recording whose rows are shown, as a held-out grid [default: the same].
    #[arg(long, value_name = "RECORDING")]
    show: Option<PathBuf>,
    /// Updates of the decoder.
    #[arg(long, value_name = "N", default_value_t = DecodeOptions::default().updates, value_parser = clap::value_parser!(u64).range(1..))]
    updates: u64,
    /// Strips to draw.
    #[arg(long, value_name = "N", default_value_t = DecodeOptions::default().strips as u16, value_parser = clap::value_parser!(u16).range(1..))]
    strips: u16,
    /// Steps of the prediction that sees nothing but the recorded actions.
    #[arg(long, value_name = "STEPS", default_value_t = DecodeOptions::default().horizon)]
    horizon: usize,
    /// Seed of the decoder's first weights and of the rows it is fitted on.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where to write the pictures [default: RUN/decoded.arrow]; the decoder's weights lie beside them.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(crate) fn run(context: &Context, args: &DecodeArgs) -> Result<()> {
    let run = Run::open(&args.run)?;
    let checkpoint = run.newest_model()?;
    let output = args.output.clone().unwrap_or_else(|| args.run.join("decoded.arrow"));
    check_arrow_place(&output)?;
    let weights = output.with_extension("safetensors");
    let fit = Recording::open(&args.recording)?;
    let show = args.show.as_ref().map(|path| Recording::open(path)).transpose()?;
    let device = args.device.open()?;
    let model = Model::load(&checkpoint, &device)?;
    let options = DecodeOptions {
        updates: args.updates,
        strips: usize::from(args.strips),
        horizon: args.horizon,
        seed: args.seed,
        ..DecodeOptions::default()
    };
    let shown = !context.quiet && std::io::stderr().is_terminal();
    let bar = if shown { ProgressBar::new(args.updates) } else { ProgressBar::hidden() };
    let listen = &mut |done| bar.set_position(done);
    let mut decoding =
        decode(&model, &checkpoint, &fit, show.as_ref().unwrap_or(&fit), &output, options, &device, listen)?;
    bar.finish_and_clear();
    decoding.decoded.objective = Some(run.info().options.objective.to_string());
    decoding.decoded.write(&output)?;
    save_tensors(&weights, &decoder_tensors(&decoding.decoder), HashMap::new())?;
    let (first, last) = decoding.errors;
    let explained = decoding.decoded.explained.unwrap_or(f64::NAN);
    if context.json {
        println!(
            "{}",
            serde_json::json!({ "decoded": output, "weights": weights, "explained": explained, "first_error": first, "last_error": last })
        );
    } else if !context.quiet {
        println!(
            "decoder fitted: squared error a pixel from {first:.4} to {last:.4}; {:.0}% of the shown pixels' variance explained",
            100.0 * explained
        );
        println!("written: {}, {}", output.display(), weights.display());
        println!("draw it with: vibes-analyze decode {}", args.output.as_ref().unwrap_or(&args.run).display());
    }
    Ok(())
}
