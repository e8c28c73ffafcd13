//! Results of many runs as one table: a row a run, from run folders and from tables of a user's own.
//!
//! In: paths, and the names of what is asked for. Of a run folder these are its metrics (that of `vibes-train evaluate` of the newest checkpoint that it judged, else of the last evaluation, else the mean of the last tenth), what `run.json` holds under that
//! name (`objective`, an option before what came of it; in full `model.reward_scale`), its `task`, and `run`, the folder's name; of a table, its columns.
//! Out: rows of numbers and texts, those that an expression chooses.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use polars::prelude::{Column, DataFrame, IntoLazy};
use serde_json::Value;

use super::columns::UserColumn;
use super::tables::{TableFile, quietly};
use super::{InputError, Rows, Run, choices};

/// A value of one run.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
    /// The run does not have it.
    Nothing,
}

impl Cell {
    /// The number; none for a text.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number).filter(|number| number.is_finite()),
            _ => None,
        }
    }

    /// As a key of a table.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.clone(),
            Self::Nothing => "–".into(),
        }
    }
}

/// Runs, or tables of their results.
#[derive(Debug)]
pub struct Results {
    sources: Vec<Source>,
}

#[derive(Debug)]
enum Source {
    Run { run: Box<Run>, info: BTreeMap<String, Value> },
    Table { file: TableFile, path: PathBuf },
}

impl Results {
    /// Opens run folders and tables.
    ///
    /// # Errors
    /// [`InputError`]: neither a run nor a table.
    pub fn open(paths: &[PathBuf]) -> Result<Self, InputError> {
        let open = |path: &PathBuf| {
            if path.is_file() {
                return Ok(Source::Table { file: TableFile::open(path)?, path: path.clone() });
            }
            let run = Run::read(path)?;
            let mut info = BTreeMap::new();
            let about = run.info.as_ref().and_then(|info| serde_json::to_value(info).ok()).unwrap_or(Value::Null);
            flatten("", &about, &mut info);
            Ok(Source::Run { run: Box::new(run), info })
        };
        Ok(Self { sources: paths.iter().map(open).collect::<Result<_, InputError>>()? })
    }

    /// Everything that can be asked for.
    #[must_use]
    pub fn names(&self) -> BTreeSet<String> {
        let of = |source: &Source| -> Vec<String> {
            match source {
                Source::Run { run, info } => {
                    let own = ["run", "task"].map(String::from);
                    own.into_iter().chain(run.names().map(String::from)).chain(info.keys().cloned()).collect()
                }
                Source::Table { file, .. } => file.names().to_vec(),
            }
        };
        self.sources.iter().flat_map(of).collect()
    }

    /// Whether all of them are run folders.
    #[must_use]
    pub fn are_runs(&self) -> bool {
        self.sources.iter().all(|source| matches!(source, Source::Run { .. }))
    }

    /// What must be known of the runs' numbers, a sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let of = |source: &Source| match source {
            Source::Run { run, .. } => run.remarks(),
            Source::Table { .. } => Vec::new(),
        };
        self.sources.iter().flat_map(of).collect()
    }

    /// The run folders among them.
    pub fn runs(&self) -> impl Iterator<Item = &Run> {
        self.sources.iter().filter_map(|source| match source {
            Source::Run { run, .. } => Some(run.as_ref()),
            Source::Table { .. } => None,
        })
    }

    /// The protocol under which each source was evaluated last; none of tables.
    #[must_use]
    pub fn protocols(&self) -> Vec<Option<&str>> {
        self.sources
            .iter()
            .map(|source| match source {
                Source::Run { run, .. } => run.protocol(),
                Source::Table { .. } => None,
            })
            .collect()
    }

    /// Whether a source has something of this name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.sources.iter().any(|source| match source {
            // What stands for several things is there.
            Source::Run { run, info } => of_run(run, info, name).ok() != Some(Cell::Nothing),
            Source::Table { file, .. } => file.has(name),
        })
    }

    /// The rows that are chosen, with what is asked for in its order.
    ///
    /// # Errors
    /// [`InputError`]: nobody has what is asked for, it stands for several things in a run, or the expression fits no row.
    pub fn read(&self, asked: &[String], rows: Option<&Rows>) -> Result<Vec<Vec<Cell>>, InputError> {
        self.read_with(asked, &[], rows)
    }

    /// The same of keys and, behind them, of metrics: `objective` is both.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_with(
        &self,
        keys: &[String],
        metrics: &[String],
        rows: Option<&Rows>,
    ) -> Result<Vec<Vec<Cell>>, InputError> {
        let of_rows = rows.map_or(&[][..], |rows| &rows.columns);
        let (asked, names) = (keys.len() + metrics.len(), [keys, metrics, of_rows].concat());
        let is_metric = |at: usize| (keys.len()..asked).contains(&at);
        if let Some(missing) = names.iter().find(|name| !self.has(name)) {
            let found = choices(missing, self.names().iter().map(String::as_str));
            return Err(InputError::NoSuchResult { name: missing.clone(), found });
        }
        let mut all: Vec<Vec<Cell>> = Vec::new();
        for source in &self.sources {
            match source {
                Source::Run { run, info } => {
                    let cell = |(at, name): (usize, &String)| match run.final_value(name).filter(|_| is_metric(at)) {
                        Some(last) => Ok(Cell::Number(last)),
                        None => of_run(run, info, name),
                    };
                    all.push(names.iter().enumerate().map(cell).collect::<Result<_, InputError>>()?);
                }
                Source::Table { file, path } => all.extend(of_table(file, path, &names)?),
            }
        }
        let Some(rows) = rows else { return Ok(all) };
        // What the expression names stands behind what is asked for: a metric there may be a key here.
        let looked_at: Vec<Vec<Cell>> = all.iter().map(|row| row[asked..].to_vec()).collect();
        let kept = choose(of_rows, &looked_at, rows)?;
        Ok(kept.into_iter().map(|row| all[row][..asked].to_vec()).collect())
    }
}

