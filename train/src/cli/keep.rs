//! `vibes-train keep`: a small copy of a run.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_train::keep::keep;
use vibes_train::run::Run;

use super::Context;

#[derive(Debug, Args)]
pub(crate) struct KeepArgs {
    /// A run folder; its newest checkpoint is kept.
    run: PathBuf,
    /// The folder to make.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

pub(crate) fn run(context: &Context, args: &KeepArgs) -> Result<()> {
    let kept = keep(&Run::open(&args.run)?, &args.output)?;
    if context.json {
        println!("{}", serde_json::json!({ "run": args.output, "update": kept.update, "bytes": kept.bytes }));
    } else if !context.quiet {
        let megabytes = kept.bytes as f64 / 1e6;
        println!("kept after {} updates, {megabytes:.1} MB: {}", kept.update, args.output.display());
    }
    Ok(())
}
