//! `vibes-train evaluate`: how good a run's latents are on a held-out grid.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use clap::Args;
use vibes_command::Given;
use vibes_data::{Recording, relative_place, write_atomically};
use vibes_measure::episodes::PROBE_EPISODES;
use vibes_model::trained::Trained;
use vibes_train::TrainError;
use vibes_train::evaluate::{
    EvaluateOptions, GapOptions, GridVideos, Took, are_videos_new_to, check_gaps, evaluate, gaps, is_new_to,
    shared_starts, videos_of,
};
use vibes_train::run::Seen;
use vibes_train::trained::TrainedRun;

use self::print::{print_gaps, print_report};
use super::device::DeviceArgs;
use super::encode::make_room;
use super::{Context, check_place};

mod print;

pub(super) use self::print::gap_note;

#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    #[command(flatten)]
    given: Given,
    /// A run folder; its newest checkpoint is used.
    run: PathBuf,
    /// A grid recording that was not trained on, of the same task and action repeat.
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

    /// Why there are no gaps, where there are none.
    fn gaps_missing(&self, run: &TrainedRun, training: &vibes_train::Result<Vec<Recording>>) -> Option<String> {
        match (run, training) {
            (TrainedRun::ModelFree(_), _) => Some("the run has no world model".to_owned()),
            _ if self.gap_updates == 0 => Some("--gap-updates 0 leaves them out".to_owned()),
            (TrainedRun::World(_), Err(gone)) => Some(format!("they need the run's recordings: {gone}")),
            (TrainedRun::World(_), Ok(_)) => None,
        }
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
    run.world()?.check(&grid)?;
    let gap_updates = args.affordable_gaps(context, &run, &training)?;
    let gaps_missing = args.gaps_missing(&run, &training);
    let output = args.output.clone().unwrap_or_else(|| run.places().path().join("evaluation.json"));
    let folder = output.parent().unwrap_or(Path::new(""));
    make_room(&output)?;
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
    let videos_are_held_out = are_videos_new_to(&grid, &seen);
    if !context.quiet {
        eprintln!("evaluating on {}", args.grid.display());
    }
    let begun = Instant::now();
    let report = evaluate(trained.encoder(), &grid, to_fit, options, &device)?;
    let before_gaps = begun.elapsed();
    let gaps = match (gap_updates, &run, &trained) {
        (updates @ 1.., TrainedRun::World(run), Trained::World(model)) => {
            let training = training?;
            Some(gaps(model, &training, &grid, GapOptions::like(&run.info().options, updates), &device)?)
        }
        _ => None,
    };
    let all = begun.elapsed();
    let took = Took { all, critic: if gaps.is_some() { all - before_gaps } else { Duration::ZERO } };
    let run = run.places();
    let place = |path: &Path| relative_place(path, folder);
    let mut numbers = serde_json::json!({ "run": place(run.path()), "checkpoint": place(&checkpoint), "grid": place(&args.grid), "is_held_out": is_held_out, "fit_on": args.fit_on.iter().map(|path| place(path)).collect::<Vec<_>>(), "gap_updates": if gaps.is_some() { gap_updates } else { 0 }, "report": report, "gaps": gaps });
    if let Some(why) = gaps_missing {
        numbers["gaps_missing"] = why.into();
    }
    if let Some(known) = videos_are_held_out {
        numbers["videos_are_held_out"] = known.into();
    }
    let text = serde_json::to_string_pretty(&numbers)? + "\n";
    write_atomically(&output, text.as_bytes()).context("cannot write the evaluation")?;
    if context.json {
        print!("{text}");
    } else if !context.quiet {
        print_report(&report);
        if let Some(gaps) = &gaps {
            print_gaps(gaps);
        }
        println!("written after {}: {}", took.in_words(), output.display());
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
    let videos = videos_of(grid, &seen.recordings);
    if let Some(note) = video_note(&videos, shared > 0).filter(|_| is_new != Some(false) && !context.quiet) {
        eprintln!("{note}");
    }
    is_new
}

/// What is to be known of a grid whose background videos, or some of them, were trained on.
fn video_note(GridVideos { all, known }: &GridVideos, are_states_known: bool) -> Option<String> {
    const NAMED: usize = 3;
    if known.is_empty() {
        return None;
    }
    let names: Vec<&str> = known.iter().take(NAMED).map(|video| video.name.as_str()).collect();
    let names = names.join(", ") + if known.len() > NAMED { ", …" } else { "" };
    let is_all = known.len() == *all;
    let which = if is_all { format!("the grid's {all}") } else { format!("{} of the grid's {all}", known.len()) };
    let states = if is_all && !are_states_known { "; only its states are new" } else { "" };
    // Those of the held-out set can be trained on too, and then others help.
    let is_train = known.iter().all(|video| video.set == "train");
    let hint = if is_train { "; for new ones record with --video-set val" } else { "" };
    Some(format!("note: {which} background videos ({names}) are among those trained on{states}{hint}"))
}

#[cfg(test)]
mod tests {
    use vibes_data::Video;

    use super::*;

    #[test]
    fn a_grid_whose_videos_were_trained_on_is_told() {
        let video = |at: u32, set: &str| Video { name: format!("leaves-{at:03}"), set: set.to_owned(), frames: 8 };
        let of = |known: u32, set: &str| GridVideos { all: 4, known: (0..known).map(|at| video(at, set)).collect() };
        assert_eq!(video_note(&of(0, "train"), false), None);
        let said = video_note(&of(4, "train"), false).unwrap();
        let expected = "note: the grid's 4 background videos (leaves-000, leaves-001, leaves-002, …) are among those trained on; only its states are new; for new ones record with --video-set val";
        assert_eq!(said, expected);
        let said = video_note(&of(1, "val"), false).unwrap();
        assert_eq!(said, "note: 1 of the grid's 4 background videos (leaves-000) are among those trained on");
    }
}
