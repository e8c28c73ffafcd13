//! `vibes-train evaluate`: how good a run's latents are on a held-out grid.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use clap::Args;
use vibes_command::Given;
use vibes_data::{Recording, relative_place, write_atomically};
use vibes_measure::episodes::PROBE_EPISODES;
use vibes_measure::intervals::Interval;
use vibes_measure::numbers::{Number, probe_family};
use vibes_measure::probes::{Fitting, Probe};
use vibes_model::trained::Trained;
use vibes_train::TrainError;
use vibes_train::evaluate::{
    EvaluateOptions, GapOptions, Gaps, GridSize, Likelihoods, Report, check_gaps, evaluate, gaps, is_new_to,
    shared_starts,
};
use vibes_train::run::Seen;
use vibes_train::trained::TrainedRun;

use super::device::DeviceArgs;
use super::{Context, check_place};

#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    #[command(flatten)]
    given: Given,
    /// A run folder; its newest checkpoint is used.
    run: PathBuf,
    /// A grid recording that was not trained on.
    grid: PathBuf,
    /// Recordings that the probes and the gaps' critic are fitted on [default: those that the run was given, or else its replay].
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    fit_on: Vec<PathBuf>,
    /// Updates of the fresh critic that measures the gaps to a bisimulation; 0 leaves them out. Needs a world model, and recordings to fit on.
    #[arg(long, default_value_t = 500, value_name = "N")]
    gap_updates: u64,
    /// Episodes of those recordings that the probes are fitted on, at most; 0, or recordings that are gone: the grid's own trajectories, held out in turn.
    #[arg(long, default_value_t = PROBE_EPISODES, value_name = "N")]
    probe_episodes: usize,
    /// Where to write the numbers [default: RUN/evaluation.json].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

impl EvaluateArgs {
    /// That nothing was given that is not looked at.
    fn check_given(&self, run: &TrainedRun, has_recordings: bool) -> Result<()> {
        let fits_gaps = self.gap_updates > 0 && matches!(run, TrainedRun::World(_));
        let idle = [
            ("fit_on", self.probe_episodes == 0 && !fits_gaps, "nothing is fitted"),
            ("probe_episodes", self.probe_episodes > 0 && !has_recordings, "there are no recordings to fit on"),
            ("gap_updates", self.gap_updates > 0 && !matches!(run, TrainedRun::World(_)), "the run has no world model"),
        ];
        let mut idle = idle.into_iter().filter(|(_, is_idle, _)| *is_idle);
        let found = idle.find_map(|(option, _, why)| Some((self.given.first_of([option])?, why)));
        match found {
            Some((option, why)) => {
                anyhow::bail!(TrainError::Options(format!("{option} has no effect: {why}; leave it out")))
            }
            None => Ok(()),
        }
    }
}

impl EvaluateArgs {
    /// What probes and critic are fitted on. Where the run's own recordings are gone there is nothing; a recording that was named has to be there.
    fn recordings_to_fit(&self, run: &TrainedRun) -> Result<vibes_train::Result<Vec<Recording>>> {
        if self.fit_on.is_empty() {
            return Ok(run.open_recordings());
        }
        let named: vibes_data::Result<Vec<Recording>> = self.fit_on.iter().map(|path| Recording::open(path)).collect();
        Ok(Ok(named?))
    }

    /// Updates of the gaps' critic: none without recordings to fit on, which is an error where they were asked for.
    fn affordable_gaps(
        &self,
        context: &Context,
        run: &TrainedRun,
        training: &vibes_train::Result<Vec<Recording>>,
    ) -> Result<u64> {
        let (Err(gone), true, TrainedRun::World(_)) = (training, self.gap_updates > 0, run) else {
            return Ok(self.gap_updates);
        };
        if self.given.first_of(["gap_updates"]).is_some() {
            anyhow::bail!(
                "the gaps need the run's recordings; name others with --fit-on, or leave the gaps out with --gap-updates 0: {gone}"
            );
        }
        if !context.quiet && !context.json {
            println!("without the gaps to a bisimulation, which need the run's recordings: {gone}");
        }
        Ok(0)
    }
}

