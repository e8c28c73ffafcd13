//! Tables of latents from any model, and a user's own columns beside them.
//!
//! Needed columns: `episode` and `step`, whole numbers; `latent`, a list of numbers of one length, or columns `latent_0`, `latent_1` and so on. Used
//! if present: `state` and `distractor` (whole numbers, the cell of a grid), `reward`. Any other column is read only if somebody asks for it: as a
//! colour, as a target of a probe, or in an expression that chooses rows. It may lie in a table of its own that is joined on (episode, step). What a recording
//! that is named knows of the rows, it gives where no table does: cells, rewards, and the keys of a plain array.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use polars::prelude::{
    Column, DataFrame, DataFrameJoinOps, DataType, IntoLazy, JoinArgs, JoinType, JoinValidation, MaintainOrderJoin,
    PolarsError, Series,
};
use vibes_data::{Latents, LatentsSource};

use super::columns::UserColumn;
use super::lists::{Lists, Narrowed, Origin};
use super::recorded::{Recorded, key_rows, number_rows};
use super::tables::{TableFile, column};
use super::{InputError, Rows, choices};

/// The columns of every row's key and of what is known about the row.
const KEYS: [&str; 2] = ["episode", "step"];
const KNOWN: [&str; 3] = ["state", "distractor", "reward"];
/// Numbers rows while they are joined and chosen.
const ROW: &str = "row of the table of latents";
/// A whole number as keys are.
const WHOLE: &str = "a whole number from 0 to 4294967295 in every row";

/// What is said of latents that were put about the origin of others.
pub(crate) const MOVED: &str = "these latents were put about the origin of the others that they are measured against, so that both are of one space";

/// What is asked for beside the latents.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Which rows; all unless given.
    pub rows: Option<Rows>,
    /// Tables joined on (episode, step), or on episode alone if they have no steps.
    pub joins: Vec<PathBuf>,
    /// Columns of the latents' table or of the joined ones.
    pub columns: Vec<String>,
    /// The recording whose rows these are, which gives the cells and rewards that no table has, and a plain array its keys.
    pub recording: Option<PathBuf>,
}

/// A table of latents as it was asked for.
#[derive(Clone, Debug)]
pub struct ReadLatents {
    /// The rows that were asked for.
    pub latents: Latents,
    /// The columns that were asked for, of the same rows.
    pub columns: Vec<(String, UserColumn)>,
    /// What the reader of results must know.
    pub remarks: Vec<String>,
}

/// Reads a whole table of latents.
///
/// # Errors
/// As [`read_asked`].
pub fn read_latents(path: &Path) -> Result<Latents, InputError> {
    read_asked(path, &Asked::default()).map(|read| read.latents)
}

/// Reads the rows of a table of latents that are asked for, with the columns that are asked for.
///
/// # Errors
/// [`InputError`]: an unreadable file, a missing or unsuitable column (the error names those that are needed), a row key that occurs twice, an
/// expression that chooses no row, a recording that lacks a row. Values that are not finite are left to the checks of [`vibes_measure::Table`].
pub fn read_asked(path: &Path, asked: &Asked) -> Result<ReadLatents, InputError> {
    read_with_origin(path, asked).map(|(read, _)| read)
}

/// The same of a table whose latents are compared with those of another, about whose origin they are put.
///
/// # Errors
/// As [`read_asked`].
pub fn read_beside(path: &Path, asked: &Asked, others: &Origin) -> Result<ReadLatents, InputError> {
    let (mut read, own) = read_with_origin(path, asked)?;
    if own != *others {
        own.move_to(others, &mut read.latents);
        read.remarks.push(MOVED.into());
    }
    Ok(read)
}

/// The same as [`read_asked`], with what was taken away from the latents.
///
/// # Errors
/// As [`read_asked`].
pub fn read_with_origin(path: &Path, asked: &Asked) -> Result<(ReadLatents, Origin), InputError> {
    read_some(path, asked, None)
}

/// The rows of these keys that a table of latents has, in its order, as they were read when an expression chose them. The rows of a plain array have these keys, in order.
///
/// # Errors
/// As [`read_asked`], and a plain array of another number of rows.
pub fn read_rows(path: &Path, episodes: &[u32], steps: &[u32]) -> Result<(ReadLatents, Origin), InputError> {
    read_some(path, &Asked::default(), Some((episodes, steps)))
}

/// Keys of rows: episodes and steps, one of each a row.
type RowKeys<'k> = (&'k [u32], &'k [u32]);

