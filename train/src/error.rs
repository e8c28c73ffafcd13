//! What can go wrong in training: options that contradict each other or the run, a recording that lacks what the model needs, a loss that is no longer
//! a number.

use std::any::Any;
use std::path::{Path, PathBuf};

use vibes_model::ModelError;

/// The result of this package's functions.
pub type Result<T> = std::result::Result<T, TrainError>;

/// An error of this package.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A model or checkpoint does not fit.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A recording or a table of latents is not as it should be.
    #[error(transparent)]
    Data(#[from] vibes_data::Error),
    /// Latents cannot be measured.
    #[error(transparent)]
    Measure(#[from] vibes_measure::Error),
    /// Reading or writing failed.
    #[error("cannot {action}: {cause}: {}", path.display())]
    Io {
        /// "read", "write", …
        action: &'static str,
        /// What the system said.
        cause: std::io::Error,
        /// The file or folder.
        path: PathBuf,
    },
    /// A file of this program's own making cannot be understood.
    #[error("{fact}; {wanted}: {}", path.display())]
    Malformed {
        /// What is wrong.
        fact: String,
        /// What would be right.
        wanted: String,
        /// The file.
        path: PathBuf,
    },
    /// An option has a value it cannot have.
    #[error("{0}")]
    Options(String),
    /// The run folder was begun with other options.
    #[error("this run has {key} = {found}, asked for was {asked}; repeat its {key} to go on with it, or name another folder with -o: {}", path.display())]
    OtherRun {
        /// The first option that differs.
        key: String,
        /// Its value in the run.
        found: String,
        /// The value asked for.
        asked: String,
        /// The run folder.
        path: PathBuf,
    },
    /// A sweep's folder was made by another plan.
    #[error("this run was made by another plan: {differences}; name another output in the plan, or take the folder away: {}", path.display())]
    OtherSweep {
        /// Which keys differ, and how.
        differences: String,
        /// The run's folder.
        path: PathBuf,
    },
    /// A model cannot be used with a recording.
    #[error("the recording holds {found}, the model needs {wanted}: {}", path.display())]
    OtherRecording {
        /// What the recording holds.
        found: String,
        /// What the model needs.
        wanted: String,
        /// The recording.
        path: PathBuf,
    },
    /// A model is to be judged in another world than the one it has learned from.
    #[error("this is a recording of {found}; the run has learned from {learned}, without which its rewards and dynamics mean nothing; record a grid of that: {}", path.display())]
    OtherWorld {
        /// The recording's world.
        found: String,
        /// The model's.
        learned: String,
        /// The recording.
        path: PathBuf,
    },
    /// The run to begin from holds another model.
    #[error("the model there has {found}; this run's has {wanted}; begin from a run of the same task, sizes and objective: {}", path.display())]
    OtherModel {
        /// What differs, as it was found.
        found: String,
        /// What differs, as it is wanted.
        wanted: String,
        /// The run folder.
        path: PathBuf,
    },
    /// A run without a world model where one is needed.
    #[error("this run's agent has no world model; name a run of `vibes-train offline`, or of `vibes-train online` without --agent: {}", path.display())]
    NoWorldModel {
        /// The run folder.
        path: PathBuf,
    },
    /// A kept copy of an online run, where a whole run is needed.
    #[error(
        "this is a kept copy of an online run, without moments and replay; act with it (`vibes-collect --policy`), or go on with the run that it was kept from: {}",
        path.display()
    )]
    KeptCopy {
        /// The run folder.
        path: PathBuf,
    },
    /// The checkpoint to go on from cannot be read.
    #[error("{cause}; {}: {}", remedy(*before), path.display())]
    DamagedCheckpoint {
        /// What is wrong with it.
        cause: Box<Self>,
        /// The updates of the one before it, if there is one.
        before: Option<u64>,
        /// The checkpoint's folder.
        path: PathBuf,
    },
    /// The training has left the numbers.
    #[error("update {update} diverged: {what} is {value}; {}try {remedy}: {}", kept(*is_kept), run.display())]
    Diverged {
        /// The update that was not made.
        update: u64,
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f32,
        /// Whether there is a checkpoint of before.
        is_kept: bool,
        /// What may help.
        remedy: &'static str,
        /// The run folder.
        run: PathBuf,
    },
    /// A quantity of an update is no longer a number.
    #[error("{what} is {value}; it should be a finite number")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f32,
    },
    /// A thread panicked.
    #[error(
        "the thread that {thread} panicked: {panic}; everything up to the last checkpoint is kept; run the same command again"
    )]
    Panicked {
        /// What the thread does.
        thread: &'static str,
        /// What the panic said.
        panic: String,
    },
    /// The thread that acts is gone.
    #[error(
        "the thread that acts in the environment stopped; everything up to the last checkpoint is kept; run the same command again"
    )]
    NoActor,
    /// Whoever listens wants what is being measured to end before it is whole.
    #[error("stopped before it was whole; give the same command again")]
    Stopped,
    /// The world that is acted in is not as asked.
    #[error(transparent)]
    World(#[from] vibes_env::Error),
    /// The thread that gathers windows is gone.
    #[error("the thread that gathers windows stopped; run the same command again")]
    NoWindows,
}

impl TrainError {
    /// A panic with its text, where it has one, of the thread that does this.
    pub(crate) fn panicked(thread: &'static str, panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        Self::Panicked { thread, panic: text.unwrap_or_else(|| "without a word".to_owned()) }
    }
}

/// For `map_err`: an I/O error with what was tried and where.
pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> TrainError {
    let path = path.to_owned();
    move |cause| TrainError::Io { action, cause, path }
}

/// A file of this program's own making that cannot be understood.
pub(crate) fn malformed(path: &Path, fact: impl std::fmt::Display, wanted: &str) -> TrainError {
    TrainError::Malformed { fact: fact.to_string(), wanted: wanted.to_owned(), path: path.to_owned() }
}

/// The refusal of the first of these options whose value is wrong, by its flag, with what it must be.
pub(crate) fn refuse<T: Copy + std::fmt::Display>(
    options: &[(&str, T)],
    is_wrong: impl Fn(T) -> bool,
    must: impl std::fmt::Display,
) -> Result<()> {
    match options.iter().find(|(_, value)| is_wrong(*value)) {
        Some((name, value)) => Err(TrainError::Options(format!("--{name} is {value}; it must {must}"))),
        None => Ok(()),
    }
}

/// What a training that has diverged leaves behind.
fn kept(is_kept: bool) -> &'static str {
    if is_kept { "the last good checkpoint is kept; " } else { "" }
}

/// What to do about a damaged checkpoint.
fn remedy(before: Option<u64>) -> String {
    match before {
        Some(update) => format!("to go on from the checkpoint before it, of update {update}, take this one away"),
        None => "there is no other checkpoint to go on from; begin again with another -o".to_owned(),
    }
}
