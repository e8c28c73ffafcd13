//! Online training without a world model: the loop of soft actor-critic, QT-Opt and what stands on them. In: a folder with its options. Out: checkpoints, numbers over time
//! and evaluations there, and in `RUN/replay/` a recording like any other.
//!
//! ```text
//! model_free.json           system, size, seed, options, world
//! replay/                   what was lived through, one episode a file
//! evaluating.json           the returns of an evaluation that is not over, or not saved
//! metrics.jsonl             a line an episode
//! evaluations.jsonl
//! checkpoints/000500/       the learner's files, and state.json with the counters
//! ```
//!
//! A round is one episode, as in [`online`](super): while the actor's thread lives through it with the weights of the round's beginning, the learner makes the updates
//! that the episode before has paid for. So every number is decided by the options and the seed, and a run that was stopped goes on from its last checkpoint to the
//! same bytes.

use std::time::Instant;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use vibes_data::MetricsFile;
use vibes_env::videos::VideoSet;
use vibes_model::actions::Choice;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use super::actor::{self, ActorThread, EpisodeKind, Living, Task, episode_seed};
use super::evaluate::{self, Evaluation};
use super::protocol::Protocol;
use super::training::is_too_late_after_another;
use super::world::Libraries;
use super::{line, unfinished};
use crate::error::Result;
use crate::fit::{End, Go};
use crate::learners::model_free::ModelFreeLearner;
use crate::learners::sac::update::SacMeasures;
use crate::replay::{Replay, ReplayOptions};
use crate::windows::{Prefetch, Purpose, update_rng};

pub mod folder;

use folder::{Folder, ModelFreeOptions};

/// What the loop tells its listener.
#[derive(Debug)]
pub enum Event<'a> {
    /// Training begins, or goes on, after this many control steps.
    Start {
        /// Control steps lived through before.
        control_steps: u64,
    },
    /// An episode was lived through, learned from, and logged.
    Lived(&'a Line),
    /// A random episode was lived through, before anything is learned.
    Admitted,
    /// An update was made.
    Update,
    /// An episode of an evaluation was lived through.
    Judged,
    /// The agent was evaluated.
    Evaluated(&'a Evaluation),
}

/// Where training stands: saved with every checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Updates made.
    pub update: u64,
    /// Episodes admitted, random ones included.
    pub episodes: u32,
    /// Control steps of them.
    pub control_steps: u64,
    /// Agent steps of them.
    pub agent_steps: u64,
    /// Updates paid for and not made yet; a fraction remains from round to round.
    pub credit: f64,
    /// Control steps at which the next evaluation is due.
    pub next_evaluation: u64,
    /// Whether the last evaluation has been made.
    pub is_finished: bool,
    /// Seconds trained, over every time the run was continued.
    pub seconds: f64,
}

/// A line of `metrics.jsonl`: one episode, and the updates that were made meanwhile, if any were.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// The protocol whose settings the run has, if it follows one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Protocol>,
    /// Updates made.
    pub update: u64,
    /// Control steps lived through, action repeats counted.
    pub control_steps: u64,
    /// Agent steps lived through.
    pub agent_steps: u64,
    /// Episodes admitted.
    pub episodes: u32,
    /// Return of the episode admitted at the end of the round, exploration included.
    pub training_return: f64,
    /// Mean of the critics' loss over the round's updates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub critic_loss: Option<f64>,
    /// Mean of the targets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<f64>,
    /// That over what rewards of 1 a control step for ever are worth: above 1 something is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_over_bound: Option<f64>,
    /// Mean of the auxiliary loss.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auxiliary_loss: Option<f64>,
    /// Mean of −log π.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub entropy: Option<f64>,
    /// Weight of entropy; none without an actor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// Control steps a second, end to end; none for random episodes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control_steps_per_second: Option<f64>,
}

/// Trains until the control steps are lived through and the last evaluation is made, or the listener stops it; goes on from the newest checkpoint.
///
/// # Errors
/// See [`TrainError`](crate::TrainError); everything up to the last checkpoint is kept.
pub fn model_free(folder: &Folder, device: &Device, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
    model_free_under(folder.options().online.world.libraries()?, folder, device, listen)
}

