//! Everything that can go wrong with a recording, a run folder or a table of latents: the fact first, what would be right, the path last.

use std::path::PathBuf;

/// The result of this package's functions.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong with a recording, a run folder or a table of latents.
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
    /// There is no recording at that path.
    #[error("no recording here (a recording is a folder with a manifest.json): {path}")]
    NoRecording {
        /// The folder that was named.
        path: PathBuf,
    },
    /// A file does not hold what the format asks for.
    #[error("{fact}; {expected}: {path}")]
    Malformed {
        /// What was found.
        fact: String,
        /// What would be right.
        expected: String,
        /// The file.
        path: PathBuf,
    },
    /// An episode whose columns do not fit its recording's spec, before it is written.
    #[error("episode {index}: {fact}; {expected}")]
    Episode {
        /// The episode's number.
        index: u32,
        /// What was found.
        fact: String,
        /// What would be right.
        expected: String,
    },
    /// A recording of other options lies where a new one was asked for.
    #[error(
        "another recording is here: its {key} is {found}, asked for was {asked}; name another folder with -o or repeat its options: {path}"
    )]
    OtherRecording {
        /// The first option that differs.
        key: String,
        /// Its value in the recording.
        found: String,
        /// The value asked for.
        asked: String,
        /// The recording.
        path: PathBuf,
    },
    /// A recording under other background videos lies where a new one was asked for, though both name the same options: their folder holds others by now.
    #[error(
        "another recording is here: its videos were {found}; this folder now gives {asked}; put its own back, or name another folder with -o: {path}"
    )]
    OtherVideos {
        /// Those of the recording.
        found: String,
        /// Those that its options give now.
        asked: String,
        /// The recording.
        path: PathBuf,
    },
    /// Another process writes into the folder.
    #[error("{owner} is writing here; wait until it has ended, or name another folder with -o: {path}")]
    Owned {
        /// Who it is.
        owner: String,
        /// The folder.
        path: PathBuf,
    },
    /// The folder holds no run.
    #[error("no run here (a run is a folder with a run.json, made by `vibes-train offline` or `online`): {path}")]
    NoRun {
        /// The folder.
        path: PathBuf,
    },
    /// The run has not saved anything yet.
    #[error("this run has no checkpoint yet; train it with `vibes-train offline` or `online`: {path}")]
    NoCheckpoint {
        /// The run folder.
        path: PathBuf,
    },
    /// An episode that the recording does not hold.
    #[error("no episode {index} in this recording of {count} episodes: {path}")]
    NoEpisode {
        /// The episode's number.
        index: u32,
        /// How many there are.
        count: usize,
        /// The recording.
        path: PathBuf,
    },
    /// No episode is long enough for a window.
    #[error("no episode has {length} steps, the longest has {longest}; ask for shorter windows: {path}")]
    WindowTooLong {
        /// The window's length.
        length: usize,
        /// The longest episode.
        longest: usize,
        /// The recording.
        path: PathBuf,
    },
}

impl Error {
    pub(crate) fn malformed(path: impl Into<PathBuf>, fact: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Malformed { fact: fact.into(), expected: expected.into(), path: path.into() }
    }

    pub(crate) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::Io { action, cause, path }
    }
}
