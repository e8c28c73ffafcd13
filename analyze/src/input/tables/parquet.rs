//! Parquet files, with any of the compressions that pandas, polars, `DuckDB` and Spark write.
//!
//! In: a path and the names of columns. Out: those columns, one after the other, so that memory holds one of them twice at most. The `parquet` crate
//! reads in small batches; what a file says about lengths is held beside the file first ([`footer`], [`pages`]), since room for more than there is
//! ends the process. The batches go on to polars as an Arrow stream in memory.

mod footer;
mod pages;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use ::arrow::array::RecordBatch;
use ::arrow::datatypes::{Schema, SchemaRef};
use ::arrow::error::ArrowError;
use ::arrow::ipc::writer::StreamWriter;
use ::parquet::arrow::ProjectionMask;
use ::parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use ::parquet::errors::ParquetError;
use polars::prelude::Series;
use polars_arrow::array::Array;

use super::plain::series;
use super::{InputError, arrow, damaged, not_a_table};

/// Rows that are decoded at a time.
const BATCH: usize = 8192;

pub(super) fn schema(path: &Path) -> Result<(Vec<String>, BTreeMap<String, String>), InputError> {
    let (_, metadata) = open(path)?;
    let names = metadata.schema().fields().iter().map(|field| field.name().clone());
    let texts = metadata.metadata().file_metadata().key_value_metadata().into_iter().flatten();
    let texts = texts.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?)));
    Ok((names.collect(), texts.collect()))
}

pub(super) fn read(path: &Path, names: &[String]) -> Result<Vec<Series>, InputError> {
    let (file, metadata) = open(path)?;
    names.iter().map(|name| column(path, &file, &metadata, name)).collect()
}

/// The file and what it holds, as Parquet itself has types: a dictionary of Arrow's is a way to store values, and what is asked for are the values.
fn open(path: &Path) -> Result<(File, ArrowReaderMetadata), InputError> {
    let mut file = File::open(path).map_err(InputError::io(path))?;
    footer::check(&mut file).ok_or_else(|| not_a_table(path, "a truncated or damaged Parquet file"))?;
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let metadata = ArrowReaderMetadata::load(&file, options).map_err(|error| damaged(path, &error))?;
    Ok((file, metadata))
}

fn column(path: &Path, file: &File, metadata: &ArrowReaderMetadata, name: &str) -> Result<Series, InputError> {
    let fault = |error| damaged(path, &error);
    let Some((place, field)) = metadata.schema().fields().find(name) else {
        return Err(not_a_table(path, format!("no column {name}")));
    };
    let schema = SchemaRef::new(Schema::new(vec![field.clone()]));
    // A type without use is refused before a value of it is read.
    let empty = RecordBatch::new_empty(SchemaRef::clone(&schema));
    let _ = series(path, name, arrays(path, &schema, [Ok(empty)])?)?;
    let again = || file.try_clone().map_err(InputError::io(path));
    pages::check(&again()?.into(), metadata.metadata(), place).map_err(fault)?;
    let one = ProjectionMask::roots(metadata.parquet_schema(), [place]);
    let batches = ParquetRecordBatchReaderBuilder::new_with_metadata(again()?, metadata.clone());
    let batches = batches.with_projection(one).with_batch_size(BATCH).build().map_err(fault)?;
    series(path, name, arrays(path, &schema, batches)?)
}

/// The only column of some batches as polars has arrays.
fn arrays(
    path: &Path,
    schema: &Schema,
    batches: impl IntoIterator<Item = Result<RecordBatch, ArrowError>>,
) -> Result<Vec<Box<dyn Array>>, InputError> {
    let written = || -> Result<_, ArrowError> {
        let mut writer = StreamWriter::try_new(Vec::new(), schema)?;
        batches.into_iter().try_for_each(|batch| writer.write(&batch?))?;
        writer.into_inner()
    };
    let bytes = written().map_err(|error| damaged(path, &ParquetError::from(error)))?;
    arrow::only_column(path, &bytes)
}
