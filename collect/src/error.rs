//! Everything that can go wrong while collecting: the fact first, what would be right, the path last.

use std::path::{Path, PathBuf};

/// The result of this package's functions.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong in a simulation, a task, a policy or a trace.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("cannot {action}: {cause}: {path}")]
    Io {
        /// What was tried, as in "read".
        action: &'static str,
        /// The system's answer.
        cause: std::io::Error,
        /// The file or folder.
        path: PathBuf,
    },
    /// A file does not hold what its format asks for.
    #[error("{fact}; {expected}: {path}")]
    Malformed {
        /// What was found.
        fact: String,
        /// What would be right.
        expected: String,
        /// The file.
        path: PathBuf,
    },
    /// The recording's files refused.
    #[error(transparent)]
    Data(#[from] vibes_data::Error),
    /// A recorded episode is not what the simulator and the renderer make of it.
    #[error("episode {index}: {fact}; the recording and this build should agree")]
    Differs {
        /// The episode.
        index: u32,
        /// What differs.
        fact: String,
    },
    /// A recording that does not hold the episodes its options make, or whose options are not those of one command.
    #[error("{fact}; this needs a recording as vibes-collect made it: {path}")]
    NotAsPlanned {
        /// What is different.
        fact: String,
        /// The recording.
        path: PathBuf,
    },
    /// A recording was asked to become smaller, or something else than it is.
    #[error("the recording has {found}, asked for were {asked}; ask for as many or more: {path}")]
    Shrinks {
        /// What it has.
        found: String,
        /// What was asked for.
        asked: String,
        /// The recording.
        path: PathBuf,
    },
    /// A name that is not in its list.
    #[error("unknown {what} {name}; known are {known}")]
    UnknownName {
        /// "difficulty", "distractor", …
        what: &'static str,
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// Episodes that cannot be chosen, divided, joined or carried over as asked.
    #[error("{fact}; {expected}")]
    Selection {
        /// What was found.
        fact: String,
        /// What would be right.
        expected: String,
    },
    /// Somebody asked to stop while a folder was made.
    #[error("stopped; nothing is left behind, and the same command begins anew")]
    Stopped,
    /// The simulator refused a step of a trace or of a recorded episode.
    #[error("control step {step}: {cause}")]
    AtStep {
        /// The step, from 0.
        step: usize,
        /// What it said.
        cause: Box<Self>,
    },
    /// The simulator refused what a file holds.
    #[error("{cause}: {path}")]
    InFile {
        /// What it said.
        cause: Box<Self>,
        /// The file.
        path: PathBuf,
    },
    /// The simulation, a policy, a video or the renderer refused.
    #[error(transparent)]
    World(#[from] vibes_env::Error),
}

impl Error {
    pub(crate) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::Io { action, cause, path }
    }

    /// The same of one control step, from 0.
    pub(crate) fn at_step(self, step: usize) -> Self {
        Self::AtStep { step, cause: Box::new(self) }
    }

    /// The same where a file names the task, or holds what the simulator refuses: that is then no fault of what was typed. What names a file already stays.
    pub(crate) fn in_file(self, path: &Path) -> Self {
        use vibes_env::Error as World;
        match self {
            Self::World(World::UnknownTask { name, known }) => {
                Self::malformed(path, format!("unknown task {name}"), format!("the tasks are {known}"))
            }
            refused @ (Self::AtStep { .. }
            | Self::World(
                World::Length { .. } | World::Override { .. } | World::UnknownObject { .. } | World::Unstable { .. },
            )) => Self::InFile { cause: Box::new(refused), path: path.into() },
            other => other,
        }
    }

    pub(crate) fn malformed(path: impl Into<PathBuf>, fact: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Malformed { fact: fact.into(), expected: expected.into(), path: path.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_simulator_refuses_names_the_step_and_the_file_and_a_file_is_named_once() {
        let length = || vibes_env::Error::Length { what: "an action", found: 3, expected: 2, task: "t".to_owned() };
        let said = Error::from(length()).at_step(7).in_file(Path::new("a.json")).to_string();
        assert_eq!(said, "control step 7: an action has 3 numbers; the task t has 2: a.json");
        assert!(Error::from(length()).in_file(Path::new("a.json")).to_string().ends_with(": a.json"));
        let named = Error::malformed("b.json", "a fact", "what is right").in_file(Path::new("a.json")).to_string();
        assert_eq!(named, "a fact; what is right: b.json");
    }
}
