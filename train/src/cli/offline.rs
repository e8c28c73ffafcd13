//! `vibes-train offline`: train on recordings.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::Result;
use clap::Args;
use vibes_command::{Ending, Given, stop_on_signals};
use vibes_data::Recording;
use vibes_train::fit::{End, Event, Go, HeldOut, fit};
use vibes_train::options::Options;
use vibes_train::prepare::{check_held_out, prepare};
use vibes_train::run::Run;

use super::device::DeviceArgs;
use super::evaluate::tell_held_out;
use super::flags::{OptionArgs, refuse};
use super::progress::Progress;
use super::window_log::WindowLog;
use super::{Context, default_run};

#[derive(Debug, Args)]
pub(crate) struct OfflineArgs {
    #[command(flatten)]
    given: Given,
    /// Recordings to train on, all of the same task and sizes.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// The run folder [default: runs/RECORDING-OBJECTIVE].
    #[arg(short, long, value_name = "RUN")]
    output: Option<PathBuf>,
    /// Go on from the newest checkpoint of another run, of the same task and sizes and of an objective with the same networks: its weights, the optimisers' moments, and how far its schedules had come.
    #[arg(long, value_name = "RUN")]
    from: Option<PathBuf>,
    /// A held-out grid of the same task and action repeat to evaluate the latents on while training. A run that is done is evaluated where that was not done yet; `vibes-train evaluate` does it anew.
    #[arg(long, value_name = "GRID")]
    eval: Option<PathBuf>,
    /// Updates between evaluations.
    #[arg(long, default_value_t = 2000, value_name = "N", requires = "eval", value_parser = clap::value_parser!(u64).range(1..))]
    eval_every: u64,
    /// Updates of the fresh critic that measures the gaps to a bisimulation at every evaluation; 0 leaves them out.
    #[arg(long, default_value_t = 200, value_name = "N", requires = "eval")]
    gap_updates: u64,
    /// Write which windows every update trains on, and the checksums of their columns, into the run's windows.jsonl.
    #[arg(long)]
    log_windows: bool,
    #[command(flatten)]
    options: OptionArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl OfflineArgs {
    /// The options that are asked for, all of which have an effect: to be known before any recording is looked at.
    pub(crate) fn resolve(&self) -> Result<Options> {
        let options = self.options.resolve()?;
        if let Some(from) = &self.from {
            self.check_settled(&options, from)?;
        }
        Ok(options)
    }

    /// That nothing else is given than the model that is gone on with has: its unit of reward and its first scales are settled. What says the same again may stand, as that run's own config.toml does.
    fn check_settled(&self, options: &Options, from: &Path) -> Result<()> {
        // Of a sweep the run that is gone on from may have yet to be made.
        let before = Run::open(from).ok().map(|run| run.info().options.clone());
        let is_same = |same: fn(&Options, &Options) -> bool| before.as_ref().is_some_and(|found| same(options, found));
        let settled = [
            ("reward_scale", is_same(|asked, found| asked.reward_scale == found.reward_scale)),
            ("reward_floor", is_same(|asked, found| asked.reward_floor == found.reward_floor)),
            ("calibrate", is_same(|asked, found| asked.calibrate == found.calibrate)),
        ];
        let other = settled.into_iter().filter_map(|(option, is_same)| (!is_same).then_some(option));
        refuse(&self.given, other, "with --from: the run that is gone on from has it settled")
    }
}

pub(crate) fn run(context: &Context, args: OfflineArgs) -> Result<Ending> {
    let options = args.resolve()?;
    let recordings = args.recordings.iter().map(|path| Recording::open(path)).collect::<Result<Vec<_>, _>>()?;
    let output = args.output.unwrap_or_else(|| default_run(&args.recordings[0], options.objective.name()));
    let held_out = args.eval.as_ref().map(|path| Recording::open(path)).transpose()?;
    if let Some(grid) = &held_out {
        check_held_out(grid, &recordings, &options, args.gap_updates)?;
    }
    let held_out = held_out.map(|grid| HeldOut { grid, every: args.eval_every, gap_updates: args.gap_updates });
    let device = args.device.open()?;
    let run = prepare(&output, &recordings, &options, args.from.as_deref())?;
    let stop = stop_on_signals()?;
    let mut progress = Progress::new(context, &options);
    progress.describe(&run);
    if let Some(held_out) = &held_out {
        tell_held_out(context, &held_out.grid, &run.seen());
    }
    let updates = run.checkpoints().last().copied().unwrap_or(0);
    let mut log = args.log_windows.then(|| WindowLog::open(run.path(), updates)).transpose()?;
    let end = fit(&run, &recordings, &device, held_out.as_ref(), &mut |event| {
        progress.show(&event);
        if let (Some(log), Event::Windows { update, batch }) = (&mut log, &event) {
            log.add(*update, batch);
        }
        if stop.load(Ordering::Relaxed) { Go::Stop } else { Go::On }
    })?;
    progress.finish();
    log.map_or(Ok(()), WindowLog::finish)?;
    report(context, &run, &options, end)?;
    if let (End::Nothing, Some(grid), false) = (end, &args.eval, context.quiet) {
        tell_evaluated(&run, grid);
    }
    Ok(if end == End::Stopped { Ending::Again } else { Ending::Done })
}

/// That nothing is left to be evaluated, and what would evaluate the run all the same.
fn tell_evaluated(run: &Run, grid: &Path) {
    let (path, grid) = (run.path().display(), grid.display());
    match run.checkpoints().last() {
        Some(made) => eprintln!(
            "note: --eval has nothing to do: the run is done, and was evaluated after its {made} updates, on this grid or another; to evaluate it on this one: vibes-train evaluate {path} {grid}"
        ),
        None => eprintln!("note: --eval has nothing to do: no update was made"),
    }
}

fn report(context: &Context, run: &Run, options: &Options, end: End) -> Result<()> {
    let made = run.checkpoints().last().copied().unwrap_or(0);
    let path = run.path().display();
    if context.json {
        println!(
            "{}",
            // None where no update was asked for.
            serde_json::json!({ "run": run.path(), "updates": made, "checkpoint": run.newest_model().ok(), "end": format!("{end:?}").to_lowercase() })
        );
    } else if !context.quiet {
        match end {
            End::Nothing => {
                println!("{path} has its {made} updates already; ask for more with --updates N or --minutes M");
            }
            End::Updates => println!("{made} updates made; next: vibes-train encode {path} RECORDING"),
            End::Minutes => println!(
                "{made} updates made in {} minutes; next: vibes-train encode {path} RECORDING",
                options.minutes
            ),
            End::Stopped => {
                println!("stopped and saved after {made} updates; the same command goes on from there: {path}");
            }
        }
    }
    Ok(())
}
