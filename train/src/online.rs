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

use std::time::Instant;

use burn::tensor::Device;
use vibes_data::Recording;

use crate::error::Result;
use crate::fit::{End, Go};
use crate::replay::{Replay, ReplayOptions};
use crate::run::Run;
use crate::session::{Session, out_of_time};

pub mod actor;
mod beginning;
mod checkpoint;
pub mod evaluate;
mod line;
pub mod model_free;
pub mod options;
pub mod prepare;
pub mod protocol;
mod training;
mod unfinished;
mod updates;
pub mod world;

use actor::{ActorThread, Living};
pub(crate) use beginning::head_start;
pub use checkpoint::OnlineState;
use checkpoint::resume;
use evaluate::Evaluation;
pub use line::{Learned, Line, Pace};
use options::OnlineOptions;
use training::Training;
use world::Libraries;

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
    /// World model, actor and critic began anew.
    Reset {
        /// Control steps lived through before.
        control_steps: u64,
        /// Updates before the next episode.
        updates: u64,
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
/// See [`TrainError`](crate::TrainError); everything up to the last checkpoint is kept.
pub fn online(setup: &Setup<'_>, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
    online_under(setup.options.world.libraries()?, setup, listen)
}

/// The same under the world's videos, which have been opened before: making them may take minutes, in which another has to be listened to.
///
/// # Errors
/// As [`online`].
pub fn online_under(libraries: Libraries, setup: &Setup<'_>, listen: &mut dyn FnMut(Event<'_>) -> Go) -> Result<End> {
    online_living(actor::as_it_is, libraries, setup, listen)
}

fn online_living(
    live: Living,
    libraries: Libraries,
    setup: &Setup<'_>,
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<End> {
    let Setup { run, options, given, device } = *setup;
    let model_options = &run.info().options;
    let place = run.path().join("replay");
    let manifest = options.replay_manifest(model_options.seed, libraries[0].videos(), &place)?;
    let resumed = resume(run, options.behaviour.guard > 0.0, device)?;
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
    let at = (world_state.update, state.control_steps);
    evaluate::drop_beyond(&run.evaluations_path(), state.next_evaluation, at, was_finished)?;
    line::drop_lived_beyond(&run.metrics_path(), state.control_steps)?;
    let session = Session::open(run, device, world_state, true)?;
    std::thread::scope(|scope| {
        let acting = ActorThread::living(live, scope, &options.world, libraries, replay.writer());
        let (saved, is_saved) = (Instant::now(), resumed.is_some());
        let given_control_steps = beginning::given_control_steps(run, options, given);
        let mut training = Training { setup, given_control_steps, acting, session, state, replay, saved, is_saved };
        let end = training.begin_and_run(resumed, listen);
        if end.is_err() {
            // What was lived through is listed in the recording, whatever ended the run; what ended it is what is told.
            training.replay.complete().ok();
        }
        end
    })
}

#[cfg(test)]
mod tests;
