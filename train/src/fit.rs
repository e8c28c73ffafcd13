//! Offline training: the one loop. In: a run folder, recordings and options. Out: checkpoints and metrics in the run folder; what happens on the way is told to
//! a listener, which may stop it, also in the middle of an evaluation.
//!
//! What is due to be saved is saved before what is due to be evaluated, which may take longer than all updates since the last time. An evaluation that a stop or a kill ends is made
//! when the run goes on: one that is due where a checkpoint stands, and not among the lines of `evaluations.jsonl`.

use std::path::Path;
use std::time::{Duration, Instant};

use burn::tensor::Device;
use serde::Serialize;
use vibes_data::{Metrics, Recording, WindowBatch};

use crate::error::{Result, TrainError};
use crate::evaluate::{
    EvaluateOptions, GapOptions, Gaps, Report, Took, are_videos_new_to, check_grid, evaluate_while, gaps_while,
    is_new_to,
};
use crate::learners::world::Learner;
use crate::metrics::Row;
use crate::options::Options;
use crate::run::{Run, State};
use crate::session::{Session, first_learner, out_of_time};
use crate::windows::{Prefetch, Purpose, Windows, update_rng};

/// Windows that set the first scales.
const CALIBRATION_WINDOWS: usize = 64;

/// What the loop tells its listener.
#[derive(Debug)]
pub enum Event<'a> {
    /// Training begins, or goes on, after this many updates.
    Start {
        /// Updates made before.
        update: u64,
    },
    /// The next update is about to be made.
    Windows {
        /// Updates made before.
        update: u64,
        /// What it trains on.
        batch: &'a WindowBatch,
    },
    /// An update was made.
    Update {
        /// Updates made in all.
        update: u64,
        /// Seconds trained in all.
        seconds: f64,
    },
    /// A line of metrics was written.
    Metrics(&'a Row),
    /// The latents are about to be evaluated on the held-out grid, which may take longer than all updates since the last time.
    Evaluating {
        /// Where the grid is.
        grid: &'a Path,
    },
    /// A part of that is done, or about to be.
    Judging,
    /// They were evaluated.
    Evaluated {
        /// What was found.
        evaluation: &'a Evaluation,
        /// How long it took.
        took: Took,
    },
    /// A checkpoint was saved.
    Saved {
        /// Updates made.
        update: u64,
    },
}

/// A held-out grid to look at while training.
#[derive(Debug)]
pub struct HeldOut {
    /// The grid.
    pub grid: Recording,
    /// Updates between evaluations.
    pub every: u64,
    /// Updates of the fresh critic that measures the gaps to a bisimulation at every evaluation; 0 leaves them out.
    pub gap_updates: u64,
}

impl HeldOut {
    /// Whether it is to be looked at where training stands: every so often, and at the end.
    fn is_due(&self, options: &Options, state: State) -> bool {
        let is_last = is_over(options, state);
        state.update > 0 && (is_last || state.update.is_multiple_of(self.every.max(1)))
    }

    /// Whether that is yet to be done, as of a run that was stopped or killed meanwhile.
    fn is_owed(&self, run: &Run, state: State) -> Result<bool> {
        let known = Metrics::read(&run.evaluations_path())?;
        let mut updates = known.lines.iter().filter_map(|line| line.get("update")?.as_u64());
        Ok(self.is_due(&run.info().options, state) && updates.all(|update| update != state.update))
    }
}

/// A line of `evaluations.jsonl`.
#[derive(Debug, Serialize)]
pub struct Evaluation {
    /// Updates made.
    pub update: u64,
    /// Whether the grid is none of the recordings that the run has learned from, nor has an episode of theirs; not known where some are gone.
    pub is_held_out: Option<bool>,
    /// Whether none of the grid's background videos is among theirs; not said where that is not known, or it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub videos_are_held_out: Option<bool>,
    /// How good the latents are.
    #[serde(flatten)]
    pub report: Report,
    /// How far from a bisimulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<Gaps>,
    /// Updates of the critic that measured it, without which gaps of two runs cannot be compared; 0 where it was not measured.
    pub gap_updates: u64,
}

