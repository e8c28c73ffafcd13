//! Everything that can go wrong in a simulation, a task, a policy, a distractor or a picture: the fact first, what would be right, the path last.

use std::path::PathBuf;

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
    /// A task whose states cannot be turned.
    #[error("{task} is not the same turned about the origin; of the tasks these are: {known}")]
    NoRotation {
        /// The task.
        task: String,
        /// The tasks whose states can be turned.
        known: String,
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
    /// A folder holds too few videos of a set.
    #[error("{found} {what}; {wanted} are needed, each a folder of .jpg or .png frames: {path}")]
    TooFewVideos {
        /// How many there are.
        found: usize,
        /// Videos of which set, and which part of the folder that is.
        what: &'static str,
        /// How many are needed.
        wanted: usize,
        /// The folder.
        path: PathBuf,
    },
    /// More videos of a set than any program takes.
    #[error("{wanted} videos of a set; right is 1 to {most}")]
    TooManyVideos {
        /// How many were asked for.
        wanted: usize,
        /// How many there may be.
        most: u16,
    },
    /// Somebody asked to stop while background videos were made.
    #[error("stopped while background videos were made; those that are done are kept, and the same command goes on")]
    Stopped,
    /// Nothing can be drawn on this machine.
    #[error(
        "cannot draw without EGL: {fact}; run `make setup`, or on Debian and Ubuntu: sudo apt-get install libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri libopengl0"
    )]
    NoEgl {
        /// What EGL answered.
        fact: String,
    },
    /// A picture that cannot be drawn.
    #[error("cannot draw: {fact}; {expected}")]
    Render {
        /// What is wrong.
        fact: String,
        /// What would be right.
        expected: String,
    },
    /// No task has that name.
    #[error("unknown task {name}; the tasks are {known}")]
    UnknownTask {
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A policy, or a mix of them, that cannot be read.
    #[error("cannot read the policy {text}: {fact}; {expected}")]
    Policy {
        /// What was typed.
        text: String,
        /// What is wrong with it.
        fact: String,
        /// What would be right.
        expected: String,
    },
    /// A policy of another package could not choose an action.
    #[error("the policy {policy} cannot act: {cause}")]
    Acting {
        /// Its name, as typed.
        policy: String,
        /// Its own error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// MuJoCo refused a model.
    #[error("MuJoCo cannot load the model {name}: {fact}")]
    Model {
        /// The model's file name.
        name: String,
        /// MuJoCo's answer.
        fact: String,
    },
    /// A model has no object of that name.
    #[error("the model has no {kind} named {name}; it has {known}")]
    UnknownObject {
        /// "geom", "body", …
        kind: &'static str,
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A model override that cannot be applied.
    #[error("model override {field}: {fact}; {expected}")]
    Override {
        /// The field, as in `geom_pos`.
        field: String,
        /// What is wrong with it.
        fact: String,
        /// What would be right.
        expected: String,
    },
    /// A list of another length than the model's.
    #[error("{what} has {found} numbers; the task {task} has {expected}")]
    Length {
        /// "an action", "qpos", …
        what: &'static str,
        /// How many were given.
        found: usize,
        /// How many it takes.
        expected: usize,
        /// The task.
        task: String,
    },
    /// The simulation left the finite numbers.
    #[error("the simulation of {task} became unstable at {seconds:.3} s ({warnings}); smaller actions keep it stable")]
    Unstable {
        /// The task.
        task: String,
        /// Simulated time.
        seconds: f64,
        /// MuJoCo's warnings.
        warnings: String,
    },
    /// No start without a collision was found.
    #[error("{task} found no start without a collision in {attempts} attempts; try another seed")]
    NoFreeStart {
        /// The task.
        task: String,
        /// How many were tried.
        attempts: usize,
    },
}

impl Error {
    pub(crate) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::Io { action, cause, path }
    }

    pub(crate) fn malformed(path: impl Into<PathBuf>, fact: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Malformed { fact: fact.into(), expected: expected.into(), path: path.into() }
    }
}
