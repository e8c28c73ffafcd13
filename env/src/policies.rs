//! Whoever acts: a [`Policy`] begins an episode and chooses an action at every agent step, from what it may see.
//!
//! In: a policy as typed (`random`, `random:hold=10`, `planner:noise=0.3`, `actions:FILE`, a run's folder), or a mix of them with weights; at every agent step a
//! [`Sight`]: the vector observation, the picture, and for planners the simulator. Out: an action in the task's own bounds.
//! The policies that need no training live here; a trained agent is one more ([`Trained`]), made by whoever has its networks.

mod actions;
mod mix;
mod planner;
mod random;
mod trained;

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use rand::RngCore;

use crate::render::RenderSettings;
use crate::{Environment, EnvironmentOptions, Error, Result, Start};

pub use actions::Replay;
pub use mix::PolicyMix;
pub use planner::Planner;
pub use random::{HeldRandom, Random, SingleRandom};
pub use trained::{Chosen, Trained};

/// What a policy may look at when it chooses an action.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// The task's vector observation, `[observation]`, in single precision as a recording keeps it.
    pub observation: &'a [f32],
    /// The picture, `[height, width, 3]`, under the distractors; empty for a policy that asks for none ([`Policy::pictures`]).
    pub pixels: &'a [u8],
    /// The simulator itself, for planners and for what is known of the task (its bounds, its clock).
    pub environment: &'a Environment,
}

/// Whoever chooses the actions of an episode.
pub trait Policy: fmt::Debug {
    /// Size and look of the pictures it wants to see at every agent step; none for a policy that acts without pictures, so that nothing is drawn
    /// for it.
    fn pictures(&self) -> Option<RenderSettings> {
        None
    }

    /// Gets ready for an episode that begins at `start`: whatever it remembers of the last one is forgotten.
    ///
    /// # Errors
    /// When the start is not one of its task's.
    fn begin(&mut self, start: &Start) -> Result<()>;

    /// Chooses the action at the present row, `[action]`, in the task's own bounds. Called once for every agent step, in order; all that
    /// is random in it comes from `rng`.
    ///
    /// # Errors
    /// When it has no action for this row. [`Error::Acting`] is there for policies of other packages.
    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>>;
}

/// A policy as asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum PolicySpec {
    /// Uniform in the action bounds.
    Random {
        /// Agent steps for which each action is held, 1 or more.
        hold: u32,
    },
    /// Predictive sampling on the true simulator, with the task's own reward.
    Planner {
        /// Standard deviation of the noise added to the executed action, as a share of half the action range.
        noise: f64,
    },
    /// The actions of a file, one row a step.
    Actions {
        /// A JSON list of rows, one an agent step, or a `vibes-trace/1` file of the same task, which has one a control step.
        path: PathBuf,
    },
    /// A trained run's actor.
    Run {
        /// The run's folder.
        path: PathBuf,
    },
}

const EXPECTED: &str = "the policies are random, random:hold=STEPS, planner, planner:noise=SIGMA, actions:FILE and the folder of a trained run";

impl PolicySpec {
    /// The same policy with its file or folder, if it has one, somewhere else.
    #[must_use]
    pub fn with_path(&self, moved: &dyn Fn(&Path) -> PathBuf) -> Self {
        match self {
            Self::Random { .. } | Self::Planner { .. } => self.clone(),
            Self::Actions { path } => Self::Actions { path: moved(path) },
            Self::Run { path } => Self::Run { path: as_folder(moved(path)) },
        }
    }

    /// Makes the policy for a task; a planner loads its own simulation of it.
    ///
    /// # Errors
    /// For a file of actions that cannot be read, and for [`PolicySpec::Run`], which only a program that has the networks can load.
    pub fn policy(&self, task: &str, options: EnvironmentOptions) -> Result<Box<dyn Policy>> {
        Ok(match self {
            Self::Random { hold } => Box::new(HeldRandom::new(*hold)),
            Self::Planner { noise } => Box::new(Planner::new(task, options, *noise)?),
            Self::Actions { path } => Box::new(Replay::read(path)?),
            Self::Run { .. } => {
                return Err(Error::Policy {
                    text: self.to_string(),
                    fact: "a trained run cannot act here".to_owned(),
                    expected: "a policy that needs no networks".to_owned(),
                });
            }
        })
    }
}

impl PolicySpec {
    /// That what can be known before the first step is right: a file of actions has enough of them, each of the right length, and a trace is of this environment.
    ///
    /// # Errors
    /// The file cannot be read, or does not fit.
    pub fn check(&self, steps: u32, environment: &Environment) -> Result<()> {
        match self {
            Self::Actions { path } => Replay::read(path)?.check(steps, environment),
            Self::Random { .. } | Self::Planner { .. } | Self::Run { .. } => Ok(()),
        }
    }
}

/// A folder's name with a slash in it, by which a run differs from the name of a policy.
fn as_folder(path: PathBuf) -> PathBuf {
    if path.components().count() > 1 || path.is_absolute() { path } else { Path::new(".").join(path) }
}

impl FromStr for PolicySpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused =
            |fact: &str| Error::Policy { text: text.to_owned(), fact: fact.to_owned(), expected: EXPECTED.to_owned() };
        let (name, rest) = text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        match (name, rest) {
            ("random", None) => Ok(Self::Random { hold: 1 }),
            ("random", Some(option)) => {
                let number = option.strip_prefix("hold=").ok_or_else(|| refused("random's only option is hold"))?;
                let hold = number.parse().ok().filter(|hold| *hold > 0);
                hold.map(|hold| Self::Random { hold })
                    .ok_or_else(|| refused("hold is a number of agent steps from 1 up"))
            }
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
            // A run is named by its folder, which may hold a colon.
            _ if text.contains('/') || Path::new(text).is_dir() => Ok(Self::Run { path: text.into() }),
            _ => Err(refused("no such policy and no such folder")),
        }
    }
}

impl fmt::Display for PolicySpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random { hold: 1 } => f.write_str("random"),
            Self::Random { hold } => write!(f, "random:hold={hold}"),
            Self::Planner { noise } if *noise > 0.0 => write!(f, "planner:noise={noise}"),
            Self::Planner { .. } => f.write_str("planner"),
            Self::Actions { path } => write!(f, "actions:{}", path.display()),
            Self::Run { path } => write!(f, "{}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_what_is_shown() {
        for text in [
            "random",
            "random:hold=10",
            "planner",
            "planner:noise=0.3",
            "actions:runs/a:b.json",
            "runs/reacher",
            "./runs:1/a",
        ] {
            assert_eq!(text.parse::<PolicySpec>().unwrap().to_string(), text);
        }
        assert_eq!("random:hold=1".parse::<PolicySpec>().unwrap(), PolicySpec::Random { hold: 1 });
        assert_eq!("planner:noise=0".parse::<PolicySpec>().unwrap(), PolicySpec::Planner { noise: 0.0 });
    }

    #[test]
    fn a_wrong_policy_names_the_right_ones() {
        for text in [
            "",
            "Random",
            "random:0.3",
            "random:hold=0",
            "random:hold=-2",
            "random:hold=1.5",
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
