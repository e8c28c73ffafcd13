//! What is said about a file that is not as it should be.

use std::path::PathBuf;

/// Something wrong with one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: String,
}
