//! A mix of policies with weights, as in `random:0.3,planner:noise=0.3:0.4,planner:0.3`: which policy makes which episode.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::PolicySpec;
use crate::{Error, Result};

/// Largest difference of two shares that are one share, written by versions which rounded it another number of times.
const ROUNDING: f64 = 1e-12;

/// Policies with their shares, which sum to 1 but for rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyMix(Vec<(PolicySpec, f64)>);

impl PolicyMix {
    /// A single policy for every episode.
    pub fn of(policy: PolicySpec) -> Self {
        Self(vec![(policy, 1.0)])
    }

    /// Reads a mix that was written (`to_string`), with its shares to the last bit, by which a tie between two policies may be broken; which of them decide, [`PolicyMix::policy`]
    /// knows. What people type is for [`FromStr`].
    ///
    /// # Errors
    /// [`Error::Policy`] for text that is no mix.
    pub fn written(text: &str) -> Result<Self> {
        let mix = Self(parts(text)?);
        let sum = mix.sum();
        if !sum.is_finite() {
            return Err(refused(text, "the sum of its weights is no finite number".to_owned()));
        }
        let nothing = mix.0.iter().find(|(_, weight)| weight / sum <= 0.0);
        let fact =
            nothing.map(|(policy, weight)| format!("the weight {weight:e} of {policy} is nothing beside the others"));
        fact.map_or(Ok(mix), |fact| Err(refused(text, fact)))
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

    /// Whether this is the other mix, though its shares were rounded another number of times.
    pub fn is_same(&self, other: &Self) -> bool {
        let agree = |((policy, share), (known, other)): (&(PolicySpec, f64), &(PolicySpec, f64))| {
            policy == known && (share - other).abs() <= ROUNDING
        };
        self.0.len() == other.0.len() && self.0.iter().zip(&other.0).all(agree)
    }

    /// The policy of an episode, by its number alone, so that it does not matter how many episodes there are or which are there already.
    ///
    /// Each policy is taken when it lags furthest behind its share, so every stretch of episodes holds them in about the right proportion.
    pub fn policy(&self, episode: u32) -> &PolicySpec {
        let shares = self.deciding();
        let mut taken = vec![0.0; shares.len()];
        let mut choice = 0;
        for made in 0..=episode {
            let lag = |policy: usize| shares[policy] * (f64::from(made) + 1.0) - taken[policy];
            // The first of equals, which `max_by` would not give.
            choice = (0..shares.len()).rev().max_by(|&a, &b| lag(a).total_cmp(&lag(b))).unwrap_or(0);
            taken[choice] += 1.0;
        }
        &self.0[choice].0
    }

    fn sum(&self) -> f64 {
        self.0.iter().map(|(_, share)| share).sum()
    }

    /// The same mix, its weights divided by their sum.
    fn divided(self) -> Self {
        let sum = self.sum();
        Self(self.0.into_iter().map(|(policy, weight)| (policy, weight / sum)).collect())
    }

    /// The shares that decide: typed weights that were divided by their sum twice, since recordings have always been made by these, and a tie may be broken by the last bit.
    /// A mix with a file or a run is written after the second division, and any other after the first.
    fn deciding(&self) -> Vec<f64> {
        let sum = self.sum();
        let is_decided = self.has_path() && (sum - 1.0).abs() <= ROUNDING;
        self.0.iter().map(|(_, share)| if is_decided { *share } else { share / sum }).collect()
    }

    /// Whether a file of actions or a run is among the policies.
    fn has_path(&self) -> bool {
        let is_there = |policy: &PolicySpec| matches!(policy, PolicySpec::Actions { .. } | PolicySpec::Run { .. });
        self.0.iter().any(|(policy, _)| is_there(policy))
    }
}

impl FromStr for PolicyMix {
    type Err = Error;

