//! When the encoder begins to hear the dynamics term. In: how well the rewards are predicted, update by update. Out: the update from which on it listens.
//!
//! As long as the latents tell nothing about the reward, the dynamics term only pulls them together, and Adam makes that pull as strong as any other however
//! small its weight: a task whose reward takes longer to learn falls back to one point. So the encoder waits until the reward model is some nats better
//! than the rewards' own distribution, which needs no picture.

use serde::{Deserialize, Serialize};

use crate::options::Options;

/// Share of a new value in the running mean.
const RATE: f64 = 0.02;

/// Part of a run's state: saved with every checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Hearing {
    /// Running mean of the reward's log-likelihood above that of the rewards' own distribution, nats a row.
    pub gain: f64,
    /// The first update at which the encoder heard the dynamics term, if it did.
    pub since: Option<u64>,
}

impl Hearing {
    /// The state before an update: begins to listen if it is time.
    pub fn before(self, update: u64, options: &Options) -> Self {
        let is_time =
            update >= options.dynamics_start && (options.dynamics_after <= 0.0 || self.gain >= options.dynamics_after);
        Self { since: self.since.or(is_time.then_some(update)), ..self }
    }

    /// The state after an update in which the reward's log-likelihood was `reward` nats a row; `baseline` is that of the rewards' own distribution.
    pub fn after(self, reward: f64, baseline: f64) -> Self {
        Self { gain: self.gain + RATE * (reward - baseline - self.gain), ..self }
    }
}

/// Mean log-likelihood of rewards under the normal distribution of their own mean and standard deviation (at least `floor`), nats a row.
pub fn own_log_likelihood(rewards: &[f32], floor: f64) -> f64 {
    let count = rewards.len().max(1) as f64;
    let mean = rewards.iter().map(|&reward| f64::from(reward)).sum::<f64>() / count;
    let variance = rewards.iter().map(|&reward| (f64::from(reward) - mean).powi(2)).sum::<f64>() / count;
    let std = variance.sqrt().max(floor);
    -0.5 * variance / (std * std) - std.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::presets::small;

    #[test]
    fn it_waits_for_the_reward_and_for_its_time_and_never_stops_listening() {
        let options = Options { dynamics_start: 10, dynamics_after: 0.25, ..small() };
        let deaf = Hearing::default();
        assert_eq!(deaf.before(100, &options).since, None, "the reward is not learned");
        let learned = Hearing { gain: 0.3, since: None };
        assert_eq!(learned.before(9, &options).since, None, "too early");
        assert_eq!(learned.before(10, &options).since, Some(10));
        let listening = Hearing { gain: 0.1, since: Some(10) };
        assert_eq!(listening.before(50, &options).since, Some(10));
        let at_once = Options { dynamics_start: 0, dynamics_after: 0.0, ..small() };
        assert_eq!(Hearing { gain: -5.0, since: None }.before(0, &at_once).since, Some(0));
    }

    #[test]
    fn the_gain_follows_the_reward() {
        let mut hearing = Hearing::default();
        for _ in 0..500 {
            hearing = hearing.after(-1.0, -2.0);
        }
        assert!((hearing.gain - 1.0).abs() < 1e-3, "{}", hearing.gain);
    }

    #[test]
    fn the_own_distribution_of_a_coin() {
        // N(0, 1) at ±1.
        assert!((own_log_likelihood(&[1.0, -1.0, 1.0, -1.0], 0.1) - (-0.5 - 0.918_938_533)).abs() < 1e-6);
        assert!((own_log_likelihood(&[2.0, 2.0], 0.1) - (-(0.1_f64.ln()) - 0.918_938_533)).abs() < 1e-6);
    }
}
