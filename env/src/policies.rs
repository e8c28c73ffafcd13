//! Behaviour policies: who chooses the actions of a recording.
//!
//! In: a policy as typed (`random`, `planner:noise=0.3`, `actions:FILE`), or a mix of them with weights. Out: an action for every agent step,
//! from the simulation's present state and a passed-in generator.

mod actions;
mod mix;
mod planner;
mod random;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use rand::RngCore;

use crate::{Environment, EnvironmentOptions, Error, Result, Start};

pub use mix::PolicyMix;
pub use planner::{Planner, PlannerSettings};

/// A policy as asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum PolicySpec {
    /// Uniform in the action bounds, anew every agent step.
    Random,
    /// Predictive sampling on the true simulator, with the task's own reward.
    Planner {
        /// Standard deviation of the noise added to the executed action, as a share of half the action range.
        noise: f64,
    },
    /// The actions of a file, one row a step.
    Actions {
        /// A JSON list of rows, or a `vibes-trace/1` file.
        path: PathBuf,
    },
}

const EXPECTED: &str = "the policies are random, planner, planner:noise=SIGMA and actions:FILE";

impl FromStr for PolicySpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused =
            |fact: &str| Error::Policy { text: text.to_owned(), fact: fact.to_owned(), expected: EXPECTED.to_owned() };
        let (name, rest) = text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        match (name, rest) {
            ("random", None) => Ok(Self::Random),
            ("planner", None) => Ok(Self::Planner { noise: 0.0 }),
            ("planner", Some(option)) => {
                let number =
                    option.strip_prefix("noise=").ok_or_else(|| refused("the planner's only option is noise"))?;
                let noise: f64 = number.parse().map_err(|_error| refused(&format!("{number} is not a number")))?;
                let is_sensible = noise.is_finite() && noise >= 0.0;
                is_sensible.then_some(Self::Planner { noise }).ok_or_else(|| refused("noise is a number from 0 up"))
            }
            ("actions", Some(path)) if !path.is_empty() => Ok(Self::Actions { path: path.into() }),
            ("actions", _) => Err(refused("actions needs a file")),
            ("random", Some(_)) => Err(refused("random takes no options")),
            _ => Err(refused("no such policy")),
        }
    }
}

impl fmt::Display for PolicySpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random => f.write_str("random"),
            Self::Planner { noise } if *noise > 0.0 => write!(f, "planner:noise={noise}"),
            Self::Planner { .. } => f.write_str("planner"),
            Self::Actions { path } => write!(f, "actions:{}", path.display()),
        }
    }
}

/// A policy at work.
#[derive(Debug)]
pub enum Policy {
    /// See [`PolicySpec::Random`].
    Random,
    /// See [`PolicySpec::Planner`].
    Planner(Box<Planner>),
    /// See [`PolicySpec::Actions`]: the rows, and which is next.
    Actions(actions::Replay),
}

impl Policy {
    /// Makes a policy for a task; a planner loads its own simulation of it.
    pub fn new(spec: &PolicySpec, task: &str, options: EnvironmentOptions) -> Result<Self> {
        Ok(match spec {
            PolicySpec::Random => Self::Random,
            PolicySpec::Planner { noise } => Self::Planner(Box::new(Planner::new(task, options, *noise)?)),
            PolicySpec::Actions { path } => Self::Actions(actions::Replay::read(path)?),
        })
    }

    /// Gets ready for an episode.
    pub fn begin(&mut self, start: &Start) -> Result<()> {
        match self {
            Self::Random => Ok(()),
            Self::Planner(planner) => planner.begin(start),
            Self::Actions(replay) => {
                replay.begin();
                Ok(())
            }
        }
    }

    /// Chooses the action of the present state.
    pub fn act(&mut self, environment: &Environment, rng: &mut impl RngCore) -> Result<Vec<f64>> {
        match self {
            Self::Random => Ok(random::act(&environment.action_spec(), rng)),
            Self::Planner(planner) => Ok(planner.act(environment, rng)),
            Self::Actions(replay) => replay.act(environment),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_what_is_shown() {
        for text in ["random", "planner", "planner:noise=0.3", "actions:runs/a:b.json"] {
            assert_eq!(text.parse::<PolicySpec>().unwrap().to_string(), text);
        }
        assert_eq!("planner:noise=0".parse::<PolicySpec>().unwrap(), PolicySpec::Planner { noise: 0.0 });
    }

    #[test]
    fn a_wrong_policy_names_the_right_ones() {
        for text in [
            "",
            "Random",
            "random:0.3",
            "planner:",
            "planner:0.3",
            "planner:noise=-1",
            "planner:noise=inf",
            "actions",
            "actions:",
        ] {
            let error = text.parse::<PolicySpec>().unwrap_err().to_string();
            assert!(error.contains("planner:noise=SIGMA"), "{text}: {error}");
        }
    }
}