fn read_some(path: &Path, asked: &Asked, keys: Option<RowKeys<'_>>) -> Result<(ReadLatents, Origin), InputError> {
    let file = TableFile::open(path)?;
    let recorded = asked.recording.as_deref().map(Recorded::open).transpose()?;
    let lists = latent_columns(&file, path)?;
    let needed = needed(asked);
    let mut names: Vec<String> = KEYS.iter().chain(&KNOWN).filter(|n| file.has(n)).map(ToString::to_string).collect();
    names.extend(needed.iter().filter(|name| file.has(name) && !names.contains(name)).cloned().collect::<Vec<_>>());
    // A dimension may be asked for by name, too.
    let rest = lists.iter().filter(|list| !names.contains(list));
    let all: Vec<String> = names.iter().chain(rest).cloned().collect();
    let (mut frame, mut remarks) = (file.read(&all)?, Vec::new());
    if frame.height() == 0 {
        return Err(InputError::NoRows { path: path.into() });
    }
    if file.is_keyless_array() {
        match keys {
            Some(keys) => key_rows(&mut frame, keys, path)?,
            None => remarks.push(number_rows(&mut frame, recorded.as_ref(), path)?),
        }
        names.extend(KEYS.map(String::from));
    }
    let fault =
        |error: PolarsError| column(path, &names.join(", "), first_line(&error), "columns of numbers and texts");
    let mut flat = keyed(frame.select(names.iter()).map_err(fault)?, &KEYS, path)?;
    check_keys(&flat, path)?;
    let count = flat.height() as u32;
    flat.with_column(Column::new(ROW.into(), (0..count).collect::<Vec<u32>>())).map_err(fault)?;
    for table in &asked.joins {
        flat = join(flat, table, &needed, &mut remarks)?;
    }
    if let Some(recorded) = &recorded {
        let (episodes, steps) = (known(whole(&flat, "episode", path)?), known(whole(&flat, "step", path)?));
        let columns = recorded.columns(&episodes, &steps, |name| flat.column(name).is_err())?;
        columns.into_iter().try_for_each(|column| flat.with_column(column).map(|_| ())).map_err(fault)?;
    }
    if let Some(missing) = needed.iter().find(|name| flat.column(name).is_err()) {
        let found = flat.get_column_names().into_iter().map(ToString::to_string).filter(|n| n != ROW);
        let found: Vec<String> = found.chain(file.names().iter().cloned()).collect();
        let found = choices(missing, found.iter().map(String::as_str));
        return Err(InputError::NoSuchColumn { column: missing.clone(), found, path: path.into() });
    }
    if let Some(rows) = &asked.rows {
        flat = choose(flat, rows, path)?;
        remarks.push(format!("{} of {count} rows are looked at: {}", flat.height(), rows.text));
    }
    if let Some(keys) = keys {
        flat = of_keys(&flat, keys, path)?;
    }
    let lists = lists.iter().map(|name| series(&frame, name, path)).collect::<Result<Vec<_>, _>>()?;
    let lists = Lists::read(&lists, path)?;
    let is_part = asked.rows.is_some() || keys.is_some();
    let kept: Option<Vec<u32>> = is_part.then(|| whole(&flat, ROW, path)).transpose()?.map(known);
    let Narrowed { dims, latent, origin, remark } = lists.narrow(kept.as_deref());
    remarks.extend(remark);
    let columns =
        asked.columns.iter().map(|name| Ok((name.clone(), UserColumn::read(&series(&flat, name, path)?, path)?)));
    let columns = columns.collect::<Result<Vec<_>, InputError>>()?;
    let optional = |name: &str| match flat.column(name) {
        Ok(_) => whole(&flat, name, path),
        Err(_) => Ok(vec![None; flat.height()]),
    };
    let source = |key: &str| file.metadata(key).map(String::from);
    let latents = Latents {
        episode: known(whole(&flat, "episode", path)?),
        step: known(whole(&flat, "step", path)?),
        state: optional("state")?,
        distractor: optional("distractor")?,
        reward: rewards(&flat, path)?,
        dims,
        latent,
        source: LatentsSource { recording: source("vibes.recording"), checkpoint: source("vibes.checkpoint") },
    };
    Ok((ReadLatents { latents, columns, remarks }, origin))
}

