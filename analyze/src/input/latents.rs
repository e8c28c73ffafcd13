//! Tables of latents from any model: Arrow (file or stream), Parquet, npy or npz with `episode`, `step` and `latent`.
//!
//! Needed columns: `episode` and `step`, integers; `latent`, a list of floats of one length. Used if present: `state` and `distractor`
//! (integers, the cell of a grid), `reward` (float). Anything else is ignored. Memory is that of the latents as float32 and of one batch.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use arrow::array::{Array, AsArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float32Type, Int64Type, Schema};
use vibes_data::{Latents, LatentsSource};

use super::{InputError, npy};

/// Reads a table of latents; the file's first bytes say its kind.
///
/// # Errors
/// [`InputError`]: an unreadable file, a missing or unsuitable column (the error names those that are needed), a row key that occurs twice.
/// Values that are not finite are left to the checks of [`vibes_measure::Table`].
pub fn read_latents(path: &Path) -> Result<Latents, InputError> {
    let mut magic = Vec::new();
    File::open(path).and_then(|f| f.take(6).read_to_end(&mut magic)).map_err(InputError::io(path))?;
    let latents = match magic.as_slice() {
        m if m.starts_with(b"PAR1") => parquet(path)?,
        m if m.starts_with(b"ARROW1") => arrow_file(path)?,
        m if m.starts_with(b"\x93NUMPY") || m.starts_with(b"PK\x03\x04") => npy::read(path)?,
        [] => return Err(not_a_table(path, "an empty file")),
        _ => arrow_stream(path)?,
    };
    check_keys(&latents, path)?;
    Ok(latents)
}

fn not_a_table(path: &Path, fact: impl Into<String>) -> InputError {
    InputError::NotATable { fact: fact.into(), path: path.into() }
}

fn arrow_file(path: &Path) -> Result<Latents, InputError> {
    let broken = |e: arrow::error::ArrowError| match e.to_string() {
        e if e.contains("decompression") => not_a_table(path, "a compressed Arrow file, write it uncompressed"),
        e => not_a_table(path, format!("a damaged or unsuitable Arrow file ({e})")),
    };
    let file = BufReader::new(File::open(path).map_err(InputError::io(path))?);
    let reader = arrow::ipc::reader::FileReader::try_new(file, None).map_err(broken)?;
    let schema = reader.schema();
    collect(path, &schema, reader.map(|batch| batch.map_err(broken)))
}

fn arrow_stream(path: &Path) -> Result<Latents, InputError> {
    let file = BufReader::new(File::open(path).map_err(InputError::io(path))?);
    let other = |_| not_a_table(path, "a file of another kind");
    let reader = arrow::ipc::reader::StreamReader::try_new(file, None).map_err(other)?;
    let schema = reader.schema();
    let broken = |e: arrow::error::ArrowError| not_a_table(path, format!("a damaged Arrow stream ({e})"));
    collect(path, &schema, reader.map(|batch| batch.map_err(broken)))
}

fn parquet(path: &Path) -> Result<Latents, InputError> {
    let broken = |e: String| not_a_table(path, format!("a damaged or unsuitable Parquet file ({e})"));
    let file = File::open(path).map_err(InputError::io(path))?;
    let builder = parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder::try_new(file)
        .map_err(|e| broken(e.to_string()))?;
    let schema = builder.schema().clone();
    let reader = builder.build().map_err(|e| broken(e.to_string()))?;
    collect(path, &schema, reader.map(|batch| batch.map_err(|e| broken(e.to_string()))))
}

fn collect(
    path: &Path,
    schema: &Schema,
    batches: impl Iterator<Item = Result<RecordBatch, InputError>>,
) -> Result<Latents, InputError> {
    let names: Vec<&str> = schema.fields().iter().map(|f| f.name().as_str()).collect();
    if let Some(missing) = ["episode", "step", "latent"].into_iter().find(|needed| !names.contains(needed)) {
        return Err(InputError::MissingColumn { missing: missing.into(), found: names.join(", "), path: path.into() });
    }
    let named = |key: &str| schema.metadata().get(key).cloned();
    let source = LatentsSource { recording: named("vibes.recording"), checkpoint: named("vibes.checkpoint") };
    let mut latents = Latents { source, ..Latents::default() };
    for batch in batches {
        append(&mut latents, &batch?, path)?;
    }
    Ok(latents)
}