/// Whether to go on after an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Go {
    /// Go on.
    On,
    /// Save and stop.
    Stop,
}

impl Go {
    /// Stops where either says so.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        if self == Self::Stop { self } else { other }
    }
}

/// Why training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// All updates were made.
    Updates,
    /// The minutes are up.
    Minutes,
    /// The listener said so.
    Stopped,
    /// There was nothing left to do.
    Nothing,
}

/// Trains until the updates are made, the minutes are up, or the listener stops it; always saves what it did.
///
/// # Errors
/// A recording has no episode as long as a window, the loss is no longer a number, or the run folder cannot be written.
pub fn fit(
    run: &Run,
    recordings: &[Recording],
    device: &Device,
    held_out: Option<&HeldOut>,
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<End> {
    let options = &run.info().options;
    let windows = Windows::new(recordings, options.length, options.batch)?;
    let (learner, state) = match run.resume(device)? {
        Some(resumed) => resumed,
        None => first_learner(run, || calibration(recordings, options), device)?,
    };
    let is_owed = held_out.map_or(Ok(false), |held_out| held_out.is_owed(run, state))?;
    if is_over(options, state) && !is_owed {
        return Ok(End::Nothing);
    }
    if let Some(held_out) = held_out {
        // Before anything is done: a grid that cannot be evaluated on.
        check_grid((&learner.model).into(), &held_out.grid)?;
    }
    let novelty = held_out.map_or([None; 2], |held_out| {
        let (grid, seen) = (&held_out.grid, run.seen());
        [is_new_to(grid, &seen), are_videos_new_to(grid, &seen)]
    });
    listen(Event::Start { update: state.update });
    let session = Session::open(run, device, state, held_out.is_some())?;
    std::thread::scope(|scope| {
        let numbers = state.drawn()..state.carried + options.updates;
        let batches = Prefetch::start(scope, &windows, options.seed, numbers);
        let mut training = Training { session, options, device, batches, recordings, held_out, novelty };
        let end = if is_owed { training.catch_up(&learner, listen)? } else { None };
        end.map_or_else(|| training.run(learner, listen), Ok)
    })
}

/// Whether the updates are made, or the minutes are up.
fn is_over(options: &Options, state: State) -> bool {
    state.update >= options.updates || out_of_time(options, state.seconds)
}

struct Training<'a> {
    session: Session<'a>,
    options: &'a Options,
    device: &'a Device,
    batches: Prefetch,
    recordings: &'a [Recording],
    held_out: Option<&'a HeldOut>,
    /// Whether the grid, and whether its videos are new to the run, as far as that is known.
    novelty: [Option<bool>; 2],
}

