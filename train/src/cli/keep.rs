//! `vibes-train keep`: a small copy of a run.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_train::keep::{Extent, keep};
use vibes_train::run::Run;

use super::Context;

#[derive(Debug, Args)]
pub(crate) struct KeepArgs {
    /// A run folder; its newest checkpoint is kept.
    run: PathBuf,
    /// The folder to make.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Leave the adversary out: enough to encode and to act, not to train on.
    #[arg(long)]
    acting: bool,
}

pub(crate) fn run(context: &Context, args: &KeepArgs) -> Result<()> {
    let extent = if args.acting { Extent::Acting } else { Extent::Training };
    let kept = keep(&Run::open(&args.run)?, &args.output, extent)?;
    if context.json {
        println!("{}", serde_json::json!({ "run": args.output, "update": kept.update, "bytes": kept.bytes }));
    } else if !context.quiet {
        let megabytes = kept.bytes as f64 / 1e6;
        println!("kept after {} updates, {megabytes:.1} MB: {}", kept.update, args.output.display());
    }
    Ok(())
}
