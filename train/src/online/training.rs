//! The rounds of online training: random episodes, the first updates, then round after round, with evaluations and checkpoints between them. In: what a run is made from and where it
//! stands. Out: lines, checkpoints, and how it ended.

use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_env::videos::VideoSet;
use vibes_model::actions::Choice;
use vibes_model::agent::Agent;
use vibes_model::behaviour::Behaviour;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use super::actor::{ActorThread, EpisodeKind, Task, episode_seed};
use super::checkpoint::{OnlineState, Resumed, save_behaviour};
use super::line::{Line, Pace, Round};
use super::updates::Learners;
use super::{Event, Setup, evaluate, unfinished, updates};
use crate::error::{Result, TrainError};
use crate::fit::{End, Go};
use crate::learners::behaviour::BehaviourLearner;
use crate::replay::Replay;
use crate::session::{Session, first_learner, new_learner};
use crate::windows::{Purpose, update_rng};

/// Windows that set the first scales of a new model.
const CALIBRATION_WINDOWS: usize = 64;
/// The updates before the first episode with the actor are logged, and can be stopped and saved, after every so many.
const FIRST_UPDATES_AT_ONCE: u64 = 20;
/// Time between checkpoints that a round, or so many of the first updates, is not begun to end beyond, unless it is longer by itself, so that a kill hardly ever costs more than two
/// minutes.
const BETWEEN_SAVES: Duration = Duration::from_secs(100);

/// A run at work.
pub(super) struct Training<'a> {
    pub(super) setup: &'a Setup<'a>,
    pub(super) given_control_steps: Option<u64>,
    pub(super) acting: ActorThread,
    pub(super) session: Session<'a>,
    pub(super) state: OnlineState,
    pub(super) replay: Replay,
    /// When the last checkpoint was saved.
    pub(super) saved: Instant,
    /// Whether nothing was learned or admitted since.
    pub(super) is_saved: bool,
}

