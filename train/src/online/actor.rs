//! The thread that acts: it lives through whole episodes, one after another, while the learner learns. In: a [`Task`], with the weights to act with. Out: a
//! [`Lived`], after the episode has been written to the replay recording if it is one to learn from.
//!
//! Weights are handed over once an episode, so what an episode holds depends on no clock; and simulation, drawing and acting run beside the
//! updates on a core of their own.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::Scope;
use std::time::Instant;

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Episode, EpisodeInfo, RecordingWriter};
use vibes_env::videos::{VideoLibrary, VideoSet};
use vibes_env::{EpisodeSeeds, Eyes, Policy, SingleRandom, Start, Trained, distractor_seed, rollout_frames};
use vibes_model::ObservationKind;
use vibes_model::player::Player;

use super::options::WorldOptions;
use crate::error::{Result, TrainError};
use crate::replay::{self, Replay};

/// An episode to live through.
#[derive(Debug)]
pub struct Task {
    /// Who acts; without a player, actions are drawn uniformly from the task's bounds.
    pub player: Option<Player>,
    /// Training or held-out videos.
    pub videos: VideoSet,
    /// Of the start, the choices and the distractors.
    pub seed: u64,
    /// The number to write it under, and what its entry says of who acted; none for an episode that is only watched.
    pub keep: Option<(u32, String)>,
}

/// What came of an episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lived {
    /// Agent steps.
    pub steps: u32,
    /// Sum of the rewards.
    pub episode_return: f64,
    /// Seconds it took.
    pub seconds: f64,
}

/// The thread, seen from the learner.
#[derive(Debug)]
pub struct ActorThread {
    tasks: Sender<Task>,
    lived: Receiver<Result<Lived>>,
}

/// How the thread lives through a task on its stage: in every run by [`as_it_is`]; a test has things go wrong in between.
pub(super) type Living = fn(&mut Stage<'_>, Task) -> Result<Lived>;

/// Nothing goes wrong on purpose.
pub(super) fn as_it_is(stage: &mut Stage<'_>, task: Task) -> Result<Lived> {
    stage.live(task)
}

/// What the thread does, in words.
const WORK: &str = "acts in the environment and draws it";

impl ActorThread {
    /// Starts the thread; it ends when this is dropped. `libraries` are training and held-out videos.
    pub fn start<'scope>(
        scope: &'scope Scope<'scope, '_>,
        world: &'scope WorldOptions,
        libraries: [Arc<VideoLibrary>; 2],
        writer: Arc<RecordingWriter>,
    ) -> Self {
        Self::living(as_it_is, scope, world, libraries, writer)
    }

    pub(super) fn living<'scope>(
        live: Living,
        scope: &'scope Scope<'scope, '_>,
        world: &'scope WorldOptions,
        libraries: [Arc<VideoLibrary>; 2],
        writer: Arc<RecordingWriter>,
    ) -> Self {
        let ((tasks, inbox), (outbox, lived)) = (channel::<Task>(), channel());
        let work = move || {
            let mut stage = Stage { world, libraries, eyes: [None, None], writer };
            for task in inbox {
                // A panic here (a driver's, say) becomes an error of the run, which keeps what it has. The stage is not used again.
                let outcome = catch_unwind(AssertUnwindSafe(|| live(&mut stage, task)));
                let is_gone = outcome.is_err();
                let outcome = outcome.unwrap_or_else(|panic| Err(TrainError::panicked(WORK, &*panic)));
                if outbox.send(outcome).is_err() || is_gone {
                    return;
                }
            }
        };
        std::thread::Builder::new().name("actor".to_owned()).spawn_scoped(scope, work).ok();
        Self { tasks, lived }
    }

    /// Hands over a task; its outcome is the next that [`ActorThread::outcome`] gives.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn begin(&self, task: Task) -> Result<()> {
        self.tasks.send(task).map_err(|_gone| TrainError::NoActor)
    }

    /// Waits for the outcome of the oldest task.
    ///
    /// # Errors
    /// The thread is gone, or the episode could not be lived through or written.
    pub fn outcome(&self) -> Result<Lived> {
        self.lived.recv().map_err(|_gone| TrainError::NoActor)?
    }

    /// Both.
    ///
    /// # Errors
    /// As [`ActorThread::outcome`].
    pub fn live(&self, task: Task) -> Result<Lived> {
        self.begin(task)?;
        self.outcome()
    }

    /// Steps and return of an episode that does not depend on what was learned: as it was written before the run was killed, or lived through now.
    ///
    /// # Errors
    /// As [`ActorThread::outcome`], or the replay cannot be read.
    pub fn live_unless_written(&self, replay: &mut Replay, task: Task) -> Result<(u32, f64)> {
        match replay.next_written()? {
            Some(found) => Ok(found),
            None => self.live(task).map(|lived| (lived.steps, lived.episode_return)),
        }
    }
}

