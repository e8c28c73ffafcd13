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

use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Episode, EpisodeBuilder, EpisodeInfo, RecordingWriter};
use vibes_env::videos::{VideoLibrary, VideoSet};
use vibes_env::{EpisodeSeeds, Eyes};
use vibes_model::actions::Choice;
use vibes_model::init;
use vibes_model::trained::TrainedAgent;

use super::options::WorldOptions;
use crate::error::{Result, TrainError};
use crate::replay;

/// An episode to live through.
#[derive(Debug)]
pub struct Task {
    /// Who acts; without an agent, actions are drawn uniformly from the task's bounds.
    pub agent: Option<TrainedAgent>,
    /// Mode or sample.
    pub choice: Choice,
    /// Standard deviation of noise on the executed action, in units of −1..1.
    pub exploration: f64,
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
}

/// What the thread owns: eyes are opened when they are first needed and stay on the thread, as an OpenGL context does.
pub(super) struct Stage<'a> {
    world: &'a WorldOptions,
    libraries: [Arc<VideoLibrary>; 2],
    eyes: [Option<Eyes>; 2],
    writer: Arc<RecordingWriter>,
}

impl Stage<'_> {
    pub(super) fn live(&mut self, mut task: Task) -> Result<Lived> {
        let begun = Instant::now();
        let place = match task.videos {
            VideoSet::Train => 0,
            VideoSet::Val => 1,
        };
        let mut eyes = match self.eyes[place].take() {
            Some(eyes) => eyes,
            None => self.world.eyes(Arc::clone(&self.libraries[place]))?,
        };
        let outcome = live(&mut eyes, &mut task, self.world.steps);
        self.eyes[place] = Some(eyes);
        let (episode, model_overrides) = outcome?;
        if let Some((index, policy)) = task.keep {
            let info = EpisodeInfo { policy, seed: task.seed, model_overrides };
            replay::write(&self.writer, &Episode { index, ..episode.clone() }, info)?;
        }
        Ok(Lived {
            steps: episode.steps() as u32,
            episode_return: episode.episode_return(),
            seconds: begun.elapsed().as_secs_f64(),
        })
    }
}

/// The loop: observation, action, reward, next observation.
fn live(eyes: &mut Eyes, task: &mut Task, steps: u32) -> Result<(Episode, serde_json::Value)> {
    let seeds = EpisodeSeeds::from(task.seed);
    let [mut start, mut choices] = seeds.generators();
    let start = eyes.reset(&mut start, seeds.distractors)?;
    if let Some(agent) = &mut task.agent {
        agent.begin();
    }
    let bounds = eyes.environment().action_spec();
    let (low, high): (Vec<f32>, Vec<f32>) =
        bounds.min.iter().zip(&bounds.max).map(|(&low, &high)| (low as f32, high as f32)).unzip();
    let mut frame = eyes.frame()?;
    let mut episode = EpisodeBuilder::first(0, None, frame.clone());
    let mut action = vec![0.0_f32; low.len()];
    for _ in 0..steps {
        action = match &mut task.agent {
            Some(agent) => {
                let seen = agent.look(&frame.pixels, &frame.observation);
                let mut action = agent.act(seen, &action, task.choice, &mut choices)?;
                explore(&mut action, &low, &high, task.exploration, &mut choices);
                action
            }
            None => low.iter().zip(&high).map(|(&low, &high)| random_between(low, high, &mut choices)).collect(),
        };
        let exact: Vec<f64> = action.iter().map(|&number| f64::from(number)).collect();
        let reward = eyes.step(&exact)?;
        frame = eyes.frame()?;
        // No task here ends; the time limit is not an end.
        episode.step(&action, reward as f32, 1.0, frame.clone());
    }
    Ok((episode.finish(false), serde_json::to_value(&start.model_overrides).unwrap_or_default()))
}

fn random_between(low: f32, high: f32, rng: &mut impl Rng) -> f32 {
    if high > low { rng.random_range(low..=high) } else { low }
}

/// Adds noise and cuts to the bounds: what is executed is what is stored and what the model sees.
fn explore(action: &mut [f32], low: &[f32], high: &[f32], exploration: f64, rng: &mut impl RngCore) {
    if exploration <= 0.0 {
        return;
    }
    let noise = init::normal(action.len(), rng);
    for (((number, noise), low), high) in action.iter_mut().zip(noise).zip(low).zip(high) {
        let half = (high - low) / 2.0;
        *number = (*number + noise * half * exploration as f32).clamp(*low, *high);
    }
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
    Training,
    /// Evaluation on training videos.
    EvaluationTrain,
    /// Evaluation on held-out videos.
    EvaluationVal,
    /// The last evaluation, on held-out videos.
    Final,
}
