//! Online training: the loop that acts, keeps what it lived through, and learns from it. In: a run folder, the world's options, recordings the run was given. Out:
//! checkpoints, numbers over time and evaluations in the run folder, and in `RUN/replay/` a recording like any other.
//!
//! ```text
//! online.json                        the options of online training
//! replay/                            what was lived through, one episode a file
//! evaluating.json                    the returns of an evaluation that is not over, or not saved
//! checkpoints/000500/
//!     behaviour.safetensors          actor, critic, slow critic
//!     guard.safetensors              the guard's reward heads, where there is one
//!     behaviour_optimizer.safetensors   Adam's moments of them
//!     online.json                    counters, fractional credit, return scale
//! ```
//!
//! One round of the loop is one episode. While the actor's thread lives through it with the weights of the round's beginning, the learner makes the
//! updates that the episode before has paid for; then the episode is admitted. So every number is decided by the options and the seed, however
//! fast either thread was, and a run that was stopped at any moment goes on from its last checkpoint to the same bytes.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_data::Recording;
use vibes_env::videos::VideoSet;
use vibes_model::actions::Choice;
use vibes_model::agent::Agent;
use vibes_model::behaviour::Behaviour;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use crate::error::{Result, TrainError};
use crate::fit::{End, Go};
use crate::learners::behaviour::BehaviourLearner;
use crate::learners::world::Learner;
use crate::replay::{Replay, ReplayOptions};
use crate::run::Run;
use crate::session::{Session, first_learner, out_of_time};
use crate::windows::{Purpose, update_rng};

pub mod actor;
mod checkpoint;
pub mod evaluate;
mod line;
pub mod model_free;
pub mod options;
pub mod prepare;
pub mod protocol;
mod unfinished;
mod updates;
pub mod world;

use actor::{ActorThread, EpisodeKind, Living, Task, episode_seed};
pub use checkpoint::OnlineState;
use checkpoint::{Resumed, resume, save_behaviour};
use evaluate::Evaluation;
pub use line::Line;
use line::{Round, Time};
use options::OnlineOptions;

/// Windows that set the first scales of a new model.
const CALIBRATION_WINDOWS: usize = 64;
/// The updates before the first episode with the actor are saved, and can be stopped, after every so many.
const FIRST_UPDATES_BETWEEN_SAVES: u64 = 100;
/// Time between checkpoints that a round is not begun to end beyond, unless it is longer by itself, so that a kill hardly ever costs more than two minutes.
const BETWEEN_SAVES: Duration = Duration::from_secs(100);

/// What the loop tells its listener.
#[derive(Debug)]
pub enum Event<'a> {
    /// Training begins, or goes on, after this many control steps.
    Start {
        /// Control steps lived through before.
        control_steps: u64,
    },
    /// An episode was lived through and admitted.
    Lived {
        /// Control steps in all.
        control_steps: u64,
        /// Its return.
        episode_return: f64,
    },
    /// An update was made.
    Update,
    /// A line of metrics was written.
    Metrics(&'a Line),
    /// An episode of an evaluation was lived through.
    Judged,
    /// The actor was evaluated.
    Evaluated(&'a Evaluation),
    /// A checkpoint was saved.
    Saved {
        /// Updates made.
        update: u64,
    },
}

/// What an online run is made from.
#[derive(Debug)]
pub struct Setup<'a> {
    /// The run folder, with the model's options.
    pub run: &'a Run,
    /// The options of online training.
    pub options: &'a OnlineOptions,
    /// Recordings whose windows are mixed in.
    pub given: &'a [Recording],
    /// Where tensors live.
    pub device: &'a Device,
}

/// Trains until the control steps are lived through and the last evaluation is made, or the listener stops it; goes on from the newest checkpoint.
///
/// # Errors
/// See [`TrainError`]; everything up to the last checkpoint is kept.
pub fn online(setup: &Setup<'_>, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
    online_living(actor::as_it_is, setup, listen)
}

