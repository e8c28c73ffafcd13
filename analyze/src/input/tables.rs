//! Tables as users have them: Arrow files and streams, Parquet, CSV and NumPy arrays, compressed or not, whoever wrote them.
//!
//! In: a path; the file's first bytes say its kind. Out: the names of its columns, and those columns that are asked for, as a polars frame of plain
//! numbers, texts, truth values and lists. A column that nobody asks for is never looked at, so its type never decides. Foreign readers run behind
//! [`guarded`]: where one of them panics on a damaged file, the user reads what is wrong with the file.

mod arrow;
mod csv;
mod lengths;
mod numpy;
mod parquet;
mod plain;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use polars::prelude::{Column, DataFrame, Series};

use super::InputError;

/// What the first bytes of a file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    ArrowFile,
    ArrowStream,
    Parquet,
    Csv,
    Numpy,
}

/// A table on disk: what it has, before any of it is read.
#[derive(Clone, Debug)]
pub struct TableFile {
    path: PathBuf,
    kind: Kind,
    names: Vec<String>,
    metadata: BTreeMap<String, String>,
}

impl TableFile {
    /// Opens a table and reads what its columns are called.
    ///
    /// # Errors
    /// [`InputError`]: the file cannot be read, is empty, damaged, or of another kind.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let kind = kind(path)?;
        let (names, metadata) = guarded(path, || match kind {
            Kind::ArrowFile | Kind::ArrowStream => arrow::schema(path, kind == Kind::ArrowStream),
            Kind::Parquet => parquet::schema(path),
            Kind::Csv => csv::schema(path),
            Kind::Numpy => numpy::schema(path),
        })?;
        Ok(Self { path: path.into(), kind, names, metadata })
    }

    /// The columns it has.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether it has a column.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.names.iter().any(|n| n == name)
    }

    /// Whether it is NumPy's and holds latents without the key of any row, as a plain array does.
    pub(super) fn is_keyless_array(&self) -> bool {
        self.kind == Kind::Numpy && self.has("latent") && !self.has("episode") && !self.has("step")
    }

    /// A text of the schema's metadata, which only Arrow and Parquet files have.
    #[must_use]
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// Reads the columns of these names, all of one length, in this order.
    ///
    /// # Errors
    /// [`InputError`]: a column is missing, holds what no number, text or list of numbers is, or the file is damaged.
    pub fn read(&self, names: &[String]) -> Result<DataFrame, InputError> {
        if let Some(missing) = names.iter().find(|name| !self.has(name)) {
            return Err(InputError::MissingColumn {
                missing: missing.clone(),
                found: self.names.join(", "),
                path: self.path.clone(),
            });
        }
        let path = &self.path;
        let columns: Vec<Series> = guarded(path, || match self.kind {
            Kind::ArrowFile | Kind::ArrowStream => arrow::read(path, self.kind == Kind::ArrowStream, names),
            Kind::Parquet => parquet::read(path, names),
            Kind::Csv => csv::read(path, names),
            Kind::Numpy => numpy::read(path, names),
        })?;
        let lengths: Vec<String> = columns.iter().map(|c| format!("{} of {}", c.len(), c.name())).collect();
        if columns.windows(2).any(|pair| pair[0].len() != pair[1].len()) {
            return Err(InputError::Column {
                column: names.join(", "),
                fact: lengths.join(", "),
                expected: "one value a row in each".into(),
                path: path.clone(),
            });
        }
        let columns = columns.into_iter().map(Column::from).collect();
        DataFrame::new_infer_height(columns).map_err(|error| damaged(path, &error))
    }
}

fn kind(path: &Path) -> Result<Kind, InputError> {
    let mut first = Vec::new();
    File::open(path).and_then(|file| file.take(6).read_to_end(&mut first)).map_err(InputError::io(path))?;
    Ok(match first.as_slice() {
        [] => return Err(not_a_table(path, "an empty file")),
        m if m.starts_with(b"PAR1") => Kind::Parquet,
        m if m.starts_with(b"ARROW1") => Kind::ArrowFile,
        m if m.starts_with(b"\x93NUMPY") || m.starts_with(b"PK\x03\x04") => Kind::Numpy,
        m if m.starts_with(&[0xFF; 4]) => Kind::ArrowStream,
        _ => Kind::Csv,
    })
}

pub(super) fn not_a_table(path: &Path, fact: impl Into<String>) -> InputError {
    InputError::NotATable { fact: fact.into(), path: path.into() }
}

/// A foreign reader's refusal.
fn damaged(path: &Path, error: &impl ToString) -> InputError {
    let text = error.to_string();
    not_a_table(path, format!("a damaged or unsuitable file ({})", text.lines().next().unwrap_or_default()))
}

/// Runs a foreign reader; where it panics, the panic's text becomes an error and nothing is printed.
fn guarded<T>(path: &Path, read: impl FnOnce() -> Result<T, InputError>) -> Result<T, InputError> {
    let stopped = |text| Err(not_a_table(path, format!("a damaged or unsuitable file (its reader stopped: {text})")));
    quietly(read).unwrap_or_else(stopped)
}

/// Runs foreign code; where it panics, the panic's text is the error and nothing is printed.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    // One at a time: the hook belongs to the whole process.
    static HOOK: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let _one = HOOK.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let answer = catch_unwind(AssertUnwindSafe(work));
    std::panic::set_hook(hook);
    answer.map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given").to_string()
    })
}

/// The error for a column that holds what it must not.
pub(super) fn column(path: &Path, name: &str, fact: impl Into<String>, expected: &str) -> InputError {
    InputError::Column { column: name.into(), fact: fact.into(), expected: expected.into(), path: path.into() }
}
