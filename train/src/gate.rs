//! When the dynamics term's gradient begins to reach the encoder, for an objective that states a condition. In: how well the rewards are predicted, update by update. Out:
//! the update from which on it does.
//!
//! As long as the latents tell nothing about the reward, the dynamics term only pulls them together, and Adam makes that pull as strong as any other however
//! small its weight: a task whose reward takes longer to learn falls back to one point. So an objective may ask that the reward model first be some nats better
//! than a head that sees past actions alone, which needs no picture. The paper lacks it.

use serde::{Deserialize, Serialize};

use crate::learners::objective::Condition;

/// Share of a new value in the running mean.
const RATE: f64 = 0.02;

/// Part of a run's state: saved with every checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Gate {
    /// Running mean of the reward's log-likelihood above that of the baseline, nats a row.
    pub gain: f64,
    /// The first update at which the dynamics term reached the encoder, if it did.
    #[serde(alias = "since")]
    pub opened: Option<u64>,
}

impl Gate {
    /// The state before an update: opens if it is time. Without a condition it is open from the first update on.
    pub fn before(self, update: u64, condition: Option<Condition>) -> Self {
        let since = match condition {
            None => Some(0),
            Some(Condition { start, gain }) => {
                (update >= start && (gain <= 0.0 || self.gain >= gain)).then_some(update)
            }
        };
        Self { opened: self.opened.or(since), ..self }
    }

    /// The state after an update in which the reward's log-likelihood was `reward` and the baseline's `baseline`, nats a row.
    pub fn after(self, reward: f64, baseline: Option<f64>) -> Self {
        match baseline {
            Some(baseline) => Self { gain: self.gain + RATE * (reward - baseline - self.gain), ..self },
            None => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learners::objective::Objective;
    use crate::options::presets::small;

    const WAITS: Option<Condition> = Some(Condition { start: 10, gain: 0.25 });

    #[test]
    fn it_waits_for_the_reward_and_for_its_time_and_never_closes() {
        let closed = Gate::default();
        assert_eq!(closed.before(100, WAITS).opened, None, "the reward is not learned");
        let learned = Gate { gain: 0.3, opened: None };
        assert_eq!(learned.before(9, WAITS).opened, None, "too early");
        assert_eq!(learned.before(10, WAITS).opened, Some(10));
        let open = Gate { gain: 0.1, opened: Some(10) };
        assert_eq!(open.before(50, WAITS).opened, Some(10));
        let at_once = Some(Condition { start: 0, gain: 0.0 });
        assert_eq!(Gate { gain: -5.0, opened: None }.before(0, at_once).opened, Some(0));
    }

    #[test]
    fn only_the_objective_that_states_it_waits() {
        for objective in Objective::all() {
            let condition = objective.gate(&small());
            assert_eq!(condition.is_some(), objective.name() == "vibes", "{objective}");
            let opened = Gate { gain: -5.0, opened: None }.before(0, condition).opened;
            assert_eq!(opened, if condition.is_some() { None } else { Some(0) }, "{objective}");
        }
    }

    /// What differs from `vibes` in the adversary alone.
    #[test]
    fn the_ablation_waits_where_it_is_asked_to() {
        let options = |table| crate::options::Options::resolve("small", &[("a test", table)]).unwrap();
        let plain = options(toml::toml! { objective = "no-adversary" });
        let waiting = options(toml::toml! { objective = "no-adversary" wait = "yes" });
        let vibes = Objective::all().find(|one| one.name() == "vibes").unwrap();
        assert_eq!(plain.objective.gate(&plain), None);
        assert_eq!(waiting.objective.gate(&waiting), vibes.gate(&small()));
        assert_eq!(waiting.objective.networks(&waiting, 1).heads, vibes.networks(&small(), 1).heads);
    }

    #[test]
    fn the_gain_follows_the_reward() {
        let mut gate = Gate::default();
        for _ in 0..500 {
            gate = gate.after(-1.0, Some(-2.0));
        }
        assert!((gate.gain - 1.0).abs() < 1e-3, "{}", gate.gain);
        assert_eq!(gate.after(5.0, None), gate, "nothing to compare with");
    }
}
