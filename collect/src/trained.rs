//! A trained run as one more policy.
//!
//! In: a run's folder. Out: a [`vibes_env::Policy`] that sees the pictures, or the vector observation, that the run was trained on, and what the
//! manifest says of it ([`ActedBy`]). The one place where the collector knows about networks.

use std::path::Path;

use serde::{Deserialize, Serialize};
use vibes_env::render::RenderSettings;
use vibes_env::{EnvironmentOptions, Error as WorldError, Policy, PolicySpec};

use crate::Result;

/// Who acted, as the manifest keeps it: the same recording made by another checkpoint is another recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActedBy {
    /// The run's name: its folder's last part.
    pub run: String,
    /// Which of its checkpoints, by what never changes about it, such as its number of updates and a checksum.
    pub checkpoint: String,
    /// Size and look of the pictures it saw; none for a policy of vector observations.
    pub pictures: Option<RenderSettings>,
}

/// Makes a policy, trained or not, for a task.
///
/// # Errors
/// When a run cannot be loaded or was trained on another task, and as [`PolicySpec::policy`].
pub fn policy(spec: &PolicySpec, task: &str, options: EnvironmentOptions) -> Result<Box<dyn Policy>> {
    match spec {
        PolicySpec::Run { path } => load(path, task).map(|(policy, _)| policy),
        PolicySpec::Random | PolicySpec::Planner { .. } | PolicySpec::Actions { .. } => Ok(spec.policy(task, options)?),
    }
}

/// What the manifest says of a run that acts.
///
/// # Errors
/// As [`policy`].
pub fn acted_by(path: &Path, task: &str) -> Result<ActedBy> {
    load(path, task).map(|(_, acted_by)| acted_by)
}

/// Loads a run's actor.
fn load(path: &Path, _task: &str) -> Result<(Box<dyn Policy>, ActedBy)> {
    Err(WorldError::Policy {
        text: path.display().to_string(),
        fact: "it holds no actor".to_owned(),
        expected: "a run that `vibes-train online` has trained".to_owned(),
    }
    .into())
}