/// The columns that the latents lie in: `latent`, or `latent_0`, `latent_1` and so on.
fn latent_columns(file: &TableFile, path: &Path) -> Result<Vec<String>, InputError> {
    let missing = |missing: &str| InputError::MissingColumn {
        missing: missing.into(),
        found: file.names().join(", "),
        path: path.into(),
    };
    if let Some(key) = KEYS.iter().find(|key| !file.has(key)).filter(|_| !file.is_keyless_array()) {
        return Err(missing(key));
    }
    if file.has("latent") {
        return Ok(vec!["latent".into()]);
    }
    let number = |name: &String| -> Option<(usize, String)> {
        let number = name.strip_prefix("latent")?.trim_start_matches(['_', '.', '[', ' ']).trim_end_matches(']');
        Some((number.parse().ok()?, name.clone()))
    };
    let mut numbered: Vec<(usize, String)> = file.names().iter().filter_map(number).collect();
    numbered.sort();
    let first = numbered.first().map_or(0, |n| n.0);
    if numbered.is_empty() || numbered.iter().enumerate().any(|(i, n)| n.0 != first + i) || first > 1 {
        return Err(missing("latent (or latent_0, latent_1 and so on)"));
    }
    Ok(numbered.into_iter().map(|(_, name)| name).collect())
}

/// Every column that somebody asks for, each once.
fn needed(asked: &Asked) -> Vec<String> {
    let of_rows = asked.rows.iter().flat_map(|rows| &rows.columns);
    let mut seen = HashSet::new();
    of_rows.chain(&asked.columns).filter(|name| seen.insert(name.as_str())).cloned().collect()
}

fn first_line(error: &PolarsError) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}

fn series(frame: &DataFrame, name: &str, path: &Path) -> Result<Series, InputError> {
    let found = frame.column(name).map_err(|error| column(path, name, first_line(&error), "a column"))?;
    Ok(found.as_materialized_series().clone())
}

/// The frame with its keys as unsigned whole numbers.
fn keyed(mut frame: DataFrame, keys: &[&str], path: &Path) -> Result<DataFrame, InputError> {
    for name in keys {
        let values = whole(&frame, name, path)?;
        if let Some(row) = values.iter().position(Option::is_none) {
            return Err(column(path, name, format!("nothing in row {row}"), WHOLE));
        }
        let fault = |error: PolarsError| column(path, name, first_line(&error), WHOLE);
        frame.with_column(Column::new((*name).into(), values)).map_err(fault)?;
    }
    Ok(frame)
}

/// A column of whole numbers of any type, floats among them if they have no fraction; none for what is missing.
fn whole(frame: &DataFrame, name: &str, path: &Path) -> Result<Vec<Option<u32>>, InputError> {
    let values = series(frame, name, path)?;
    if !(values.dtype().is_primitive_numeric() || values.dtype().is_null()) {
        return Err(column(path, name, format!("it holds {}", values.dtype()), WHOLE));
    }
    let fault = |error: PolarsError| column(path, name, first_line(&error), WHOLE);
    let wide = values.cast(&DataType::Float64).map_err(fault)?;
    let narrow = |value: Option<f64>| match value {
        None => Ok(None),
        Some(value) if value.is_nan() => Ok(None),
        Some(value) if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) => Ok(Some(value as u32)),
        Some(value) => Err(column(path, name, format!("it holds {value}"), WHOLE)),
    };
    wide.f64().map_err(fault)?.iter().map(narrow).collect()
}

fn known(values: Vec<Option<u32>>) -> Vec<u32> {
    values.into_iter().flatten().collect()
}

fn rewards(frame: &DataFrame, path: &Path) -> Result<Vec<Option<f32>>, InputError> {
    if frame.column("reward").is_err() {
        return Ok(vec![None; frame.height()]);
    }
    let rewards = series(frame, "reward", path)?;
    let expected = "a number in every row that has a reward";
    if !(rewards.dtype().is_primitive_numeric() || rewards.dtype().is_null()) {
        return Err(column(path, "reward", format!("it holds {}", rewards.dtype()), expected));
    }
    let fault = |error: PolarsError| column(path, "reward", first_line(&error), expected);
    let rewards = rewards.cast(&DataType::Float32).map_err(fault)?;
    let finite = |reward: Option<f32>| reward.filter(|reward| reward.is_finite());
    Ok(rewards.f32().map_err(fault)?.iter().map(finite).collect())
}

