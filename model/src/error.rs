//! What can go wrong with a model: a file that is not a checkpoint, tensors of another shape, a picture too small for the network.

use std::path::PathBuf;

/// An error of this package.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Reading or writing failed.
    #[error("{cause}; wanted to {action} a checkpoint: {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file is not a checkpoint.
    #[error("not a checkpoint ({why}); a checkpoint is a model.safetensors written by vibes-train: {}", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A tensor that the configured model has is not in the file.
    #[error("the checkpoint has no tensor `{name}`, which the model it describes needs")]
    MissingTensor {
        /// Name of the parameter.
        name: String,
    },
    /// A tensor has another shape than the model's parameter.
    #[error("tensor `{name}` has shape {found:?} in the checkpoint; the model needs {wanted:?}")]
    TensorShape {
        /// Name of the parameter.
        name: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape of the parameter.
        wanted: Vec<usize>,
    },
    /// A weight is infinite or no number.
    #[error("tensor `{name}` holds {value}; weights are finite numbers, of a training that did not diverge: {}", path.display())]
    NotFinite {
        /// Name of the parameter.
        name: String,
        /// The first such number.
        value: f32,
        /// The file.
        path: PathBuf,
    },
    /// The environment asks for instructions that there are not.
    #[error("{variable} is `{asked}`; it may be one of {}", known.join(", "))]
    UnknownInstructions {
        /// The environment variable.
        variable: &'static str,
        /// What it holds.
        asked: String,
        /// What it may hold.
        known: Vec<&'static str>,
    },
    /// The model has no head of this name.
    #[error("the model has no head `{name}`; it has {}", known.join(", "))]
    MissingHead {
        /// The head asked for.
        name: String,
        /// The heads there are.
        known: Vec<String>,
    },
    /// The network cannot take such pictures.
    #[error("pictures of {height}×{width} are too small; the network needs at least {least}×{least}")]
    PictureTooSmall {
        /// Rows of the picture.
        height: usize,
        /// Columns of the picture.
        width: usize,
        /// The least rows and columns.
        least: usize,
    },
    /// The model-free agents' networks cannot take such pictures.
    #[error("pictures of {height}×{width} are too small for four 3×3 convolutions; at least 15×15 are needed")]
    StackTooSmall {
        /// Rows of the picture.
        height: usize,
        /// Columns of the picture.
        width: usize,
    },
    /// What the model was made for and what it is given differ.
    #[error("the model takes {wanted}, but the recording holds {found}")]
    Mismatch {
        /// What the model was made for.
        wanted: String,
        /// What it is given.
        found: String,
    },
}
