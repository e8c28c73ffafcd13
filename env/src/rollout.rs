//! The one loop that makes a state trajectory: a policy acts in an environment from a start until the episode ends. Nothing is drawn here but what
//! the policy asks to see; the pictures of a recording are made afterwards from the stored positions, once for every distractor trajectory.
//!
//! In: eyes on an environment, a policy, seeds. Out: a [`StateTrajectory`].

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::distractors::AxisSeeds;
use crate::eyes::Eyes;
use crate::policies::Policy;
use crate::{Error, Result, Start};

/// One episode of states, by agent steps: `T` actions and rewards, `T + 1` rows of everything that describes a state.
#[derive(Clone, Debug, PartialEq)]
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
    /// The same seed for everything.
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

/// Rolls a policy through an episode of at most `steps` agent steps. A picture is drawn at every row where the policy chooses an action, and only
/// for a policy that asks for pictures ([`Policy::pictures`]); `eyes` must draw them in that size and look.
///
/// # Errors
/// When the policy has no action or asks for other pictures than `eyes` draws, or the simulation becomes unstable.
pub fn rollout(eyes: &mut Eyes, policy: &mut dyn Policy, steps: u32, seeds: EpisodeSeeds) -> Result<StateTrajectory> {
    let wanted = policy.pictures();
    if wanted.is_some() && wanted != eyes.pictures() {
        return Err(Error::Render {
            fact: format!("pictures {:?} for a policy", eyes.pictures()),
            expected: format!("it was trained on {wanted:?}"),
        });
    }
    let [mut start, mut choices] = seeds.generators();
    let start = eyes.reset(&mut start, seeds.distractors)?;
    policy.begin(&start)?;
    let mut trajectory = StateTrajectory {
        start,
        actions: Vec::new(),
        rewards: Vec::new(),
        observations: Vec::new(),
        qpos: Vec::new(),
        qvel: Vec::new(),
    };
    trajectory.push_row(eyes);
    for _ in 0..steps {
        let action = policy.act(&eyes.sight(wanted.is_some())?, &mut choices)?;
        let action = eyes.environment().executable(&action);
        trajectory.rewards.push(eyes.step(&action)?);
        trajectory.actions.push(action);
        trajectory.push_row(eyes);
    }
    Ok(trajectory)
}