impl Training<'_> {
    /// From the random episodes, or from a checkpoint, to the end.
    pub(super) fn begin_and_run(
        &mut self,
        resumed: Option<Resumed>,
        listen: &mut dyn FnMut(Event<'_>) -> Go,
    ) -> Result<End> {
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
            let task = self.training_task(None, "random".to_owned());
            let (steps, episode_return) = self.acting.live_unless_written(&mut self.replay, task)?;
            self.admit(steps)?;
            let line = self.line(&Round::default(), Some(episode_return), None);
            self.log(&line)?;
            let control_steps = self.state.control_steps;
            if listen(Event::Lived { control_steps, episode_return }) == Go::Stop {
                return Ok(None);
            }
        }
        let mut rng = update_rng(run.info().options.seed, 0, Purpose::Calibration);
        let windows = || Ok(self.replay.draw(CALIBRATION_WINDOWS, &mut rng));
        let (learner, state) = first_learner(run, windows, device)?;
        self.session.state = state;
        Ok(Some((learner, self.new_behaviour())))
    }

    /// World model, actor and critic with new weights, for all that has been lived through. A network that has fitted a few episodes for long holds less of the many that follow than
    /// one that begins with them: it keeps what told the first ones apart (Nikishin et al. 2022, "The primacy bias in deep reinforcement learning", whose remedy this is).
    fn reset(&mut self, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<Learners> {
        let Setup { run, options, device, .. } = *self.setup;
        self.state.resets += 1;
        self.state.updates_before_reset = self.state.updates;
        self.session.state = self.session.state.anew();
        let mut rng = update_rng(run.info().options.seed, self.session.state.drawn(), Purpose::Calibration);
        let windows = || Ok(self.replay.draw(CALIBRATION_WINDOWS, &mut rng));
        let learner = new_learner(run, self.state.resets, windows, device)?;
        let (control_steps, updates) = (self.state.control_steps, options.reset_updates);
        // Who wants to stop now is heard at the next update, after which what was lived through is saved.
        listen(Event::Reset { control_steps, updates });
        Ok((learner, self.new_behaviour()))
    }

    /// Actor and critic before their first update, of the world model's newest weights.
    fn new_behaviour(&self) -> BehaviourLearner {
        let Setup { run, options, device, .. } = *self.setup;
        let mut rng = ChaCha8Rng::seed_from_u64(run.info().options.seed);
        rng.set_stream((1 << 63) + self.state.resets);
        let behaviour = Behaviour::init(&run.info().model, options.behaviour.config(), &mut rng, device);
        let guard = options.behaviour.guard(&run.info().model, &mut rng, device);
        BehaviourLearner::new(behaviour, device).guarded(guard)
    }

    fn run(&mut self, mut learners: Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
        if !self.is_last() && self.evaluate(&learners, listen)? == Go::Stop {
            return Ok(End::Stopped);
        }
        loop {
            let go;
            (learners, go) = if self.state.updates < self.first_until() && !self.session.is_out_of_time() {
                self.first_updates(learners, listen)?
            } else {
                let go = self.evaluate(&learners, listen)?;
                if self.state.is_finished || go == Go::Stop {
                    self.save(&learners, listen)?;
                    return Ok(self.end());
                }
                match self.setup.options.is_reset_due(self.state.resets, self.state.control_steps) {
                    true => (self.reset(listen)?, Go::On),
                    false => self.round(learners, listen)?,
                }
            };
            if go == Go::Stop {
                return Ok(End::Stopped);
            }
        }
    }

    /// Updates of actor and critic that are made before the next episode: the first ones, of the run or after it began anew.
    fn first_until(&self) -> u64 {
        let options = self.setup.options;
        let first = if self.state.resets == 0 { options.first_updates } else { options.reset_updates };
        self.state.updates_before_reset.saturating_add(first)
    }

    fn end(&self) -> End {
        match self.state.is_finished {
            true if self.state.control_steps >= self.setup.options.control_steps => End::Updates,
            true => End::Minutes,
            false => End::Stopped,
        }
    }

    /// Some of the updates before the first episode with the actor, or with one that began anew.
    fn first_updates(&mut self, learners: Learners, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<(Learners, Go)> {
        let begun = Instant::now();
        let last = self.first_until();
        let until = (self.state.updates / FIRST_UPDATES_AT_ONCE + 1) * FIRST_UPDATES_AT_ONCE;
        let count = until.min(last) - self.state.updates;
        let (learners, round, go) = self.updates(learners, count, listen)?;
        self.is_saved = false;
        let line = self.line(&round, None, None);
        self.log(&line)?;
        let go = go.or(listen(Event::Metrics(&line)));
        // An episode takes another time than these updates, so what it begins with is saved whatever the clock says.
        if self.state.updates >= last || self.is_save_due_after_another(begun) || go == Go::Stop {
            self.save(&learners, listen)?;
        }
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
        let pace = Pace::of(lived, self.setup.options.world.action_repeat, seconds, waited);
        let line = self.line(&round, Some(lived.episode_return), Some(pace));
        self.log(&line)?;
        go = go.or(listen(Event::Metrics(&line)));
        if self.is_save_due_after_another(begun) || go == Go::Stop {
            self.save(&learners, listen)?;
        }
        Ok((learners, go))
    }

    /// Whether as many updates have been made since the last checkpoint as lie between two, or what began then would end too late if it were done once more.
    fn is_save_due_after_another(&self, begun: Instant) -> bool {
        self.session.is_save_due() || is_too_late_after_another(self.saved.elapsed(), begun.elapsed())
    }

    fn line(&mut self, round: &Round, training_return: Option<f64>, pace: Option<Pace>) -> Line {
        let options = self.setup.options;
        let learned = (!round.measures.is_empty()).then(|| round.learned(self.session.take_row(), options));
        Line::new((&self.state, options), training_return, self.session.state.update, learned, pace)
    }

    /// Writes a line; TensorBoard's clock are updates, so that it has none of what had no updates.
    fn log(&mut self, line: &Line) -> Result<()> {
        if line.learned.is_some() { self.session.log(line) } else { self.session.note(line) }
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
        let counts = (self.state.updates_since_reset(), count);
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
            return Err(self.setup.run.diverged(error, self.session.state.update.saturating_sub(1)));
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

/// Whether what took so long, done once more, would end too long after the last checkpoint.
pub(super) fn is_too_late_after_another(since: Duration, took: Duration) -> bool {
    since + took > BETWEEN_SAVES
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A kill costs what was done since the last checkpoint: two minutes hardly ever.
    #[test]
    fn a_kill_costs_what_lies_between_two_checkpoints_at_most_or_one_round_that_takes_longer() {
        assert!(BETWEEN_SAVES <= Duration::from_secs(100), "as docs/online.md has it");
        for seconds in [0.1, 7.0, 49.0, 51.0, 99.0, 101.0, 300.0] {
            let took = Duration::from_secs_f64(seconds);
            let mut since = Duration::ZERO;
            for _ in 0..3000 {
                since += took;
                assert!(since <= BETWEEN_SAVES.max(took), "{since:?} in rounds of {took:?}");
                if is_too_late_after_another(since, took) {
                    since = Duration::ZERO;
                }
            }
        }
    }
}
