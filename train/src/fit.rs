//! Offline training: the one loop. In: a run folder, recordings and options. Out: checkpoints and metrics in the run folder; what happens on the way is told to
//! a listener, which may stop it.

use std::time::{Duration, Instant};

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{Recording, WindowBatch};
use vibes_model::Model;

use crate::batch::Batch;
use crate::error::{Result, TrainError};
use crate::evaluate::{EvaluateOptions, GapOptions, Gaps, Report, evaluate, gaps};
use crate::learners::world::Learner;
use crate::metrics::{Averages, MetricsFile, Row};
use crate::options::Options;
use crate::run::{Run, State};
use crate::tensorboard::EventFile;
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
    /// An update was made.
    Update {
        /// Updates made in all.
        update: u64,
        /// Seconds trained in all.
        seconds: f64,
    },
    /// A line of metrics was written.
    Metrics(&'a Row),
    /// The latents were evaluated on the held-out grid.
    Evaluated(&'a Evaluation),
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
    /// How good the latents are.
    #[serde(flatten)]
    pub report: Report,
    /// How far from a bisimulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<Gaps>,
}

/// Whether to go on after an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Go {
    /// Go on.
    On,
    /// Save and stop.
    Stop,
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
        None => begin(run, recordings, device)?,
    };
    if state.update >= options.updates || out_of_time(options, state.seconds) {
        return Ok(End::Nothing);
    }
    listen(Event::Start { update: state.update });
    let metrics = MetricsFile::open(&run.metrics_path(), state.update)?;
    let evaluations = held_out.map(|_| MetricsFile::open(&run.evaluations_path(), state.update)).transpose()?;
    let events = EventFile::begin(run.path(), state.update)?;
    std::thread::scope(|scope| {
        let batches = Prefetch::start(scope, &windows, options.seed, state.update..options.updates);
        let mut training = Training {
            run,
            options,
            device,
            batches,
            metrics,
            events,
            recordings,
            held_out,
            evaluations,
            averages: Averages::default(),
            state,
        };
        training.run(learner, listen)
    })
}

struct Training<'a> {
    run: &'a Run,
    options: &'a Options,
    device: &'a Device,
    batches: Prefetch,
    metrics: MetricsFile,
    events: EventFile,
    recordings: &'a [Recording],
    held_out: Option<&'a HeldOut>,
    evaluations: Option<MetricsFile>,
    averages: Averages,
    state: State,
}