fn append(latents: &mut Latents, batch: &RecordBatch, path: &Path) -> Result<(), InputError> {
    for (name, into) in [("episode", &mut latents.episode), ("step", &mut latents.step)] {
        for (row, value) in integers(batch, name, path)?.into_iter().enumerate() {
            let expected = "an integer from 0 to 4294967295 in every row";
            into.push(value.ok_or_else(|| column(path, name, format!("nothing in row {row}"), expected))?);
        }
    }
    for (name, into) in [("state", &mut latents.state), ("distractor", &mut latents.distractor)] {
        match batch.column_by_name(name) {
            Some(_) => into.extend(integers(batch, name, path)?),
            None => into.resize(into.len() + batch.num_rows(), None),
        }
    }
    match batch.column_by_name("reward") {
        Some(values) => {
            latents.reward.extend(floats(values.as_ref(), "reward", path)?.as_primitive::<Float32Type>().iter());
        }
        None => latents.reward.resize(latents.reward.len() + batch.num_rows(), None),
    }
    append_latent(latents, batch, path)
}

fn column(path: &Path, name: &str, fact: impl Into<String>, expected: &str) -> InputError {
    InputError::Column { column: name.into(), fact: fact.into(), expected: expected.into(), path: path.into() }
}

/// A column of integers of any width; none for null.
fn integers(batch: &RecordBatch, name: &str, path: &Path) -> Result<Vec<Option<u32>>, InputError> {
    let expected = "an integer from 0 to 4294967295 in every row";
    let values = batch.column_by_name(name).ok_or_else(|| column(path, name, "missing", expected))?;
    if !values.data_type().is_integer() && !values.data_type().is_null() {
        return Err(column(path, name, format!("it holds {}", values.data_type()), expected));
    }
    let wide = cast(values, &DataType::Int64).map_err(|e| column(path, name, e.to_string(), expected))?;
    let narrow = |value: Option<i64>| {
        let too_far = |v: i64| column(path, name, format!("it holds {v}"), expected);
        value.map(|v| u32::try_from(v).map_err(|_e| too_far(v))).transpose()
    };
    wide.as_primitive::<Int64Type>().iter().map(narrow).collect()
}

fn floats(values: &dyn Array, name: &str, path: &Path) -> Result<std::sync::Arc<dyn Array>, InputError> {
    let expected = "floating point numbers";
    if !values.data_type().is_numeric() && !values.data_type().is_null() {
        return Err(column(path, name, format!("it holds {}", values.data_type()), expected));
    }
    cast(values, &DataType::Float32).map_err(|e| column(path, name, e.to_string(), expected))
}

fn append_latent(latents: &mut Latents, batch: &RecordBatch, path: &Path) -> Result<(), InputError> {
    let expected = "a list of floats of one length in every row";
    let lists = batch.column_by_name("latent").ok_or_else(|| column(path, "latent", "missing", expected))?;
    if lists.null_count() > 0 {
        return Err(column(path, "latent", format!("nothing in {} rows", lists.null_count()), expected));
    }
    let (values, lengths): (_, Vec<usize>) = match lists.data_type() {
        DataType::FixedSizeList(_, dims) => {
            let list = lists.as_fixed_size_list();
            let dims = usize::try_from(*dims).unwrap_or(0);
            (list.values().slice(list.value_offset(0) as usize, list.len() * dims), vec![dims; list.len()])
        }
        DataType::List(_) => {
            let list = lists.as_list::<i32>();
            let (from, to) = (list.value_offsets()[0] as usize, list.value_offsets()[list.len()] as usize);
            (list.values().slice(from, to - from), (0..list.len()).map(|i| list.value_length(i) as usize).collect())
        }
        DataType::LargeList(_) => {
            let list = lists.as_list::<i64>();
            let (from, to) = (list.value_offsets()[0] as usize, list.value_offsets()[list.len()] as usize);
            (list.values().slice(from, to - from), (0..list.len()).map(|i| list.value_length(i) as usize).collect())
        }
        other => return Err(column(path, "latent", format!("it holds {other}"), expected)),
    };
    let first = if latents.episode.len() > lengths.len() {
        latents.dims
    } else {
        lengths.first().copied().unwrap_or(latents.dims)
    };
    if let Some(other) = lengths.iter().find(|&&length| length != first) {
        return Err(column(path, "latent", format!("lists of {first} and of {other} numbers"), expected));
    }
    let values = floats(values.as_ref(), "latent", path)?;
    if values.null_count() > 0 {
        return Err(column(path, "latent", format!("{} missing numbers inside lists", values.null_count()), expected));
    }
    latents.dims = first;
    latents.latent.extend(values.as_primitive::<Float32Type>().values());
    Ok(())
}

/// Every row key occurs once: two recordings poured into one table would otherwise give a wrong picture silently.
fn check_keys(latents: &Latents, path: &Path) -> Result<(), InputError> {
    let mut seen = HashSet::with_capacity(latents.len());
    for (&episode, &step) in latents.episode.iter().zip(&latents.step) {
        if !seen.insert((episode, step)) {
            let fact = format!("episode {episode}, step {step} occurs twice");
            return Err(column(
                path,
                "episode and step",
                fact,
                "one row for each (number the episodes of mixed recordings anew)",
            ));
        }
    }
    Ok(())
}