pub(crate) fn run(context: &Context, args: &EvaluateArgs) -> Result<()> {
    let run = TrainedRun::open(&args.run)?;
    let training = args.recordings_to_fit(&run)?;
    args.check_given(&run, training.as_ref().is_ok_and(|found| !found.is_empty()))?;
    let grid = Recording::open(&args.grid)?;
    let gap_updates = args.affordable_gaps(context, &run, &training)?;
    let output = args.output.clone().unwrap_or_else(|| run.places().path().join("evaluation.json"));
    let folder = output.parent().unwrap_or(Path::new(""));
    check_place(&output)?;
    let device = args.device.open()?;
    let (trained, checkpoint) = run.load(&device)?;
    let to_fit = match &training {
        Ok(training) if args.probe_episodes > 0 => training.as_slice(),
        _ => &[],
    };
    let options = EvaluateOptions { probe_episodes: args.probe_episodes, ..EvaluateOptions::default() };
    if let (1.., TrainedRun::World(run), Trained::World(model), Ok(training)) = (gap_updates, &run, &trained, &training)
    {
        check_gaps(model, training, &grid, run.info().options.length)?;
    }
    let fits = args.probe_episodes > 0 || (gap_updates > 0 && matches!(trained, Trained::World(_)));
    // The run was trained on its own recordings, whatever is fitted now.
    let mut seen = run.seen();
    if fits && !args.fit_on.is_empty() {
        seen.recordings.extend_from_slice(training.as_deref().unwrap_or_default());
    }
    let is_held_out = tell_held_out(context, &grid, &seen);
    let report = evaluate(trained.encoder(), &grid, to_fit, options, &device)?;
    let gaps = match (gap_updates, &run, &trained) {
        (updates @ 1.., TrainedRun::World(run), Trained::World(model)) => {
            let training = training?;
            Some(gaps(model, &training, &grid, GapOptions::like(&run.info().options, updates), &device)?)
        }
        _ => None,
    };
    let run = run.places();
    let place = |path: &Path| relative_place(path, folder);
    let numbers = serde_json::json!({ "run": place(run.path()), "checkpoint": place(&checkpoint), "grid": place(&args.grid), "is_held_out": is_held_out, "fit_on": args.fit_on.iter().map(|path| place(path)).collect::<Vec<_>>(), "gap_updates": if gaps.is_some() { gap_updates } else { 0 }, "report": report, "gaps": gaps });
    let text = serde_json::to_string_pretty(&numbers)? + "\n";
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

/// Whether a grid is new beside the recordings that were trained or fitted on, which is not known where some of them are gone; where it is not, that is said.
pub(crate) fn tell_held_out(context: &Context, grid: &Recording, seen: &Seen) -> Option<bool> {
    let is_new = is_new_to(grid, seen);
    if is_new == Some(false) && !context.quiet {
        let place = grid.path().display();
        eprintln!(
            "the grid itself, or an episode of it, is among the recordings that are trained or fitted on, so that its numbers say nothing of new episodes: {place}"
        );
    }
    let (shared, all) = shared_starts(grid, &seen.recordings);
    if is_new != Some(false) && shared > 0 && !context.quiet {
        eprintln!(
            "note: {shared} of the grid's {all} state trajectories begin where an episode that is trained or fitted on began (the same seed); record it with another --seed for new states"
        );
    }
    is_new
}

fn print_report(report: &Report) {
    let GridSize { states, distractors, steps, dropped } = &report.grid;
    let remarks = dropped.remarks();
    if !remarks.is_empty() {
        remarks.iter().for_each(|remark| println!("{remark}"));
        println!("shares and retrieval are of {states} × {distractors} trajectories of {steps} steps");
    }
    println!("{:<52} {:>24} {:>13} {:>7}", "number", "latents [95% interval]", "past actions", "chance");
    let is_probe = |number: &&Number| number.name.starts_with("probe");
    report.numbers.iter().filter(|number| !is_probe(number)).for_each(|number| print_number(&number.name, number));
    for fitting in [Fitting::OtherRecordings, Fitting::CrossValidation] {
        print_probes(report, fitting);
    }
    if !report.left_out.is_empty() {
        let names = report.left_out.join(", ");
        println!(
            "not read, since the recordings to fit on do not name them (--probe-episodes 0 fits on the grid itself): {names}"
        );
    }
}

/// What linear probes that were fitted in one way read; nothing if none was.
fn print_probes(report: &Report, fitting: Fitting) {
    let family = probe_family(Probe::Linear, fitting);
    let own = |number: &Number| Some(number.name.strip_prefix(family)?.strip_prefix('/')?.to_owned());
    let linear: Vec<(String, &Number)> =
        report.numbers.iter().filter_map(|number| Some((own(number)?, number))).collect();
    if linear.is_empty() {
        return;
    }
    let on = match (fitting, report.fitted_on) {
        (Fitting::OtherRecordings, Some(episodes)) => format!("fitted on {episodes} episodes"),
        _ => "cross-validated over the grid's own trajectories".to_owned(),
    };
    println!("{family}/…: read by linear probes {on} (R²; of classes such as the video accuracy):");
    let (colors, single): (Vec<_>, Vec<_>) = linear.into_iter().partition(|(name, _)| is_color(name));
    for (name, number) in single {
        let quantity = name.rsplit_once('/').map_or(name.as_str(), |(quantity, _)| quantity);
        print_number(&format!("{}: {name}", report.quantities.get(quantity).unwrap_or(&"")), number);
    }
    // Of each vector by itself, as everywhere else.
    let vector = |name: &str| name.rsplit_once('/').map_or(String::new(), |(_, vector)| vector.to_owned());
    let mut vectors: Vec<String> = colors.iter().map(|(name, _)| vector(name)).collect();
    vectors.sort();
    vectors.dedup();
    for of in vectors {
        let colors: Vec<_> = colors.iter().filter(|(name, _)| vector(name) == of).collect();
        let mean = |of: &dyn Fn(&Number) -> f64| {
            colors.iter().map(|(_, number)| of(number)).sum::<f64>() / colors.len() as f64
        };
        let actions = |number: &Number| number.past_actions.map_or(f64::NAN, |actions| actions.estimate);
        let name = format!("distractor: colours, mean of {}/{of}", colors.len());
        println!(
            "{name:<52} {:>24.3} {:>13.3} {:>7.3}",
            mean(&|n| n.value.estimate),
            mean(&actions),
            mean(&|n| n.chance)
        );
    }
}

/// Whether a probe is of one of the many channels of the materials' colours.
fn is_color(name: &str) -> bool {
    let quantity = name.rsplit_once('/').map_or(name, |(quantity, _)| quantity);
    [" red", " green", " blue"].iter().any(|channel| quantity.ends_with(channel))
}

fn print_number(name: &str, number: &Number) {
    let text = bounded(number.value);
    let actions = number.past_actions.map_or_else(String::new, |actions| format!("{:.3}", actions.estimate));
    let chance = if number.chance.is_finite() { format!("{:.3}", number.chance) } else { String::new() };
    println!("{name:<52} {text:>24} {actions:>13} {chance:>7}");
}

fn print_gaps(gaps: &Gaps) {
    println!(
        "gaps to a bisimulation, nats a row [95% interval]: a fresh critic that sees everything, minus heads refitted on (h, s, a)"
    );
    println!("{:<10} {:>24} {:>24} {:>10} {:>10} {:>10}", "", "held out", "training", "critic", "refitted", "model");
    let line = |name: &str, held_out: &Likelihoods, training: &Likelihoods| {
        let Likelihoods { model, refitted, critic, .. } = held_out;
        println!(
            "{name:<10} {:>24} {:>24} {critic:>10.3} {refitted:>10.3} {model:>10.3}",
            bounded(held_out.gap),
            bounded(training.gap)
        );
    };
    line("dynamics", &gaps.held_out.dynamics, &gaps.training.dynamics);
    line("reward", &gaps.held_out.reward, &gaps.training.reward);
    println!(
        "after half of the critic's updates, held out: dynamics {:+.3}, reward {:+.3}",
        gaps.half_way.dynamics.gap.estimate, gaps.half_way.reward.gap.estimate
    );
}

/// A number with its interval, if it has one.
fn bounded(value: Interval) -> String {
    if value.low.is_finite() {
        format!("{:.3} [{:.3}, {:.3}]", value.estimate, value.low, value.high)
    } else {
        format!("{:.3}", value.estimate)
    }
}
