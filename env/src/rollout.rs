//! The one loop that makes a state trajectory: a policy acts in an environment from a start until the episode ends. Nothing is drawn here;
//! pictures are made afterwards from the stored positions, once for every distractor trajectory.
//!
//! In: an environment, a policy, a seed. Out: a [`StateTrajectory`].

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::policies::Policy;
use crate::{Environment, Result, Start};

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

    /// The sum of the rewards.
    pub fn episode_return(&self) -> f64 {
        self.rewards.iter().sum()
    }

    /// Adds the present state as the next row.
    fn push_row(&mut self, environment: &Environment) {
        let mut observation = Vec::new();
        environment.observe(&mut observation);
        self.observations.push(observation);
        self.qpos.push(environment.physics().qpos().to_vec());
        self.qvel.push(environment.physics().qvel().to_vec());
    }
}

/// An action as a recording keeps it, in single precision: what is executed is what is stored, so that a recording simulates again exactly.
fn as_recorded(action: Vec<f64>) -> Vec<f64> {
    action.into_iter().map(|number| f64::from(number as f32)).collect()
}

/// Rolls a policy through an episode of at most `steps` agent steps. The seed gives the start and the policy's choices, each from a generator of its own,
/// so that two policies can be compared from the same start.
pub fn rollout(environment: &mut Environment, policy: &mut Policy, steps: u32, seed: u64) -> Result<StateTrajectory> {
    let start = environment.reset(&mut ChaCha8Rng::seed_from_u64(seed))?;
    let mut choices = ChaCha8Rng::seed_from_u64(seed);
    choices.set_stream(1);
    policy.begin(&start)?;
    let mut trajectory = StateTrajectory {
        start,
        actions: Vec::new(),
        rewards: Vec::new(),
        observations: Vec::new(),
        qpos: Vec::new(),
        qvel: Vec::new(),
    };
    trajectory.push_row(environment);
    for _ in 0..steps {
        let action = as_recorded(policy.act(environment, &mut choices)?);
        trajectory.rewards.push(environment.step(&action)?);
        trajectory.actions.push(action);
        trajectory.push_row(environment);
    }
    Ok(trajectory)
}