fn online_living(live: Living, setup: &Setup<'_>, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
    let Setup { run, options, given, device } = *setup;
    let model_options = &run.info().options;
    let libraries = [options.world.video_library(VideoSet::Train)?, options.world.video_library(VideoSet::Val)?];
    let place = run.path().join("replay");
    let manifest = options.world.manifest(model_options.seed, libraries[0].videos(), &place)?;
    let resumed = resume(run, device)?;
    let (mut state, world_state) =
        resumed.as_ref().map_or_else(Default::default, |resumed| (resumed.online, resumed.world));
    let is_over = state.control_steps >= options.control_steps || out_of_time(model_options, world_state.seconds);
    if state.is_finished && is_over {
        // A kill between the last checkpoint and this would have left it.
        unfinished::forget(run.path())?;
        return Ok(End::Nothing);
    }
    let was_finished = std::mem::replace(&mut state.is_finished, false);
    // Evaluations may have been asked for more often since then.
    state.next_evaluation = state.next_evaluation.min(options.next_evaluation(state.control_steps));
    let sizes =
        ReplayOptions { length: model_options.length, batch: model_options.batch, given_share: options.given_share };
    // Random episodes depend on the seed alone: what a killed run had of them is there still.
    let kept = if resumed.is_none() { options.prefill.max(1) } else { 0 };
    let replay = Replay::open(&place, manifest, (state.episodes, kept), given, sizes)?;
    listen(Event::Start { control_steps: state.control_steps });
    evaluate::drop_beyond(&run.evaluations_path(), state.next_evaluation, state.control_steps, was_finished)?;
    let session = Session::open(run, device, world_state, true)?;
    std::thread::scope(|scope| {
        let acting = ActorThread::living(live, scope, &options.world, libraries, replay.writer());
        let (saved, is_saved) = (Instant::now(), resumed.is_some());
        let given_control_steps = given_control_steps(run, given);
        let mut training = Training { setup, given_control_steps, acting, session, state, replay, saved, is_saved };
        let end = training.begin_and_run(resumed, listen);
        if end.is_err() {
            // What was lived through is listed in the recording, whatever ended the run; what ended it is what is told.
            training.replay.complete().ok();
        }
        end
    })
}

/// The learner of the world model, and that of actor and critic: an update takes them and gives them back.
type Learners = (Learner, BehaviourLearner);

struct Training<'a> {
    setup: &'a Setup<'a>,
    given_control_steps: Option<u64>,
    acting: ActorThread,
    session: Session<'a>,
    state: OnlineState,
    replay: Replay,
    /// When the last checkpoint was saved.
    saved: Instant,
    /// Whether nothing was learned or admitted since.
    is_saved: bool,
}

