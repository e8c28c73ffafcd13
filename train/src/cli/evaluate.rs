//! `vibes-train evaluate`: how good a run's latents are on a held-out grid.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use clap::Args;
use vibes_data::{Recording, write_atomically};
use vibes_model::Model;
use vibes_train::evaluate::{GapOptions, Gaps, Probe, Report, evaluate, gaps};
use vibes_train::run::Run;

use super::Context;

#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// A run folder; its newest checkpoint is used.
    run: PathBuf,
    /// A grid recording that was not trained on.
    grid: PathBuf,
    /// Updates of the fresh critic that measures the gaps to a bisimulation; 0 leaves them out. Needs the run's recordings.
    #[arg(long, default_value_t = 500, value_name = "N")]
    gap_updates: u64,
    /// Where to write the numbers [default: RUN/evaluation.json].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(context: &Context, args: &EvaluateArgs) -> Result<()> {
    let run = Run::open(&args.run)?;
    let checkpoint = run.newest_model()?;
    let grid = Recording::open(&args.grid)?;
    let device = context.device.open()?;
    let model = Model::load(&checkpoint, &device)?;
    let report = evaluate(&model, &grid, &device)?;
    let gaps = match args.gap_updates {
        0 => None,
        updates => Some(measure_gaps(&run, &model, &grid, updates, &device)?),
    };
    let numbers = serde_json::json!({ "run": run.path(), "checkpoint": checkpoint, "grid": args.grid, "gap_updates": args.gap_updates, "report": report, "gaps": gaps });
    let text = serde_json::to_string_pretty(&numbers)? + "\n";
    let output = args.output.clone().unwrap_or_else(|| run.path().join("evaluation.json"));
    write_atomically(&output, text.as_bytes()).context("cannot write the evaluation")?;
    if context.json {
        print!("{text}");
    } else if !context.quiet {
        print_report(&report);
        if let Some(gaps) = &gaps {
            print_gaps(gaps);
        }
        println!("written: {}", output.display());
    }
    Ok(())
}

fn measure_gaps(
    run: &Run,
    model: &Model,
    grid: &Recording,
    updates: u64,
    device: &burn::tensor::Device,
) -> Result<Gaps> {
    let options = &run.info().options;
    let training = run.info().recordings.iter().map(|path| Recording::open(path)).collect::<Result<Vec<_>, _>>();
    let training = training.context("the gaps need the run's recordings; leave them out with --gap-updates 0")?;
    let options = GapOptions::like(options, updates);
    Ok(gaps(model, &training, grid, options, device)?)
}

fn print_report(report: &Report) {
    println!(
        "same-state retrieval@1   {:.3}   (past actions {:.3}, chance {:.3})",
        report.retrieval_at_1, report.retrieval_at_1_actions, report.retrieval_at_1_chance
    );
    let shares = &report.shares;
    println!(
        "variance shares          state {:.3} (noise {:.3}), distractor {:.3}, interaction {:.3}",
        shares.state, shares.state_of_noise, shares.distractor, shares.interaction
    );
    println!("within a state           {:.3} of all variance", shares.within_state);
    println!("{:<32} {:>8} {:>13} {:>7}", "read by ridge, held out (R²)", "latents", "past actions", "chance");
    let is_color = |probe: &&Probe| [" red", " green", " blue"].iter().any(|channel| probe.name.ends_with(channel));
    for probe in report.probes.iter().filter(|probe| !is_color(probe)) {
        println!(
            "{:<32} {:>8.3} {:>13.3} {:>7.3}",
            format!("{} {}", probe.kind, probe.name),
            probe.latents,
            probe.actions,
            probe.chance
        );
    }
    let colors: Vec<&Probe> = report.probes.iter().filter(is_color).collect();
    if !colors.is_empty() {
        let mean = |of: fn(&Probe) -> f64| colors.iter().map(|probe| of(probe)).sum::<f64>() / colors.len() as f64;
        let name = format!("distractor colours (mean of {})", colors.len());
        println!("{name:<32} {:>8.3} {:>13.3} {:>7.3}", mean(|probe| probe.latents), mean(|probe| probe.actions), 0.0);
    }
}

fn print_gaps(gaps: &Gaps) {
    println!(
        "dynamics gap             {:+.3} nats a row (critic {:.3}, dynamics {:.3})",
        gaps.dynamics_gap, gaps.dynamics_of_critic, gaps.dynamics
    );
    println!(
        "reward gap               {:+.3} nats a row (critic {:.3}, model {:.3})",
        gaps.reward_gap, gaps.reward_of_critic, gaps.reward
    );
}