/// Every row key occurs once: two recordings poured into one table would otherwise give a wrong picture silently.
fn check_keys(frame: &DataFrame, path: &Path) -> Result<(), InputError> {
    let (episodes, steps) = (whole(frame, "episode", path)?, whole(frame, "step", path)?);
    let mut seen = HashSet::with_capacity(episodes.len());
    for key in known(episodes).into_iter().zip(known(steps)) {
        if !seen.insert(key) {
            let fact = format!("episode {}, step {} occurs twice", key.0, key.1);
            let expected = "one row for each (number the episodes of mixed recordings anew)";
            return Err(column(path, "episode and step", fact, expected));
        }
    }
    Ok(())
}

/// The rows of these keys.
fn of_keys(flat: &DataFrame, keys: RowKeys<'_>, path: &Path) -> Result<DataFrame, InputError> {
    let keys: HashSet<(u32, u32)> = keys.0.iter().copied().zip(keys.1.iter().copied()).collect();
    let (episodes, steps) = (known(whole(flat, "episode", path)?), known(whole(flat, "step", path)?));
    let is_wanted = |row: &u32| keys.contains(&(episodes[*row as usize], steps[*row as usize]));
    let wanted: Vec<u32> = (0..flat.height() as u32).filter(is_wanted).collect();
    let wanted = Column::new("number of the row".into(), wanted);
    let fault = |error: PolarsError| column(path, "episode and step", first_line(&error), WHOLE);
    flat.take(wanted.u32().map_err(fault)?).map_err(fault)
}

/// The columns of another table beside those of the rows that it speaks of.
fn join(flat: DataFrame, table: &Path, needed: &[String], remarks: &mut Vec<String>) -> Result<DataFrame, InputError> {
    let file = TableFile::open(table)?;
    let keys: Vec<&str> = KEYS.into_iter().filter(|key| file.has(key)).collect();
    if !file.has("episode") {
        let found = file.names().join(", ");
        return Err(InputError::NoJoin { found, path: table.into() });
    }
    let wanted: Vec<String> =
        needed.iter().filter(|name| flat.column(name).is_err() && file.has(name)).cloned().collect();
    if wanted.is_empty() {
        return Err(InputError::IdleJoin { found: file.names().join(", "), path: table.into() });
    }
    let all: Vec<String> = keys.iter().map(ToString::to_string).chain(wanted.iter().cloned()).collect();
    let mut other = keyed(file.read(&all)?, &keys, table)?;
    let fault = |error: PolarsError| column(table, &keys.join(" and "), first_line(&error), "one row for each");
    let found = "found in the joined table";
    other.with_column(Column::new(found.into(), vec![true; other.height()])).map_err(fault)?;
    let args = JoinArgs {
        validation: JoinValidation::ManyToOne,
        maintain_order: MaintainOrderJoin::Left,
        ..JoinArgs::new(JoinType::Left)
    };
    let mut joined = flat.join(&other, &keys, &keys, args, None).map_err(|error| {
        let twice = error.to_string().contains("m:1");
        let fact = if twice { "a row occurs twice".to_string() } else { first_line(&error) };
        column(table, &keys.join(" and "), fact, "one row for each")
    })?;
    let absent = joined.column(found).map_or(0, Column::null_count);
    if absent > 0 {
        remarks.push(format!("{absent} of {} rows have no row in {}", joined.height(), table.display()));
    }
    joined.drop_in_place(found).map_err(fault)?;
    Ok(joined)
}

fn choose(flat: DataFrame, rows: &Rows, path: &Path) -> Result<DataFrame, InputError> {
    let fault = |fact: String| InputError::Rows { fact, text: rows.text.clone(), path: path.into() };
    let index = "number of the row";
    let filter = || {
        // Differences of unsigned numbers would wrap round below 0.
        let unsigned = flat.columns().iter().filter(|column| column.dtype().is_unsigned_integer());
        let signed = unsigned
            .map(|column| polars::prelude::col(column.name().clone()).cast(DataType::Int64))
            .collect::<Vec<_>>();
        let mut numbered = flat.clone();
        numbered.with_column(Column::new(index.into(), (0..flat.height() as u32).collect::<Vec<u32>>()))?;
        let kept = numbered.lazy().with_columns(signed).filter(rows.expression.clone()).collect()?;
        flat.take(&kept.column(index)?.cast(&DataType::UInt32)?.u32()?.clone())
    };
    let kept = super::tables::quietly(filter).map_err(fault)?.map_err(|error| fault(first_line(&error)))?;
    if kept.height() == 0 { Err(fault("no row is chosen".into())) } else { Ok(kept) }
}
