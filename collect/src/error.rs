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
    /// The simulation, a policy, a video or the renderer refused.
    #[error(transparent)]
    World(#[from] vibes_env::Error),
}

impl Error {
    pub(crate) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::Io { action, cause, path }
    }

    /// The same where a file names the task: that it is not known is then no fault of what was typed.
    pub(crate) fn in_file(self, path: &Path) -> Self {
        match self {
            Self::World(vibes_env::Error::UnknownTask { name, known }) => {
                Self::malformed(path, format!("unknown task {name}"), format!("the tasks are {known}"))
            }
            other => other,
        }
    }

    pub(crate) fn malformed(path: impl Into<PathBuf>, fact: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Malformed { fact: fact.into(), expected: expected.into(), path: path.into() }
    }
}
