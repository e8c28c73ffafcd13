//! Offline training: the one loop. In: a run folder, recordings and options. Out: checkpoints and metrics in the run folder; what happens on the way is told to
//! a listener, which may stop it.

use std::path::Path;
use std::time::{Duration, Instant};

use burn::tensor::Device;
use serde::Serialize;
use vibes_data::{Recording, WindowBatch};

use crate::error::Result;
use crate::evaluate::{
    EvaluateOptions, GapOptions, Gaps, Report, Took, are_videos_new_to, check_grid, evaluate, gaps, is_new_to,
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
    /// They were.
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
    if state.update >= options.updates || out_of_time(options, state.seconds) {
        return Ok(End::Nothing);
    }
    if let Some(held_out) = held_out {
        // Before the first update: a grid that cannot be evaluated on.
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
        Training { session, options, device, batches, recordings, held_out, novelty }.run(learner, listen)
    })
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
    fn run(&mut self, mut learner: Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        loop {
            let (batches, update) = (&self.batches, self.session.state.update);
            (learner, _) = self.session.update(learner, || {
                let batch = batches.next()?;
                listen(Event::Windows { update, batch: &batch });
                Ok(batch)
            })?;
            let State { update, seconds, .. } = self.session.state;
            let mut go = listen(Event::Update { update, seconds });
            let end = self.end(go);
            if update.is_multiple_of(self.options.log_every) || end.is_some() {
                let row = self.session.take_row();
                self.session.log(&row)?;
                go = listen(Event::Metrics(&row));
            }
            // Whoever stops a run wants it saved, not judged.
            let is_over = matches!(end, Some(End::Updates | End::Minutes));
            if let Err(error) = self.evaluate(&learner, is_over, listen) {
                // What was learned is kept, whatever is wrong with the grid.
                self.session.save(&learner, |_folder| Ok(()))?;
                return Err(error);
            }
            let end = end.or_else(|| self.end(go));
            if update.is_multiple_of(self.options.checkpoint_every) || end.is_some() {
                self.session.save(&learner, |_folder| Ok(()))?;
                listen(Event::Saved { update });
            }
            if let Some(end) = end {
                return Ok(end);
            }
        }
    }

    /// Every so often, and at the end; its time is not counted as training.
    fn evaluate(&mut self, learner: &Learner, last: bool, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<()> {
        let Some(held_out) = self.held_out else { return Ok(()) };
        let update = self.session.state.update;
        if last || update.is_multiple_of(held_out.every.max(1)) {
            listen(Event::Evaluating { grid: held_out.grid.path() });
            let (evaluation, took) = self.judge(learner, held_out, update)?;
            self.session.evaluated(&evaluation)?;
            listen(Event::Evaluated { evaluation: &evaluation, took });
        }
        Ok(())
    }

    /// The numbers of one evaluation, and how long they took.
    fn judge(&self, learner: &Learner, held_out: &HeldOut, update: u64) -> Result<(Evaluation, Took)> {
        let begun = Instant::now();
        let (model, grid) = (&learner.model, &held_out.grid);
        let report = evaluate(model.into(), grid, self.recordings, EvaluateOptions::default(), self.device)?;
        let before_gaps = begun.elapsed();
        let gaps = match held_out.gap_updates {
            0 => None,
            updates => Some(gaps(model, self.recordings, grid, GapOptions::like(self.options, updates), self.device)?),
        };
        let all = begun.elapsed();
        let critic = if gaps.is_some() { all - before_gaps } else { Duration::ZERO };
        let [is_held_out, videos_are_held_out] = self.novelty;
        let gap_updates = held_out.gap_updates;
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
