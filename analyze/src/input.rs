//! Reading what others wrote: tables of latents, the pictures of a recording, the metrics of runs.
//!
//! Everything is checked here, once: the modules behind it trust what they get.

mod choices;
mod columns;
mod found;
mod frames;
mod latents;
mod lists;
mod recorded;
mod results;
mod rows;
mod run;
mod tables;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

pub use choices::choices;
pub use columns::UserColumn;
pub use found::{find_latents, find_recording, newest_latents};
pub use frames::Frames;
pub(crate) use frames::differ;
pub(crate) use latents::MOVED;
pub use latents::{Asked, ReadLatents, read_asked, read_beside, read_latents, read_rows, read_with_origin};
pub use lists::Origin;
pub use results::{Cell, Results};
pub use rows::{Rows, RowsError};
pub use run::{Run, Series};
pub use tables::TableFile;

/// Why an input could not be read: the fact, what would be right, the path.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The operating system refused.
    #[error("cannot read: {cause}: {path}")]
    Io {
        /// The system's answer.
        cause: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// There are no latents to be found.
    #[error(
        "no latents found (looked for runs/**/latents*.arrow); name a table with --latents, or write one with `vibes-train encode RUN RECORDING`: {path}"
    )]
    NoLatents {
        /// The folder that was searched.
        path: PathBuf,
    },
    /// A file of another kind.
    #[error("{fact}; a table is an Arrow, Parquet, CSV, npy or npz file: {path}")]
    NotATable {
        /// What was found.
        fact: String,
        /// The file.
        path: PathBuf,
    },
    /// A table of nothing.
    #[error("the table has no rows; a row for each latent is expected: {path}")]
    NoRows {
        /// The file.
        path: PathBuf,
    },
    /// Columns are missing.
    #[error(
        "column {missing} is missing (found: {found}); needed are episode, step (integers) and latent (a list of floats a row): {path}"
    )]
    MissingColumn {
        /// The missing column.
        missing: String,
        /// The columns that are there.
        found: String,
        /// The file.
        path: PathBuf,
    },
    /// A plain array, of which nobody says whose rows it holds.
    #[error(
        "a plain array has no keys: {rows} rows{fact}; name the recording whose rows they are, in order, with --recording: {path}"
    )]
    NoKeys {
        /// How many rows it has.
        rows: usize,
        /// What the recording that was named has, if one was.
        fact: String,
        /// The file.
        path: PathBuf,
    },
    /// A plain array that some rows of a map are of, and nobody knows which.
    #[error(
        "a plain array has no keys: {rows} rows, and the map is of {of_map}, of which nobody knows which they are; make the map of all rows, or of a table with the columns episode and step: {path}"
    )]
    SomeOfArray {
        /// How many rows it has.
        rows: usize,
        /// How many rows the map has.
        of_map: usize,
        /// The file.
        path: PathBuf,
    },
    /// A column holds what it must not.
    #[error("column {column}: {fact}; {expected}: {path}")]
    Column {
        /// Its name.
        column: String,
        /// What was found.
        fact: String,
        /// What would be right.
        expected: String,
        /// The file.
        path: PathBuf,
    },
    /// An evaluation of a run that is damaged.
    #[error(
        "{fact}; an evaluation as `vibes-train evaluate` writes it is expected; write it anew, or take it away: {path}"
    )]
    Document {
        /// What is wrong with it.
        fact: String,
        /// The file.
        path: PathBuf,
    },
    /// Nobody has a column that is asked for.
    #[error("no table has a column {column}, choose among {found}, or name the table that has it with --join: {path}")]
    NoSuchColumn {
        /// What was asked for.
        column: String,
        /// What the tables have.
        found: String,
        /// The latents.
        path: PathBuf,
    },
    /// No run and no table has what is asked for.
    #[error("no run and no table of results has {name}, choose among {found}")]
    NoSuchResult {
        /// What was asked for.
        name: String,
        /// What there is.
        found: String,
    },
    /// A key that is the end of several names whose values differ.
    #[error("{name} stands for several things that differ; name one of them in full: {found}: {path}")]
    AmbiguousResult {
        /// What was asked for.
        name: String,
        /// The names in full.
        found: String,
        /// The run.
        path: PathBuf,
    },
    /// A table that cannot be joined.
    #[error(
        "column episode is missing (found: {found}); a table is joined on episode and step, or on episode alone: {path}"
    )]
    NoJoin {
        /// The columns that are there.
        found: String,
        /// The table.
        path: PathBuf,
    },
    /// A joined table that nothing is asked of.
    #[error(
        "--join has no effect: no column of this table is named by --where, --color or --target, or the latents' own table has it; it has {found}: {path}"
    )]
    IdleJoin {
        /// The columns that are there.
        found: String,
        /// The table.
        path: PathBuf,
    },
    /// An expression that does not fit the table.
    #[error(
        "{fact}; --where takes an expression over the table's columns that is true of some rows, not {text:?}: {path}"
    )]
    Rows {
        /// What came of it.
        fact: String,
        /// The expression.
        text: String,
        /// The latents.
        path: PathBuf,
    },
    /// The latents name a recording that is not there.
    #[error(
        "the recording {named} that these latents were encoded from is not there; name it with --recording, or go on without pictures with --no-frames: {path}"
    )]
    NoRecording {
        /// What the latents' metadata says.
        named: String,
        /// The latents.
        path: PathBuf,
    },
    /// Latents and recording do not belong together.
    #[error("these latents were not encoded from this recording: {fact}: {path}")]
    OtherRecording {
        /// The first contradiction.
        fact: String,
        /// The recording.
        path: PathBuf,
    },
    /// A file that is no map to project onto.
    #[error("{fact}; --onto takes the map.arrow that `vibes-analyze umap` wrote: {path}")]
    NotAMap {
        /// What was found.
        fact: String,
        /// The file.
        path: PathBuf,
    },
    /// The latents of an old map are gone.
    #[error("the latents {named} that this map is of are not there; name them with --onto-latents: {path}")]
    NoOldLatents {
        /// What the map's metadata says.
        named: String,
        /// The map.
        path: PathBuf,
    },
    /// A folder that is no run.
    #[error("no metrics here (a run is a folder with a metrics.jsonl): {path}")]
    NoRun {
        /// The folder.
        path: PathBuf,
    },
    /// A recording that cannot be read.
    #[error(transparent)]
    Recording(#[from] vibes_data::Error),
}

impl InputError {
    fn io(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |cause| Self::Io { cause, path }
    }
}
