//! How a policy acts through an episode: [`Playing`] is an episode under way, and its step the one place where a policy sees a row, chooses, and its action is executed.
//!
//! In: eyes on an environment, a policy, seeds. Out: of [`rollout`] a [`StateTrajectory`], where nothing is drawn but what the policy asks to see, since the pictures of
//! a recording are made afterwards from the stored positions, once for every distractor trajectory; of [`rollout_frames`] an [`Episode`] with the picture of every row.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_data::{Episode, EpisodeBuilder};

use crate::distractors::AxisSeeds;
use crate::eyes::Eyes;
use crate::policies::Policy;
use crate::{Error, Result, Start};

/// One episode of states, by agent steps: `T` actions and rewards, `T + 1` rows of everything that describes a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateTrajectory {
    /// Where it started, with the episode's model overrides.
    pub start: Start,
    /// Actions `[T][action]`.
    pub actions: Vec<Vec<f64>>,
    /// Rewards `[T]`, summed over the action repeat.
    pub rewards: Vec<f64>,
    /// Observations `[T + 1][observation]`.
    pub observations: Vec<Vec<f64>>,
    /// Generalised positions `[T + 1][nq]`; with the model overrides, all a picture needs.
    pub qpos: Vec<Vec<f64>>,
    /// Generalised velocities `[T + 1][nv]`.
    pub qvel: Vec<Vec<f64>>,
}

impl StateTrajectory {
    /// Agent steps `T`.
    pub fn steps(&self) -> usize {
        self.actions.len()
    }

    /// The sum of the rewards; 0 for an episode of no step (`sum` of nothing is −0).
    pub fn episode_return(&self) -> f64 {
        self.rewards.iter().fold(0.0, |sum, reward| sum + reward)
    }

    /// Adds the present state as the next row.
    fn push_row(&mut self, eyes: &Eyes) {
        let physics = eyes.environment().physics();
        self.observations.push(eyes.observation().to_vec());
        self.qpos.push(physics.qpos().to_vec());
        self.qvel.push(physics.qvel().to_vec());
    }
}

/// The seeds of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpisodeSeeds {
    /// Of the start and of the policy's choices.
    pub state: u64,
    /// Of the distractors that the policy sees while it acts.
    pub distractors: AxisSeeds,
}

impl From<u64> for EpisodeSeeds {
    /// The same seed for everything. The policy's choices and the draws of the background are then one stream of one generator (stream 1 of this seed), so that whatever
    /// wants the two independent of each other takes [`crate::ChosenSeeds::of_episode`] instead, as a recording does.
    fn from(seed: u64) -> Self {
        Self { state: seed, distractors: seed.into() }
    }
}

impl EpisodeSeeds {
    /// The generators of the start and of the policy's choices, one each, so that two policies can be compared from the same start.
    pub fn generators(self) -> [ChaCha8Rng; 2] {
        let start = ChaCha8Rng::seed_from_u64(self.state);
        let mut choices = start.clone();
        choices.set_stream(1);
        [start, choices]
    }
}

/// An episode under way.
#[derive(Debug)]
pub struct Playing<'a> {
    eyes: &'a mut Eyes,
    policy: &'a mut dyn Policy,
    choices: ChaCha8Rng,
    /// Whether the policy sees pictures.
    sees: bool,
}

impl<'a> Playing<'a> {
    /// Begins an episode at a drawn start, which is returned. `eyes` must draw the pictures that the policy asks for ([`Policy::pictures`]), in that size and look.
    ///
    /// # Errors
    /// When the policy asks for other pictures than `eyes` draws, or no start is found.
    pub fn begin(eyes: &'a mut Eyes, policy: &'a mut dyn Policy, seeds: EpisodeSeeds) -> Result<(Self, Start)> {
        let wanted = policy.pictures();
        if wanted.is_some() && wanted != eyes.pictures() {
            return Err(Error::Render {
                fact: format!("pictures {:?} for a policy", eyes.pictures()),
                expected: format!("it was trained on {wanted:?}"),
            });
        }
        let [mut start, choices] = seeds.generators();
        let start = eyes.reset(&mut start, seeds.distractors)?;
        policy.begin(&start)?;
        Ok((Self { eyes, policy, choices, sees: wanted.is_some() }, start))
    }

    /// One agent step: the policy sees the present row and chooses; returns the action as it was executed, and the reward. A picture is drawn for a policy that
    /// asks for pictures, and for no other.
    ///
    /// # Errors
    /// When the policy has no action, or the simulation becomes unstable.
    pub fn step(&mut self) -> Result<(Vec<f64>, f64)> {
        let chosen = self.policy.act(&self.eyes.sight(self.sees)?, &mut self.choices)?;
        let action = self.eyes.environment().executable(&chosen);
        let reward = self.eyes.step(&action)?;
        Ok((action, reward))
    }

    /// The eyes, at the present row.
    pub fn eyes(&mut self) -> &mut Eyes {
        self.eyes
    }
}

/// Rolls a policy through an episode of `steps` agent steps, and keeps its states.
///
/// # Errors
/// As [`Playing::begin`] and [`Playing::step`].
pub fn rollout(eyes: &mut Eyes, policy: &mut dyn Policy, steps: u32, seeds: EpisodeSeeds) -> Result<StateTrajectory> {
    let (mut playing, start) = Playing::begin(eyes, policy, seeds)?;
    let mut trajectory = StateTrajectory { start, ..StateTrajectory::default() };
    trajectory.push_row(playing.eyes());
    for _ in 0..steps {
        let (action, reward) = playing.step()?;
        trajectory.actions.push(action);
        trajectory.rewards.push(reward);
        trajectory.push_row(playing.eyes());
    }
    Ok(trajectory)
}

/// The same, keeping every row whole, with its picture if `eyes` draw any, and the start. The episode has the number 0.
///
/// # Errors
/// As [`rollout`], and when a picture cannot be drawn.
pub fn rollout_frames(
    eyes: &mut Eyes,
    policy: &mut dyn Policy,
    steps: u32,
    seeds: EpisodeSeeds,
) -> Result<(Start, Episode)> {
    let (mut playing, start) = Playing::begin(eyes, policy, seeds)?;
    let mut episode = EpisodeBuilder::first(0, None, playing.eyes().frame()?);
    for _ in 0..steps {
        let (action, reward) = playing.step()?;
        let action: Vec<f32> = action.into_iter().map(|number| number as f32).collect();
        // No task here ends; the time limit is not an end.
        episode.step(&action, reward as f32, 1.0, playing.eyes().frame()?);
    }
    Ok((start, episode.finish(false)))
}