/// The same under the world's videos, which have been opened before.
///
/// # Errors
/// As [`model_free`].
pub fn model_free_under(
    libraries: Libraries,
    folder: &Folder,
    device: &Device,
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<End> {
    model_free_living(actor::as_it_is, libraries, folder, device, listen)
}

/// The same with an actor's thread that lives through its episodes in this way.
pub(super) fn model_free_living(
    live: Living,
    libraries: Libraries,
    folder: &Folder,
    device: &Device,
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<End> {
    let options = folder.options();
    let world = &options.online.world;
    let place = folder.path().join("replay");
    let manifest = options.online.replay_manifest(options.seed, libraries[0].videos(), &place)?;
    let resumed = folder.resume(device)?;
    let mut state = resumed.as_ref().map_or_else(State::default, |(_, state)| *state);
    if state.is_finished && state.control_steps >= options.online.control_steps {
        // A kill between the last checkpoint and this would have left it.
        unfinished::forget(folder.path())?;
        return Ok(End::Nothing);
    }
    let was_finished = std::mem::replace(&mut state.is_finished, false);
    // Evaluations may have been asked for more often since then.
    state.next_evaluation = state.next_evaluation.min(options.online.next_evaluation(state.control_steps));
    let is_new = resumed.is_none();
    let learner = match resumed {
        Some((learner, _)) => learner,
        None => options.learner(device)?,
    };
    let [length, batch] = options.agent.windows();
    let sizes = ReplayOptions { length, batch, given_share: 0.0 };
    // Random episodes depend on the seed alone: what a killed run had of them is there still.
    let kept = if is_new { options.online.prefill.max(1) } else { 0 };
    let replay = Replay::open(&place, manifest, (state.episodes, kept), &[], sizes)?;
    listen(Event::Start { control_steps: state.control_steps });
    let evaluations = folder.places().evaluations_path();
    let at = (state.update, state.control_steps);
    evaluate::drop_beyond(&evaluations, state.next_evaluation, at, was_finished)?;
    line::drop_lived_beyond(&folder.places().metrics_path(), state.control_steps)?;
    let metrics = MetricsFile::open(&folder.places().metrics_path(), state.update)?;
    let evaluations = MetricsFile::open(&evaluations, state.update)?;
    std::thread::scope(|scope| {
        let acting = ActorThread::living(live, scope, world, libraries, replay.writer());
        let saved = Instant::now();
        let mut training = Training { folder, options, device, acting, replay, metrics, evaluations, state, saved };
        let end = training.run(learner, listen);
        if end.is_err() {
            // What was lived through is listed in the recording, whatever ended the run; what ended it is what is told.
            training.replay.complete().ok();
        }
        end
    })
}

struct Training<'a> {
    folder: &'a Folder,
    options: &'a ModelFreeOptions,
    device: &'a Device,
    acting: ActorThread,
    replay: Replay,
    metrics: MetricsFile,
    evaluations: MetricsFile,
    state: State,
    /// When the last checkpoint was saved.
    saved: Instant,
}

impl Training<'_> {
    fn run(&mut self, mut learner: ModelFreeLearner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        while self.state.episodes < self.options.online.prefill.max(1) {
            let task = self.task(None, "random".to_owned());
            let (steps, episode_return) = self.acting.live_unless_written(&mut self.replay, task)?;
            self.admit(steps)?;
            self.metrics.append(&self.line(&[], episode_return, None))?;
            if listen(Event::Admitted) == Go::Stop {
                return Ok(End::Stopped);
            }
        }
        loop {
            let go = self.evaluate(&learner, listen)?;
            if self.state.is_finished || go == Go::Stop {
                self.save(&learner)?;
                return Ok(if self.state.is_finished { End::Updates } else { End::Stopped });
            }
            let begun = Instant::now();
            let agent = self.agent(&learner);
            self.acting.begin(self.task(Some(agent), format!("online:update={}", self.state.update)))?;
            let due = self.state.credit.floor();
            self.state.credit -= due;
            let (next, round, go) = self.updates(learner, due as u64, listen)?;
            learner = next;
            let lived = self.acting.outcome()?;
            self.admit(lived.steps)?;
            let seconds = begun.elapsed().as_secs_f64();
            self.state.seconds += seconds;
            let line = self.line(&round, lived.episode_return, Some(f64::from(lived.steps) / seconds));
            self.metrics.append(&line)?;
            let is_stopped = [go, listen(Event::Lived(&line))].contains(&Go::Stop);
            let is_due = self.state.episodes.is_multiple_of(self.options.save_every.max(1));
            if is_stopped || is_due || is_too_late_after_another(self.saved.elapsed(), begun.elapsed()) {
                self.save(&learner)?;
            }
            if is_stopped {
                return Ok(End::Stopped);
            }
        }
    }

    /// Saves a checkpoint, and the replay's manifest up to what it was made from.
    fn save(&mut self, learner: &ModelFreeLearner) -> Result<()> {
        self.replay.complete()?;
        self.saved = Instant::now();
        self.folder.save(learner, self.state)?;
        if self.is_evaluation_due() {
            return Ok(());
        }
        unfinished::forget(self.folder.path())
    }

    /// Who acts with these weights, which it copies.
    fn agent(&self, learner: &ModelFreeLearner) -> TrainedAgent {
        TrainedAgent::ModelFree(learner.agent(self.device))
    }

    fn task(&self, agent: Option<TrainedAgent>, policy: String) -> Task {
        let number = self.state.episodes;
        Task {
            player: agent.map(|agent| Player::new(agent, Choice::Sample, 0.0)),
            videos: VideoSet::Train,
            seed: episode_seed(self.options.seed, EpisodeKind::Training, u64::from(number)),
            keep: Some((number, policy)),
        }
    }

    /// Admits the episode that was written last; its agent steps pay for updates.
    fn admit(&mut self, steps: u32) -> Result<()> {
        self.replay.admit()?;
        self.state.episodes += 1;
        self.state.agent_steps += u64::from(steps);
        self.state.control_steps += u64::from(steps) * u64::from(self.options.online.world.action_repeat);
        self.state.credit += f64::from(steps) * self.options.updates_per_step;
        Ok(())
    }

    /// Makes so many updates on what has been admitted.
    fn updates(
        &mut self,
        mut learner: ModelFreeLearner,
        count: u64,
        listen: &mut dyn FnMut(Event<'_>) -> Go,
    ) -> Result<(ModelFreeLearner, Vec<SacMeasures>, Go)> {
        let (seed, first) = (self.options.seed, self.state.update);
        let (mut round, mut go) = (Vec::new(), Go::On);
        let Self { replay, state, options, folder, .. } = self;
        let replay: &Replay = replay;
        std::thread::scope(|scope| {
            let batches = Prefetch::start(scope, replay, seed, first..first + count);
            for _ in 0..count {
                let mut rng = update_rng(seed, state.update, Purpose::Noise);
                let made = learner.update(&batches.next()?, &options.agent, state.update, &mut rng);
                let (next, measures) = made.map_err(|error| folder.diverged(error, state.update))?;
                learner = next;
                round.push(measures);
                state.update += 1;
                if listen(Event::Update) == Go::Stop {
                    go = Go::Stop;
                }
            }
            Ok((learner, round, go))
        })
    }

    fn line(&self, round: &[SacMeasures], training_return: f64, agent_steps_per_second: Option<f64>) -> Line {
        let mean_some = |of: &dyn Fn(&SacMeasures) -> Option<f32>| {
            let values: Vec<f64> = round.iter().filter_map(of).map(f64::from).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let mean = |of: &dyn Fn(&SacMeasures) -> f32| mean_some(&|measures| Some(of(measures)));
        let repeat = f64::from(self.options.online.world.action_repeat);
        let target = mean(&|measures| measures.target);
        Line {
            protocol: self.options.online.protocol,
            update: self.state.update,
            control_steps: self.state.control_steps,
            agent_steps: self.state.agent_steps,
            episodes: self.state.episodes,
            training_return,
            critic_loss: mean(&|measures| measures.critic_loss),
            target,
            target_over_bound: target.map(|target| target * (1.0 - self.options.agent.discount()) / repeat),
            auxiliary_loss: mean_some(&|measures| measures.auxiliary_loss),
            entropy: mean_some(&|measures| measures.entropy),
            temperature: mean(&|measures| measures.temperature).filter(|_| self.options.agent.has_actor()),
            control_steps_per_second: agent_steps_per_second.map(|steps| steps * repeat),
        }
    }

    /// Whether what comes next is the last evaluation.
    fn is_last(&self) -> bool {
        self.state.control_steps >= self.options.online.control_steps
    }

    fn is_evaluation_due(&self) -> bool {
        let is_due = self.options.online.is_evaluation_due(self.state.next_evaluation, self.state.control_steps);
        !self.state.is_finished && (self.is_last() || is_due)
    }

    /// When it is due, and at the end.
    fn evaluate(&mut self, learner: &ModelFreeLearner, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Go> {
        let options = &self.options.online;
        let is_last = self.is_last();
        if !self.is_evaluation_due() {
            return Ok(Go::On);
        }
        // An evaluation takes minutes, which what was learned before it shall not be lost with.
        if self.state.update > 0 {
            self.save(learner)?;
        }
        let agent = self.agent(learner);
        let counters = evaluate::Counters {
            update: self.state.update,
            control_steps: self.state.control_steps,
            agent_steps: self.state.agent_steps,
            episodes: self.state.episodes,
            given_control_steps: None,
        };
        let (seed, place) = ((self.options.seed, is_last), (self.folder.path(), options));
        let judged = &mut || listen(Event::Judged);
        let Some(evaluation) = evaluate::evaluate(&self.acting, &agent, place, counters, seed, judged)? else {
            return Ok(Go::Stop);
        };
        self.evaluations.append(&evaluation)?;
        self.state.is_finished = is_last;
        self.state.next_evaluation = options.next_evaluation(self.state.control_steps);
        Ok(listen(Event::Evaluated(&evaluation)))
    }
}