/// What the thread owns: eyes are opened when they are first needed and stay on the thread, as an OpenGL context does.
pub(super) struct Stage<'a> {
    world: &'a WorldOptions,
    libraries: [Arc<VideoLibrary>; 2],
    eyes: [Option<Eyes>; 2],
    writer: Arc<RecordingWriter>,
}

impl Stage<'_> {
    pub(super) fn live(&mut self, task: Task) -> Result<Lived> {
        let begun = Instant::now();
        let place = match task.videos {
            VideoSet::Train => 0,
            VideoSet::Val => 1,
        };
        let mut eyes = match self.eyes[place].take() {
            Some(eyes) => eyes,
            None => self.world.eyes(Arc::clone(&self.libraries[place]))?,
        };
        let seeds = seeds_of(&task);
        let mut policy = policy(task.player, &eyes);
        let outcome = rollout_frames(&mut eyes, policy.as_mut(), self.world.steps, seeds);
        self.eyes[place] = Some(eyes);
        let (start, episode) = outcome?;
        let (steps, episode_return) = (episode.steps() as u32, episode.episode_return());
        if let Some((index, policy)) = task.keep {
            self.write(Episode { index, ..episode }, &start, policy, task.seed)?;
        }
        Ok(Lived { steps, episode_return, seconds: begun.elapsed().as_secs_f64() })
    }

    fn write(&self, episode: Episode, start: &Start, policy: String, seed: u64) -> Result<()> {
        let model_overrides = serde_json::to_value(&start.model_overrides).unwrap_or_default();
        replay::write(&self.writer, &episode, EpisodeInfo { policy, seed, model_overrides })
    }
}

/// The seeds of an episode. What is learned from has its distractors drawn apart from the choices: with one seed for both, the first random action would tell the film. What is only watched
/// is under the distractors of its own seed, as in every run before.
fn seeds_of(task: &Task) -> EpisodeSeeds {
    let seeds = EpisodeSeeds::from(task.seed);
    match task.keep {
        Some(_) => EpisodeSeeds { distractors: distractor_seed(task.seed, 0).into(), ..seeds },
        None => seeds,
    }
}

/// Who acts, as a policy of the world that these eyes see.
fn policy(player: Option<Player>, eyes: &Eyes) -> Box<dyn Policy> {
    let Some(mut player) = player else { return Box::new(SingleRandom) };
    let pictures = match player.agent().observation() {
        ObservationKind::Pixels { .. } => eyes.pictures(),
        ObservationKind::Vector { .. } => None,
    };
    Box::new(Trained::new("in training".to_owned(), pictures, move |sight, is_first, mut rng| {
        player.act(is_first, sight.pixels, sight.observation, &mut rng).map_err(Into::into)
    }))
}

/// The seed of an episode: of its kind and number alone.
pub fn episode_seed(seed: u64, kind: EpisodeKind, number: u64) -> u64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1 << 62 | (kind as u64) << 56 | number);
    // 53 bits, which every JSON reader keeps exactly.
    rng.next_u64() >> 11
}

/// What an episode is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EpisodeKind {
    /// To learn from.
    Training = 0,
    /// To evaluate on, under videos of either set.
    Evaluation = 2,
    /// The last evaluation.
    Final = 3,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_learned_from_has_distractors_that_no_choice_tells() {
        let task = |seed, keep| Task { player: None, videos: VideoSet::Train, seed, keep };
        for seed in 0..60 {
            let kept = seeds_of(&task(seed, Some((0, "random".to_owned()))));
            assert_eq!(kept.state, seed);
            let mut film = ChaCha8Rng::seed_from_u64(kept.distractors.background);
            film.set_stream(1);
            let [_, mut choices] = kept.generators();
            assert_ne!(choices.next_u64(), film.next_u64(), "episode {seed}");
            assert_eq!(seeds_of(&task(seed, None)), EpisodeSeeds::from(seed), "watched as in every run before");
        }
    }
}
