//! A mix of policies with weights, as in `random:0.3,planner:noise=0.3:0.4,planner:0.3`: which policy makes which episode.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::PolicySpec;
use crate::{Error, Result};

/// Policies with their shares, which sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyMix(Vec<(PolicySpec, f64)>);

impl PolicyMix {
    /// A single policy for every episode.
    pub fn of(policy: PolicySpec) -> Self {
        Self(vec![(policy, 1.0)])
    }

    /// The policies with their shares.
    pub fn shares(&self) -> &[(PolicySpec, f64)] {
        &self.0
    }

    /// The same mix with its files and folders somewhere else.
    #[must_use]
    pub fn with_paths(&self, moved: &dyn Fn(&Path) -> PathBuf) -> Self {
        Self(self.0.iter().map(|(policy, share)| (policy.with_path(moved), *share)).collect())
    }

    /// The policy of an episode, by its number alone, so that it does not matter how many episodes there are or which are there already.
    ///
    /// Each policy is taken when it lags furthest behind its share, so every stretch of episodes holds them in about the right proportion.
    pub fn policy(&self, episode: u32) -> &PolicySpec {
        let mut taken = vec![0.0; self.0.len()];
        let mut choice = 0;
        for made in 0..=episode {
            let lag = |policy: usize| self.0[policy].1 * (f64::from(made) + 1.0) - taken[policy];
            // The first of equals, which `max_by` would not give.
            choice = (0..self.0.len()).rev().max_by(|&a, &b| lag(a).total_cmp(&lag(b))).unwrap_or(0);
            taken[choice] += 1.0;
        }
        &self.0[choice].0
    }
}

impl FromStr for PolicyMix {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused = |fact: String| Error::Policy {
            text: text.to_owned(),
            fact,
            expected: "a mix is POLICY:WEIGHT,POLICY:WEIGHT,… as in random:0.3,planner:noise=0.3:0.4,planner:0.3"
                .to_owned(),
        };
        let mut parts = Vec::new();
        // The path of a trained run may hold commas, as in runs/objective=vibes,seed=0: a part ends where its weight does.
        let mut begun: Option<String> = None;
        for piece in text.split(',') {
            let part = begun.take().map_or_else(|| piece.to_owned(), |begun| begun + "," + piece);
            match part.rsplit_once(':').map(|(policy, weight)| (policy, weight.parse::<f64>())) {
                Some((policy, Ok(weight))) if weight.is_finite() && weight > 0.0 => {
                    parts.push((policy.parse()?, weight));
                }
                Some((_, Ok(weight))) => return Err(refused(format!("the weight {weight} is not above 0"))),
                _ => begun = Some(part),
            }
        }
        if let Some(part) = begun {
            let fact = match part.rsplit_once(':') {
                Some((_, weight)) => format!("{weight} is not a weight"),
                None => format!("{part} has no weight"),
            };
            return Err(refused(fact));
        }
        let sum: f64 = parts.iter().map(|(_, weight)| weight).sum();
        Ok(Self(parts.into_iter().map(|(policy, weight)| (policy, weight / sum)).collect()))
    }
}

impl fmt::Display for PolicyMix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, (policy, share)) in self.0.iter().enumerate() {
            let comma = if place == 0 { "" } else { "," };
            write!(f, "{comma}{policy}:{share}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_episodes_hold_the_policies_in_proportion() {
        let mix: PolicyMix = "random:0.3,planner:noise=0.3:0.4,planner:0.3".parse().unwrap();
        let made: Vec<String> = (0..10).map(|episode| mix.policy(episode).to_string()).collect();
        let count = |name: &str| made.iter().filter(|policy| *policy == name).count();
        assert_eq!([count("random"), count("planner:noise=0.3"), count("planner")], [3, 4, 3], "{made:?}");
        assert_eq!(mix.policy(4), mix.policy(4));
    }

    #[test]
    fn weights_need_not_sum_to_one() {
        let mix: PolicyMix = "random:1,planner:3".parse().unwrap();
        assert_eq!(mix.to_string(), "random:0.25,planner:0.75");
    }

    #[test]
    fn a_path_with_commas_is_one_policy() {
        let run = "runs/objective=vibes,seed=0/online";
        let mix: PolicyMix = format!("{run}:1").parse().unwrap();
        assert_eq!(mix.shares().len(), 1);
        let both: PolicyMix = format!("random:1,{run}:3,planner:noise=0.3:4").parse().unwrap();
        let names: Vec<String> = both.shares().iter().map(|(policy, _)| policy.to_string()).collect();
        assert_eq!(names, ["random", run, "planner:noise=0.3"]);
        assert_eq!(both.to_string().parse::<PolicyMix>().unwrap(), both);
    }

    #[test]
    fn a_malformed_mix_says_how_one_looks() {
        for text in ["random", "random:0.3,", "random:x", "random:0", "random:-1", "walk:0.5", "planner:noise=0.3"] {
            let error = text.parse::<PolicyMix>().unwrap_err().to_string();
            assert!(error.contains("mix is POLICY:WEIGHT") || error.contains("the policies are"), "{text}: {error}");
        }
    }
}