/// Every leaf of a document under its full name, as in `options.latent`.
fn flatten(name: &str, value: &Value, into: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(fields) => {
            for (field, value) in fields {
                flatten(&if name.is_empty() { field.clone() } else { format!("{name}.{field}") }, value, into);
            }
        }
        Value::Null => {}
        leaf => {
            into.insert(name.into(), leaf.clone());
        }
    }
}

fn of_run(run: &Run, info: &BTreeMap<String, Value>, name: &str) -> Result<Cell, InputError> {
    if name == "run" {
        return Ok(Cell::Text(run.name.clone()));
    }
    if let Some(task) = run.task().filter(|_| name == "task") {
        return Ok(Cell::Text(task.into()));
    }
    // `objective` and `dynamics_weight` are metrics and options: as keys they are what the run was asked to do.
    let full = told(info, name).map_err(|found| InputError::AmbiguousResult {
        name: name.into(),
        found: found.join(", "),
        path: run.path.clone(),
    })?;
    Ok(match full {
        Some(Value::String(text)) => Cell::Text(text.clone()),
        Some(Value::Number(number)) => number.as_f64().map_or(Cell::Nothing, Cell::Number),
        other => match run.final_value(name) {
            Some(last) => Cell::Number(last),
            None => other.map_or(Cell::Nothing, |other| Cell::Text(other.to_string())),
        },
    })
}

/// What `run.json` holds under a name: of options, in full, or under a longer one that ends with it. Where several of these differ, the error lists them.
fn told<'i>(info: &'i BTreeMap<String, Value>, name: &str) -> Result<Option<&'i Value>, Vec<&'i str>> {
    // Calibration gives `reward_scale` another value in the model than was asked for.
    if let Some(own) = info.get(&format!("options.{name}")).or_else(|| info.get(name)) {
        return Ok(Some(own));
    }
    let end = format!(".{name}");
    let found: Vec<(&str, &Value)> =
        info.iter().filter(|(key, _)| key.ends_with(&end)).map(|(key, value)| (key.as_str(), value)).collect();
    let first = found.first().map(|(_, value)| *value);
    if found.iter().any(|(_, value)| Some(*value) != first) {
        return Err(found.into_iter().map(|(key, _)| key).collect());
    }
    Ok(first)
}

fn of_table(file: &TableFile, path: &Path, names: &[String]) -> Result<Vec<Vec<Cell>>, InputError> {
    let there: BTreeSet<String> = names.iter().filter(|name| file.has(name)).cloned().collect();
    let there: Vec<String> = there.into_iter().collect();
    let frame = file.read(&there)?;
    let mut rows = vec![vec![Cell::Nothing; names.len()]; frame.height()];
    for (at, name) in names.iter().enumerate().filter(|(_, name)| there.contains(name)) {
        let Ok(column) = frame.column(name) else { continue };
        match UserColumn::read(column.as_materialized_series(), path)? {
            UserColumn::Numbers(values) => {
                let filled = rows.iter_mut().zip(values).filter(|(_, value)| !value.is_nan());
                filled.for_each(|(row, value)| row[at] = Cell::Number(value));
            }
            UserColumn::Kinds { of_row, names } => {
                for (row, kind) in rows.iter_mut().zip(of_row) {
                    row[at] = kind.map_or(Cell::Nothing, |kind| Cell::Text(names[kind as usize].clone()));
                }
            }
        }
    }
    Ok(rows)
}

/// The numbers of the rows of which the expression is true.
fn choose(names: &[String], all: &[Vec<Cell>], rows: &Rows) -> Result<Vec<usize>, InputError> {
    let fault = |fact: String| InputError::Rows { fact, text: rows.text.clone(), path: PathBuf::from("the results") };
    let column = |at: usize| {
        let cells = || all.iter().map(move |row| &row[at]);
        if cells().any(|cell| matches!(cell, Cell::Text(_))) {
            let texts: Vec<Option<String>> = cells().map(|c| Some(c.text()).filter(|_| *c != Cell::Nothing)).collect();
            return Column::new(names[at].as_str().into(), texts);
        }
        Column::new(names[at].as_str().into(), cells().map(Cell::number).collect::<Vec<Option<f64>>>())
    };
    let index = "number of the row";
    let mut columns: Vec<Column> = (0..names.len()).map(column).collect();
    columns.push(Column::new(index.into(), (0..all.len() as u32).collect::<Vec<u32>>()));
    let filter = || {
        let kept = DataFrame::new_infer_height(columns)?.lazy().filter(rows.expression.clone()).collect()?;
        let numbers = kept.column(index)?.u32()?.into_no_null_iter().map(|row| row as usize).collect::<Vec<_>>();
        Ok::<_, polars::prelude::PolarsError>(numbers)
    };
    let kept = quietly(filter).map_err(fault)?;
    let kept = kept.map_err(|error| fault(error.to_string().lines().next().unwrap_or_default().to_string()))?;
    if kept.is_empty() { Err(fault("no row is chosen".into())) } else { Ok(kept) }
}

#[cfg(test)]
mod tests;