impl Training<'_> {
    fn run(&mut self, mut learner: Learner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        loop {
            learner = self.update(learner)?;
            let (update, seconds) = (self.state.update, self.state.seconds);
            let mut go = listen(Event::Update { update, seconds });
            let end = self.end(go);
            if update.is_multiple_of(self.options.log_every) || end.is_some() {
                let row = self.averages.take_row(update, self.options.latent);
                self.metrics.append(&row)?;
                self.events.append("train", update, &row)?;
                go = listen(Event::Metrics(&row));
            }
            self.evaluate(&learner, end.is_some(), listen)?;
            let end = end.or_else(|| self.end(go));
            if update.is_multiple_of(self.options.checkpoint_every) || end.is_some() {
                self.state.optimizer_steps = learner.optimizer.steps();
                self.state.adversary_optimizer_steps = learner.adversary_optimizer.steps();
                self.check_weights(&learner)?;
                self.run.save(&learner, self.state)?;
                self.run.write_summary()?;
                listen(Event::Saved { update });
            }
            if let Some(end) = end {
                return Ok(end);
            }
        }
    }

    fn update(&mut self, learner: Learner) -> Result<Learner> {
        let begun = Instant::now();
        let windows = self.batches.next()?;
        let waited = begun.elapsed();
        let number = self.state.update;
        let device = self.device.clone().autodiff();
        let batch = Batch::new(&windows, &learner.model.config, self.options.burn_in, &device)?;
        let mut noise = update_rng(self.options.seed, number, Purpose::Noise);
        let scheduled = self.state.carried + number;
        self.state.gate = self.state.gate.before(scheduled, self.options.objective.gate(self.options));
        let schedule = self.options.schedule(scheduled, self.state.gate.opened);
        let made = learner.update(&batch, schedule, self.options, &mut noise);
        let (learner, measures) = made.map_err(|error| match error {
            TrainError::NotFinite { what, value } => {
                TrainError::Diverged { update: number + 1, what, value, run: self.run.path().to_owned() }
            }
            other => other,
        })?;
        self.state.gate = self.state.gate.after(f64::from(measures.reward), measures.reward_baseline.map(f64::from));
        self.averages.add(measures, (windows.length * windows.batch) as u64, begun.elapsed(), waited);
        self.state.update += 1;
        self.state.seconds += begun.elapsed().as_secs_f64();
        Ok(learner)
    }

    /// Every so often, and at the end; its time is not counted as training.
    fn evaluate(&mut self, learner: &Learner, last: bool, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<()> {
        let (Some(held_out), Some(file)) = (self.held_out, &mut self.evaluations) else { return Ok(()) };
        if last || self.state.update.is_multiple_of(held_out.every.max(1)) {
            let report =
                evaluate(&learner.model, &held_out.grid, self.recordings, EvaluateOptions::default(), self.device)?;
            let gaps = match held_out.gap_updates {
                0 => None,
                updates => {
                    let options = GapOptions::like(self.options, updates);
                    Some(gaps(&learner.model, self.recordings, &held_out.grid, options, self.device)?)
                }
            };
            let evaluation = Evaluation { update: self.state.update, report, gaps };
            file.append(&evaluation)?;
            self.events.append("held-out", self.state.update, &evaluation)?;
            listen(Event::Evaluated(&evaluation));
        }
        Ok(())
    }

    /// Never saves a model whose last step overflowed: it would take the place of the last good checkpoint.
    fn check_weights(&self, learner: &Learner) -> Result<()> {
        match learner.model.first_not_finite() {
            None => Ok(()),
            Some(value) => Err(TrainError::Diverged {
                update: self.state.update,
                what: "a weight",
                value,
                run: self.run.path().to_owned(),
            }),
        }
    }

    fn end(&self, go: Go) -> Option<End> {
        if self.state.update >= self.options.updates {
            Some(End::Updates)
        } else if out_of_time(self.options, self.state.seconds) {
            Some(End::Minutes)
        } else {
            (go == Go::Stop).then_some(End::Stopped)
        }
    }
}

/// The learner and state of a run before its first update: new ones, or those of the run it goes on from.
fn begin(run: &Run, recordings: &[Recording], device: &Device) -> Result<(Learner, State)> {
    let options = &run.info().options;
    if let Some(from) = &run.info().from {
        return Run::open(from)?.carry_over(options, device);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut model = Model::init(run.info().model.clone(), &mut rng, device)?;
    if options.calibrate {
        let windows = calibration(recordings, options)?;
        let batch = Batch::new(&windows, &model.config, options.burn_in, device)?;
        model = model.calibrated(batch.frames, batch.previous_actions, &windows.rewards)?;
        model.world = options.objective.calibrated(model.world, &windows.rewards);
    }
    Ok((Learner::new(model, options, device), State::default()))
}

/// The windows that set the first scales.
fn calibration(recordings: &[Recording], options: &Options) -> Result<WindowBatch> {
    let windows = Windows::new(recordings, options.length, CALIBRATION_WINDOWS)?;
    Ok(windows.sample(&mut update_rng(options.seed, 0, Purpose::Calibration)))
}

fn out_of_time(options: &Options, seconds: f64) -> bool {
    options.minutes > 0.0
        && Duration::from_secs_f64(seconds.max(0.0)) >= Duration::from_secs_f64(options.minutes * 60.0)
}
