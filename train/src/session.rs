//! What every loop of training shares: the clock, the numbers over time, the checkpoints, and one update of the world model with all that belongs to it. In: a run, and
//! windows update by update. Out: files in the run folder. The loops ([`fit`](crate::fit) offline, [`online`](crate::online)) decide
//! where windows come from and when something is logged, evaluated and saved.

use std::path::Path;
use std::time::Instant;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{MetricsFile, WindowBatch};
use vibes_model::Model;

use crate::batch::Batch;
use crate::error::{Result, TrainError};
use crate::learners::behaviour::Replayed;
use crate::learners::world::Learner;
use crate::metrics::{Averages, Row};
use crate::options::Options;
use crate::run::{Run, State};
use crate::summary::write_summary;
use crate::tensorboard::EventFile;
use crate::windows::{Purpose, update_rng};

/// A run at work.
#[derive(Debug)]
pub struct Session<'a> {
    run: &'a Run,
    options: &'a Options,
    device: &'a Device,
    metrics: MetricsFile,
    evaluations: Option<MetricsFile>,
    events: EventFile,
    averages: Averages,
    /// Where the world model's training stands.
    pub state: State,
    saved: u64,
}

impl<'a> Session<'a> {
    /// Opens the run's files to go on after `state`: what a stopped run wrote after its last checkpoint is dropped.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn open(run: &'a Run, device: &'a Device, state: State, is_evaluated: bool) -> Result<Self> {
        let evaluations = is_evaluated.then(|| MetricsFile::open(&run.evaluations_path(), state.update)).transpose()?;
        Ok(Self {
            run,
            options: &run.info().options,
            device,
            metrics: MetricsFile::open(&run.metrics_path(), state.update)?,
            evaluations,
            events: EventFile::begin(run.path(), state.update)?,
            averages: Averages::default(),
            state,
            saved: state.update,
        })
    }

    /// One update of the world model on the windows that `next` gives; also the rows it saw, detached, for whoever learns from them next.
    ///
    /// # Errors
    /// There are no windows, or a quantity is no longer a number.
    pub fn update(
        &mut self,
        learner: Learner,
        next: impl FnOnce() -> Result<WindowBatch>,
    ) -> Result<(Learner, Replayed)> {
        let begun = Instant::now();
        let windows = next()?;
        let waited = begun.elapsed();
        let number = self.state.update;
        let device = self.device.clone().autodiff();
        let batch = Batch::new(&windows, &learner.model.config, self.options.burn_in, &device)?;
        let scheduled = self.state.scheduled();
        let mut noise = update_rng(self.options.seed, self.state.drawn(), Purpose::Noise);
        self.state.gate = self.state.gate.before(scheduled, self.options.objective.gate(self.options));
        let schedule = self.options.schedule_after(learner.optimizer.steps(), scheduled, self.state.gate.opened);
        let made = learner.update(&batch, schedule, self.options.parts(), &mut noise);
        let (learner, mut measures) = made.map_err(|error| self.run.diverged(error, number))?;
        self.state.gate = self.state.gate.after(f64::from(measures.reward), measures.reward_baseline.map(f64::from));
        let rows = (windows.length * windows.batch) as u64;
        let replayed = measures.take_replayed(&batch, &windows);
        self.averages.add(measures, rows, begun.elapsed(), waited);
        self.state.update += 1;
        self.state.seconds += begun.elapsed().as_secs_f64();
        Ok((learner, replayed))
    }

    /// The averages since the last row.
    pub fn take_row(&mut self) -> Row {
        self.averages.take_row(self.state.update, self.options.latent)
    }

    /// Writes a line of metrics.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn log(&mut self, line: &impl Serialize) -> Result<()> {
        self.metrics.append(line)?;
        self.events.append("train", self.state.update, line)
    }

    /// Writes a line about no update into `metrics.jsonl` alone.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note(&mut self, line: &impl Serialize) -> Result<()> {
        Ok(self.metrics.append(line)?)
    }

    /// Writes a line of evaluations.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn evaluated(&mut self, line: &impl Serialize) -> Result<()> {
        if let Some(file) = &mut self.evaluations {
            file.append(line)?;
        }
        self.events.append("held-out", self.state.update, line)
    }

    /// Whether so many updates have been made since the last checkpoint as lie between two.
    pub fn is_save_due(&self) -> bool {
        self.state.update / self.options.checkpoint_every > self.saved / self.options.checkpoint_every
    }

    /// Whether nothing was learned since the last checkpoint.
    pub fn is_saved(&self) -> bool {
        self.saved == self.state.update
    }

    /// Whether the minutes are up.
    pub fn is_out_of_time(&self) -> bool {
        out_of_time(self.options, self.state.seconds)
    }

    /// Saves a checkpoint, with whatever more `more` writes into its folder, and the page about the run. Never a model whose last step overflowed: it would
    /// take the place of the last good checkpoint.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&mut self, learner: &Learner, more: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        if let Some(value) = learner.model.first_not_finite() {
            let error = TrainError::NotFinite { what: "a weight", value };
            // The last update that was made, which is counted already.
            return Err(self.run.diverged(error, self.state.update.saturating_sub(1)));
        }
        self.state.optimizer_steps = learner.optimizer.steps();
        self.state.adversary_optimizer_steps = learner.adversary_optimizer.steps();
        self.run.save(learner, self.state, more)?;
        self.saved = self.state.update;
        self.summarize()
    }

    /// Writes the page about the run, as after an evaluation that no checkpoint follows.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn summarize(&self) -> Result<()> {
        write_summary(self.run)
    }
}

/// The learner and state of a run before its first update: those of the run it goes on from, or new ones, whose first scales these windows set.
///
/// # Errors
/// The run it goes on from is gone, or the windows are of another kind than the model's.
pub fn first_learner(
    run: &Run,
    windows: impl FnOnce() -> Result<WindowBatch>,
    device: &Device,
) -> Result<(Learner, State)> {
    let options = &run.info().options;
    if let Some(from) = run.open_from()? {
        let own = options.objective.networks(options, run.info().model.actions()).heads;
        let is_new = own.iter().any(|head| !from.info().model.heads.contains(head));
        // What the objective asks for and the run before had not begins as in a new run.
        let rewards = (options.calibrate && is_new).then(|| Ok::<_, TrainError>(windows()?.rewards)).transpose()?;
        return from.carry_over(options, &run.info().model, rewards.as_deref(), device);
    }
    Ok((new_learner(run, 0, windows, device)?, State::default()))
}

/// A learner with new weights, the `nth` that a run begins with, whose first scales these windows set.
///
/// # Errors
/// The windows are of another kind than the model's.
pub fn new_learner(
    run: &Run,
    nth: u64,
    windows: impl FnOnce() -> Result<WindowBatch>,
    device: &Device,
) -> Result<Learner> {
    let options = &run.info().options;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    // Streams of their own, beside those of the updates' draws (`vibes_data::updates::Purpose`).
    rng.set_stream(if nth == 0 { 0 } else { (1 << 62) + nth });
    let mut model = Model::init(run.info().model.clone(), &mut rng, device)?;
    if options.calibrate {
        let windows = windows()?;
        let batch = Batch::new(&windows, &model.config, options.burn_in, device)?;
        model = model.calibrated(batch.frames, batch.previous_actions, &windows.rewards)?;
        model.world = options.objective.calibrated(model.world, &windows.rewards);
    }
    Ok(Learner::new(model, options, device))
}

/// Whether so many seconds of training fill the minutes asked for.
pub fn out_of_time(options: &Options, seconds: f64) -> bool {
    options.minutes > 0.0 && seconds >= options.minutes * 60.0
}
