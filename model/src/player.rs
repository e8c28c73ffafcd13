//! A trained agent as it plays: it remembers the action that was executed last, takes the mode or a sample, and adds noise for exploration. In: rows of an episode, as
//! plain slices. Out: actions within the task's bounds, to be executed as they are. It knows no simulator; a program that has one makes a policy of it.

use rand::Rng;

use crate::actions::Choice;
use crate::error::ModelError;
use crate::init;
use crate::trained::TrainedAgent;

/// See the module.
#[derive(Debug, Clone)]
pub struct Player {
    agent: TrainedAgent,
    choice: Choice,
    exploration: f64,
    /// The action executed last, which the networks take in beside the next observation; empty before the first.
    executed: Vec<f32>,
}

impl Player {
    /// Who plays with this agent. `exploration` is the standard deviation of noise on the executed action, in units of −1..1; 0 adds none.
    pub fn new(agent: TrainedAgent, choice: Choice, exploration: f64) -> Self {
        Self { agent, choice, exploration, executed: Vec::new() }
    }

    /// The agent.
    pub fn agent(&self) -> &TrainedAgent {
        &self.agent
    }

    /// Takes in the next row of an episode, and chooses its action `[A]`, in the task's bounds; at an episode's first row everything before is forgotten. Of the picture
    /// `[height, width, 3]` and the vector observation the agent looks at the one that it was trained on.
    ///
    /// # Errors
    /// The picture or the observation is of another size than the agent's.
    pub fn act(
        &mut self,
        is_first: bool,
        pixels: &[u8],
        observation: &[f32],
        rng: &mut impl Rng,
    ) -> Result<Vec<f32>, ModelError> {
        if is_first {
            self.agent.begin();
        }
        let seen = self.agent.look(pixels, observation);
        let mut action = self.agent.act(seen, &self.executed, self.choice, rng)?;
        if self.exploration > 0.0 {
            let [low, high] = self.agent.bounds();
            explore(&mut action, [low, high], self.exploration, rng);
        }
        self.executed.clone_from(&action);
        Ok(action)
    }
}

/// Adds noise and cuts to the bounds: what is executed is what is stored and what the networks see.
fn explore(action: &mut [f32], [low, high]: [&[f32]; 2], exploration: f64, rng: &mut impl Rng) {
    let noise = init::normal(action.len(), rng);
    for (((number, noise), low), high) in action.iter_mut().zip(noise).zip(low).zip(high) {
        let half = (high - low) / 2.0;
        *number = (*number + noise * half * exploration as f32).clamp(*low, *high);
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::explore;

    #[test]
    fn noise_is_as_wide_as_the_bounds_and_stays_within_them() {
        let (low, high) = ([-1.0, -2.0, 0.0], [1.0, 6.0, 1.0]);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let draws: Vec<[f32; 3]> = (0..4000)
            .map(|_| {
                let mut action = [0.0, 2.0, 1.0];
                explore(&mut action, [&low, &high], 0.1, &mut rng);
                action
            })
            .collect();
        let spread = |at: usize, middle: f32| {
            (draws.iter().map(|action| (action[at] - middle).powi(2)).sum::<f32>() / draws.len() as f32).sqrt()
        };
        assert!((spread(0, 0.0) - 0.1).abs() < 0.01 && (spread(1, 2.0) - 0.4).abs() < 0.04, "{}", spread(1, 2.0));
        assert!(draws.iter().all(|action| (0.0..=1.0).contains(&action[2])));
    }
}
