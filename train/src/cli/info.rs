//! `vibes-train info`: what a run holds and how far it got.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_train::metrics::{Row, read_rows};
use vibes_train::run::Run;

use super::Context;

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A run folder.
    run: PathBuf,
}

pub(crate) fn run(context: &Context, args: &InfoArgs) -> Result<()> {
    let run = Run::open(&args.run)?;
    let rows = if run.metrics_path().exists() { read_rows(&run.metrics_path())? } else { Vec::new() };
    let checkpoints = run.checkpoints();
    if context.json {
        let last = rows.last();
        println!(
            "{}",
            serde_json::json!({ "run": run.path(), "info": run.info(), "checkpoints": checkpoints, "last": last })
        );
        return Ok(());
    }
    let (info, options) = (run.info(), &run.info().options);
    println!("{}", run.path().display());
    println!("  objective    {} (dynamics weight {})", options.objective, options.dynamics_weight);
    println!(
        "  model        {}, {}, latent {}, depth {}, hidden {}",
        info.model.task, info.model.observation, options.latent, options.depth, options.hidden
    );
    let names = info.recording_names();
    println!("  recordings   {} ({} episodes, {} steps)", names.join(", "), info.episodes, info.steps);
    println!("  checkpoints  {}", checkpoints.iter().map(u64::to_string).collect::<Vec<_>>().join(", "));
    if let Some(last) = rows.last() {
        print_row(last, options.updates);
    }
    Ok(())
}

fn print_row(row: &Row, updates: u64) {
    println!(
        "  updates      {} of {updates}, {:.1} a second, {:.0} frames a second",
        row.update, row.updates_per_second, row.frames_per_second
    );
    let gap = row.stated("gap").map_or(String::new(), |gap| format!(", adversary ahead by {gap:.3}"));
    println!(
        "  latents      log-likelihood under the dynamics {:.3} nats{gap}; effective rank {:.1}",
        row.dynamics_log_likelihood, row.effective_rank
    );
    println!("  reward       log-likelihood {:.3} nats", row.reward_log_likelihood);
}