impl Training<'_> {
    /// The evaluation that the run was stopped or killed in; how the run ends if nothing is to be done after it.
    fn catch_up(&mut self, learner: &Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Option<End>> {
        Ok(match self.evaluate(learner, listen)? {
            Go::On => self.end(Go::On),
            Go::Stop => Some(End::Stopped),
        })
    }

    fn run(&mut self, mut learner: Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        loop {
            learner = self.update(learner, listen)?;
            let State { update, seconds, .. } = self.session.state;
            let mut go = listen(Event::Update { update, seconds });
            if update.is_multiple_of(self.options.log_every) || self.end(go).is_some() {
                let row = self.session.take_row();
                self.session.log(&row)?;
                go = go.or(listen(Event::Metrics(&row)));
            }
            let end = self.end(go);
            if update.is_multiple_of(self.options.checkpoint_every) || end.is_some() {
                self.save(&learner, listen)?;
            }
            // Whoever stops a run wants it saved, not judged.
            if end == Some(End::Stopped) || self.evaluate(&learner, listen)? == Go::Stop {
                return Ok(End::Stopped);
            }
            if let Some(end) = end {
                return Ok(end);
            }
        }
    }

    fn update(&mut self, learner: Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Learner> {
        let (batches, update) = (&self.batches, self.session.state.update);
        let (learner, _) = self.session.update(learner, || {
            let batch = batches.next()?;
            listen(Event::Windows { update, batch: &batch });
            Ok(batch)
        })?;
        Ok(learner)
    }

    fn save(&mut self, learner: &Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<()> {
        self.session.save(learner, |_folder| Ok(()))?;
        listen(Event::Saved { update: self.session.state.update });
        Ok(())
    }

    /// Judges the latents where that is due, unless the listener stops it. What was learned is kept then, and whatever is wrong with the grid.
    fn evaluate(&mut self, learner: &Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Go> {
        let is_due = |held_out: &&HeldOut| held_out.is_due(self.options, self.session.state);
        let Some(held_out) = self.held_out.filter(is_due) else { return Ok(Go::On) };
        let outcome = self.judge(learner, held_out, listen);
        if outcome.is_err() && !self.session.is_saved() {
            self.save(learner, listen)?;
        }
        match outcome {
            Err(TrainError::Stopped) => Ok(Go::Stop),
            outcome => outcome.map(|()| Go::On),
        }
    }

    /// One evaluation, from its numbers to its line; its time is not counted as training.
    fn judge(&mut self, learner: &Learner, held_out: &HeldOut, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<()> {
        let mut tell = |event: Event<'_>| match listen(event) {
            Go::On => Ok(()),
            Go::Stop => Err(TrainError::Stopped),
        };
        tell(Event::Evaluating { grid: held_out.grid.path() })?;
        let (evaluation, took) = self.measure(learner, held_out, &mut || tell(Event::Judging))?;
        self.session.evaluated(&evaluation)?;
        self.session.summarize()?;
        // It is made: who wants to stop now is heard at the next update, if there is one.
        listen(Event::Evaluated { evaluation: &evaluation, took });
        Ok(())
    }

    /// The numbers of one evaluation, and how long they took.
    fn measure(
        &self,
        learner: &Learner,
        held_out: &HeldOut,
        go_on: &mut dyn FnMut() -> Result<()>,
    ) -> Result<(Evaluation, Took)> {
        let begun = Instant::now();
        let (model, grid) = (&learner.model, &held_out.grid);
        let options = EvaluateOptions::default();
        let report = evaluate_while(model.into(), grid, self.recordings, options, self.device, go_on)?;
        let before_gaps = begun.elapsed();
        let of_gaps = |updates| {
            let options = GapOptions::like(self.options, updates);
            gaps_while(model, self.recordings, grid, options, self.device, go_on)
        };
        let gaps = Some(held_out.gap_updates).filter(|updates| *updates > 0).map(of_gaps).transpose()?;
        let all = begun.elapsed();
        let critic = if gaps.is_some() { all - before_gaps } else { Duration::ZERO };
        let [is_held_out, videos_are_held_out] = self.novelty;
        let (update, gap_updates) = (self.session.state.update, held_out.gap_updates);
        let evaluation = Evaluation { update, is_held_out, videos_are_held_out, report, gaps, gap_updates };
        Ok((evaluation, Took { all, critic }))
    }

    fn end(&self, go: Go) -> Option<End> {
        if self.session.state.update >= self.options.updates {
            Some(End::Updates)
        } else if self.session.is_out_of_time() {
            Some(End::Minutes)
        } else {
            (go == Go::Stop).then_some(End::Stopped)
        }
    }
}

/// The windows that set the first scales.
fn calibration(recordings: &[Recording], options: &Options) -> Result<WindowBatch> {
    let windows = Windows::new(recordings, options.length, CALIBRATION_WINDOWS)?;
    Ok(windows.sample(&mut update_rng(options.seed, 0, Purpose::Calibration)))
}
