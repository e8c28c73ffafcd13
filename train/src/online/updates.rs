//! The updates of a round. In: the learners, and the replay their windows come from. Out: the learners after so many updates each, and what was measured.
//!
//! Actor and critic learn from the world model as an update left it and from the rows of that update; the world model learns nothing from them. So while actor and
//! critic learn from one update, the world model makes its next one beside them, and every number is as if one were made after the other.

use std::time::Instant;

use vibes_model::World;

use super::line::Round;
use super::{Event, Setup};
use crate::error::{Result, TrainError};
use crate::fit::Go;
use crate::learners::behaviour::foresight::{Foresight, foresight};
use crate::learners::behaviour::{BehaviourLearner, BehaviourMeasures, Replayed};
use crate::learners::world::Learner;
use crate::replay::Replay;
use crate::session::Session;
use crate::windows::{Prefetch, Purpose, update_rng};

/// The learner of the world model, and that of actor and critic: an update takes them and gives them back.
pub(super) type Learners = (Learner, BehaviourLearner);

/// Makes `count` updates of world model, actor and critic on what has been admitted, of which actor and critic have made `done` before.
///
/// # Errors
/// A quantity is no longer a number; the learners are gone then, and the last checkpoint is where to go on.
pub(super) fn updates(
    setup: &Setup<'_>,
    replay: &Replay,
    session: &mut Session<'_>,
    (learner, mut behaviour): Learners,
    (done, count): (u64, u64),
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<(Learners, Round, Go)> {
    let (mut round, mut go) = (Round::default(), Go::On);
    let Some(last) = count.checked_sub(1) else { return Ok(((learner, behaviour), round, go)) };
    let (seed, first, number) = (setup.run.info().options.seed, session.state.drawn(), session.state.update);
    std::thread::scope(|scope| {
        let batches = Prefetch::start(scope, replay, seed, first..first + count);
        let (mut learner, mut rows) = session.update(learner, || batches.next())?;
        let lesson = |learner: &Learner, rows: Replayed, index: u64| Lesson {
            world: learner.model.world.clone(),
            rows,
            number: number + index,
            done: done + index,
        };
        for index in 0..last {
            let (begun, seconds) = (Instant::now(), session.state.seconds);
            let lesson = lesson(&learner, rows, index);
            let (made, taught) =
                beside(|| session.update(learner, || batches.next()), || lesson.teach(behaviour, setup));
            let measures;
            (behaviour, measures) = taught.map_err(|error| setup.run.diverged(error, number + index))?;
            (learner, rows) = made?;
            round.measures.push(measures);
            session.state.seconds = seconds + begun.elapsed().as_secs_f64();
            go = go.or(listen(Event::Update));
        }
        let begun = Instant::now();
        round.foresight = Some(look_ahead(&learner, &rows, setup, number + last));
        let taught = lesson(&learner, rows, last).teach(behaviour, setup);
        let (behaviour, measures) = taught.map_err(|error| setup.run.diverged(error, number + last))?;
        round.measures.push(measures);
        session.state.seconds += begun.elapsed().as_secs_f64();
        go = go.or(listen(Event::Update));
        Ok(((learner, behaviour), round, go))
    })
}

/// What an update of the world model leaves for actor and critic to learn from.
struct Lesson {
    world: World,
    rows: Replayed,
    /// The update's number.
    number: u64,
    /// Updates of actor and critic before.
    done: u64,
}

impl Lesson {
    fn teach(self, behaviour: BehaviourLearner, setup: &Setup<'_>) -> Result<(BehaviourLearner, BehaviourMeasures)> {
        let options = setup.options;
        let mut rng = update_rng(setup.run.info().options.seed, self.number, Purpose::Imagination);
        let actor_learns = self.done >= options.critic_first;
        behaviour.update(&self.world, &self.rows, &options.behaviour_at(self.done), actor_learns, &mut rng)
    }
}

/// Does both at once, the second on a thread of its own, whose panic is an error of the run.
fn beside<A, B: Send>(here: impl FnOnce() -> A, there: impl FnOnce() -> Result<B> + Send) -> (A, Result<B>) {
    const WORK: &str = "teaches actor and critic";
    std::thread::scope(|scope| {
        let there = std::thread::Builder::new().name("behaviour".to_owned()).spawn_scoped(scope, there);
        let here = here();
        let there = match there {
            Ok(there) => there.join().unwrap_or_else(|panic| Err(TrainError::panicked(WORK, &*panic))),
            Err(no_thread) => Err(TrainError::panicked(WORK, &no_thread.to_string())),
        };
        (here, there)
    })
}

/// Rewards that the model foresees along the recorded actions of an update's rows.
fn look_ahead(learner: &Learner, rows: &Replayed, setup: &Setup<'_>, update: u64) -> Foresight {
    let options = &setup.run.info().options;
    let mut rng = update_rng(options.seed, update, Purpose::Foresight);
    foresight(&learner.model.world, rows, options.burn_in, &mut rng, &setup.device.clone().inner())
}

#[cfg(test)]
mod tests;