    /// Reads a mix as typed, whose weights may have any sum.
    fn from_str(text: &str) -> Result<Self> {
        let mix = Self::written(text)?.divided();
        Ok(if mix.has_path() { mix.divided() } else { mix })
    }
}

/// The policies of a mix and the weights beside them.
fn parts(text: &str) -> Result<Vec<(PolicySpec, f64)>> {
    let mut parts = Vec::new();
    // The path of a trained run may hold commas, as in runs/objective=vibes,seed=0: a part ends where its weight does.
    let mut begun: Option<String> = None;
    for piece in text.split(',') {
        let part = begun.take().map_or_else(|| piece.to_owned(), |begun| begun + "," + piece);
        match part.rsplit_once(':').map(|(policy, weight)| (policy, weight.parse::<f64>())) {
            Some((policy, Ok(weight))) if weight.is_finite() && weight > 0.0 => {
                parts.push((policy.parse()?, weight));
            }
            Some((_, Ok(weight))) => return Err(refused(text, format!("the weight {weight} is not above 0"))),
            _ => begun = Some(part),
        }
    }
    let Some(part) = begun else { return Ok(parts) };
    let fact = match part.rsplit_once(':') {
        Some((_, weight)) => format!("{weight} is not a weight"),
        None => format!("{part} has no weight"),
    };
    Err(refused(text, fact))
}

fn refused(text: &str, fact: String) -> Error {
    let expected = "a mix is POLICY:WEIGHT,POLICY:WEIGHT,… as in random:0.3,planner:noise=0.3:0.4,planner:0.3";
    Error::Policy { text: text.to_owned(), fact, expected: expected.to_owned() }
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

    /// Divided by their sum once more, shares may move by their last bit, and a tie goes the other way.
    #[test]
    fn what_is_written_and_read_again_is_the_same_to_the_last_bit() {
        for weights in [[6.0, 3.0, 1.0], [5.0, 2.0, 2.0], [1.0, 0.4, 0.4], [1.0, 4.0, 1.0], [0.7, 0.2, 0.1]] {
            let [a, b, c] = weights;
            let typed: PolicyMix = format!("random:{a},planner:{b},actions:x.json:{c}").parse().unwrap();
            let mut again = typed.clone();
            for _ in 0..4 {
                again = PolicyMix::written(&again.with_paths(&|path: &Path| path.join("y")).to_string()).unwrap();
            }
            let shares = |mix: &PolicyMix| mix.shares().iter().map(|(_, share)| *share).collect::<Vec<f64>>();
            assert_eq!(shares(&again), shares(&typed), "{weights:?}");
        }
    }

    /// A recorder of before divided the typed weights, and the text that came of them once more, and chose by what came of that; with a path it wrote the latter.
    #[test]
    fn a_mix_is_played_as_it_always_was() {
        for (weights, last) in [[6.0, 3.0, 1.0], [5.0, 2.0, 2.0], [1.0, 0.4, 0.4], [1.0, 4.0, 1.0]]
            .into_iter()
            .flat_map(|weights| ["planner", "actions:x.json"].map(|last| (weights, last)))
        {
            let divided = |weights: [f64; 3]| {
                let sum: f64 = weights.iter().sum();
                weights.map(|weight| weight / sum)
            };
            let [a, b, c] = weights;
            let mix: PolicyMix = format!("random:{a},random:hold=2:{b},{last}:{c}").parse().unwrap();
            let shares = divided(divided(weights));
            let is_written_twice_divided = mix.shares().iter().map(|(_, share)| *share).eq(shares);
            assert!(last == "planner" || is_written_twice_divided, "{mix}");
            let mix = PolicyMix::written(&mix.to_string()).unwrap();
            let mut taken = [0.0; 3];
            for made in 0..200 {
                let lag = |policy: usize| shares[policy] * (f64::from(made) + 1.0) - taken[policy];
                let choice = (0..3).rev().max_by(|&a, &b| lag(a).total_cmp(&lag(b))).unwrap();
                taken[choice] += 1.0;
                assert_eq!(mix.policy(made), &mix.shares()[choice].0, "{weights:?}, episode {made}");
            }
        }
    }

    #[test]
    fn shares_that_were_rounded_once_more_are_the_same_and_others_are_not() {
        let mix = |text: &str| text.parse::<PolicyMix>().unwrap();
        let typed = mix("random:6,planner:3,random:hold=2:1");
        assert!(typed.is_same(&mix(&typed.to_string())) && typed.is_same(&mix(&mix(&typed.to_string()).to_string())));
        for other in ["random:6,planner:3", "random:6,planner:1,random:hold=2:3", "random:6,planner:3,planner:1"] {
            assert!(!typed.is_same(&mix(other)), "{other}");
        }
    }

    #[test]
    fn weights_that_leave_no_shares_are_refused() {
        for (text, said) in [
            ("random:1e308,planner:1e308", "the sum of its weights"),
            ("random:1e-320,planner:1e10", "of random is nothing beside the others"),
        ] {
            let error = text.parse::<PolicyMix>().unwrap_err().to_string();
            assert!(error.contains(said) && error.contains(text), "{error}");
        }
    }

    #[test]
    fn a_path_with_commas_is_one_policy() {
        let run = "runs/objective=vibes,seed=0/online";
        let mix: PolicyMix = format!("{run}:1").parse().unwrap();
        assert_eq!(mix.shares().len(), 1);
        let both: PolicyMix = format!("random:1,{run}:3,planner:noise=0.3:4").parse().unwrap();
        let names: Vec<String> = both.shares().iter().map(|(policy, _)| policy.to_string()).collect();
        assert_eq!(names, ["random", run, "planner:noise=0.3"]);
        assert_eq!(PolicyMix::written(&both.to_string()).unwrap(), both);
    }

    #[test]
    fn a_malformed_mix_says_how_one_looks() {
        for text in ["random", "random:0.3,", "random:x", "random:0", "random:-1", "walk:0.5", "planner:noise=0.3"] {
            let error = text.parse::<PolicyMix>().unwrap_err().to_string();
            assert!(error.contains("mix is POLICY:WEIGHT") || error.contains("the policies are"), "{text}: {error}");
        }
    }
}