impl Training<'_> {
    fn begin_and_run(&mut self, resumed: Option<Resumed>, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        let learners = match resumed {
            Some(resumed) => Some((resumed.learner, resumed.behaviour)),
            None => self.begin(listen)?,
        };
        learners.map_or(Ok(End::Stopped), |learners| self.run(learners, listen))
    }

    /// The random episodes, and the learners before their first update; none if the listener stopped it.
    fn begin(&mut self, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Option<Learners>> {
        let Setup { run, options, device, .. } = *self.setup;
        while self.state.episodes < options.prefill || self.replay.is_empty() {
            let (steps, episode_return) = match self.replay.next_written()? {
                Some(found) => found,
                None => {
                    let lived = self.acting.live(self.training_task(None, "random".to_owned()))?;
                    (lived.steps, lived.episode_return)
                }
            };
            self.admit(steps)?;
            let control_steps = self.state.control_steps;
            if listen(Event::Lived { control_steps, episode_return }) == Go::Stop {
                return Ok(None);
            }
        }
        let mut rng = update_rng(run.info().options.seed, 0, Purpose::Calibration);
        let windows = || Ok(self.replay.draw(CALIBRATION_WINDOWS, &mut rng));
        let (learner, state) = first_learner(run, windows, device)?;
        self.session.state = state;
        let mut rng = ChaCha8Rng::seed_from_u64(run.info().options.seed);
        rng.set_stream(1 << 63);
        let behaviour = Behaviour::init(&run.info().model, options.behaviour.config(), &mut rng, device);
        let guard = options.behaviour.guard(&run.info().model, &mut rng, device);
        Ok(Some((learner, BehaviourLearner::new(behaviour, device).guarded(guard))))
    }

    fn run(&mut self, mut learners: Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        if !self.is_last() && self.evaluate(&learners, listen)? == Go::Stop {
            return Ok(End::Stopped);
        }
        while self.state.updates < self.setup.options.first_updates && !self.session.is_out_of_time() {
            let (next, go) = self.first_updates(learners, listen)?;
            learners = next;
            if go == Go::Stop {
                return Ok(End::Stopped);
            }
        }
        loop {
            let go = self.evaluate(&learners, listen)?;
            if self.state.is_finished || go == Go::Stop {
                self.save(&learners, listen)?;
                return Ok(self.end());
            }
            let (next, go) = self.round(learners, listen)?;
            learners = next;
            if go == Go::Stop {
                return Ok(End::Stopped);
            }
        }
    }

    fn end(&self) -> End {
        match self.state.is_finished {
            true if self.state.control_steps >= self.setup.options.control_steps => End::Updates,
            true => End::Minutes,
            false => End::Stopped,
        }
    }

    /// Some of the updates before the first episode with the actor.
    fn first_updates(&mut self, learners: Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<(Learners, Go)> {
        let until = (self.state.updates / FIRST_UPDATES_BETWEEN_SAVES + 1) * FIRST_UPDATES_BETWEEN_SAVES;
        let count = until.min(self.setup.options.first_updates) - self.state.updates;
        let (learners, round, go) = self.updates(learners, count, listen)?;
        self.is_saved = false;
        let line = self.line(&round, Time::NONE);
        self.session.log(&line)?;
        let go = go.or(listen(Event::Metrics(&line)));
        self.save(&learners, listen)?;
        Ok((learners, go))
    }

    /// An episode, and meanwhile the updates that the episodes before have paid for.
    fn round(&mut self, learners: Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<(Learners, Go)> {
        let begun = Instant::now();
        let agent = self.agent(&learners);
        let policy = format!("online:update={}", self.session.state.update);
        self.acting.begin(self.training_task(Some(agent), policy))?;
        let due = self.state.credit.floor();
        self.state.credit -= due;
        let (learners, round, mut go) = self.updates(learners, due as u64, listen)?;
        let waiting = Instant::now();
        let lived = self.acting.outcome()?;
        let waited = waiting.elapsed().as_secs_f64();
        self.admit(lived.steps)?;
        self.is_saved = false;
        let model = &self.setup.run.info().options;
        self.state.credit += f64::from(lived.steps) * self.setup.options.updates_per_step(model.length * model.batch);
        let seconds = begun.elapsed().as_secs_f64();
        self.session.state.seconds += waited;
        let control_steps = self.state.control_steps;
        go = go.or(listen(Event::Lived { control_steps, episode_return: lived.episode_return }));
        if !round.measures.is_empty() {
            let line = self.line(&round, Time { lived: Some(lived), seconds, waited });
            self.session.log(&line)?;
            go = go.or(listen(Event::Metrics(&line)));
        }
        let after_another = self.saved.elapsed() + begun.elapsed();
        if self.session.is_save_due() || after_another > BETWEEN_SAVES || go == Go::Stop {
            self.save(&learners, listen)?;
        }
        Ok((learners, go))
    }

    fn line(&mut self, round: &Round, time: Time) -> Line {
        round.line(self.session.take_row(), &self.state, self.setup.options, time)
    }

    /// The actor with the weights of this moment.
    fn agent(&self, (learner, behaviour): &Learners) -> TrainedAgent {
        TrainedAgent::World(Box::new(Agent::new(&learner.model, &behaviour.behaviour.actor, self.setup.device)))
    }

    /// Whether what comes next is the last evaluation: the control steps are lived through, or the minutes are up.
    fn is_last(&self) -> bool {
        self.state.control_steps >= self.setup.options.control_steps || self.session.is_out_of_time()
    }

    fn training_task(&self, agent: Option<TrainedAgent>, policy: String) -> Task {
        let number = self.state.episodes;
        let seed = self.setup.run.info().options.seed;
        Task {
            player: agent.map(|agent| Player::new(agent, Choice::Sample, self.setup.options.exploration)),
            videos: VideoSet::Train,
            seed: episode_seed(seed, EpisodeKind::Training, u64::from(number)),
            keep: Some((number, policy)),
        }
    }

    fn admit(&mut self, steps: u32) -> Result<()> {
        self.replay.admit()?;
        self.state.episodes += 1;
        self.state.agent_steps += u64::from(steps);
        self.state.control_steps += u64::from(steps) * u64::from(self.setup.options.world.action_repeat);
        Ok(())
    }

    /// Makes so many updates of world model, actor and critic on what has been admitted.
    fn updates(
        &mut self,
        learners: Learners,
        count: u64,
        listen: &mut dyn FnMut(Event<'_>) -> Go,
    ) -> Result<(Learners, Round, Go)> {
        let counts = (self.state.updates, count);
        let made = updates::updates(self.setup, &self.replay, &mut self.session, learners, counts, listen)?;
        self.state.updates += count;
        Ok(made)
    }

    fn is_evaluation_due(&self) -> bool {
        let is_due = self.setup.options.is_evaluation_due(self.state.next_evaluation, self.state.control_steps);
        !self.state.is_finished && (self.is_last() || is_due)
    }

    /// When it is due, and at the end; its time is not counted as training. What was learned before is saved first.
    fn evaluate(&mut self, learners: &Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Go> {
        let options = self.setup.options;
        let is_last = self.is_last();
        if !self.is_evaluation_due() {
            return Ok(Go::On);
        }
        if !self.is_saved {
            self.save(learners, listen)?;
        }
        let agent = self.agent(learners);
        let seed = self.setup.run.info().options.seed;
        let counters = evaluate::Counters {
            update: self.session.state.update,
            control_steps: self.state.control_steps,
            agent_steps: self.state.agent_steps,
            episodes: self.state.episodes,
            given_control_steps: self.given_control_steps,
        };
        let (seed, place) = ((seed, is_last), (self.setup.run.path(), options));
        let judged = &mut || listen(Event::Judged);
        let Some(evaluation) = evaluate::evaluate(&self.acting, &agent, place, counters, seed, judged)? else {
            return Ok(Go::Stop);
        };
        self.session.evaluated(&evaluation)?;
        self.state.is_finished = is_last;
        self.state.next_evaluation = options.next_evaluation(self.state.control_steps);
        Ok(listen(Event::Evaluated(&evaluation)))
    }

    fn save(&mut self, (learner, behaviour): &Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<()> {
        let guard = behaviour.guard.as_ref().and_then(|guard| guard.guard.first_not_finite());
        if let Some(value) = behaviour.behaviour.first_not_finite().or(guard) {
            let error = TrainError::NotFinite { what: "a weight of actor, critic or guard", value };
            return Err(self.setup.run.diverged(error, self.session.state.update));
        }
        self.state.actor_steps = behaviour.actor_optimizer.steps();
        self.state.critic_steps = behaviour.critic_optimizer.steps();
        self.state.guard_steps = behaviour.guard.as_ref().map_or(0, |guard| guard.optimizer.steps());
        self.state.scale = behaviour.scale;
        self.replay.complete()?;
        let state = self.state;
        self.session.save(learner, |folder| save_behaviour(folder, behaviour, state))?;
        (self.saved, self.is_saved) = (Instant::now(), true);
        if !self.is_evaluation_due() {
            unfinished::forget(self.setup.run.path())?;
        }
        listen(Event::Saved { update: self.session.state.update });
        Ok(())
    }
}

/// Control steps of the recordings that a run and those that it went on from began with, whether their windows are mixed in or not; a state trajectory that was recorded under
/// several distractors, or drawn again, counts once, and what is gone does not. None where there is nothing.
fn given_control_steps(run: &Run, given: &[Recording]) -> Option<u64> {
    let mut recordings = given.to_vec();
    let mut from = run.open_from().ok().flatten();
    while let Some(before) = from {
        recordings.extend(before.open_recordings().unwrap_or_default());
        from = before.open_from().ok().flatten();
    }
    let mut trajectories = BTreeSet::new();
    for recording in &recordings {
        let repeat = recording.manifest().spec.action_repeat;
        trajectories.extend(
            recording
                .episodes()
                .iter()
                .map(|entry| (entry.seed, entry.policy.clone(), entry.episode_return.to_bits(), entry.steps, repeat)),
        );
    }
    let steps: u64 = trajectories.iter().map(|(.., steps, repeat)| u64::from(*steps) * u64::from(*repeat)).sum();
    (steps > 0).then_some(steps)
}

#[cfg(test)]
mod tests;
