//! Tables of plain columns as Arrow, CSV and Parquet, written whole or not at all.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array};
use arrow::datatypes::{Field, Schema};
use arrow::error::ArrowError;
use arrow::ipc::writer::FileWriter;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use polars::prelude::DataFrame;
use polars_io::SerWriter;
use polars_io::csv::write::CsvWriter;

/// A column's values.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Whole numbers.
    UInt32(Vec<u32>),
    /// Single precision.
    Float32(Vec<f32>),
    /// Double precision; NaN stands for no value.
    Float64(Vec<f64>),
    /// Text.
    Text(Vec<String>),
}

impl Column {
    fn array(&self) -> ArrayRef {
        match self {
            Self::UInt32(values) => Arc::new(UInt32Array::from(values.clone())),
            Self::Float32(values) => Arc::new(Float32Array::from(values.clone())),
            Self::Float64(values) => Arc::new(Float64Array::from(values.clone())),
            Self::Text(values) => Arc::new(StringArray::from(values.clone())),
        }
    }
}

/// Writes columns of one length as an Arrow IPC file.
///
/// # Errors
/// [`vibes_data::Error`]: the file cannot be written, or the columns differ in length.
pub fn write_table(
    path: &Path,
    columns: &[(&str, Column)],
    metadata: &[(&str, String)],
) -> Result<(), vibes_data::Error> {
    let bytes = encode(columns, metadata).map_err(|error| uneven(path, &error))?;
    vibes_data::write_atomically(path, &bytes)
}

fn encode(columns: &[(&str, Column)], metadata: &[(&str, String)]) -> Result<Vec<u8>, ArrowError> {
    let arrays: Vec<ArrayRef> = columns.iter().map(|(_, column)| column.array()).collect();
    let fields: Vec<Field> = columns
        .iter()
        .zip(&arrays)
        .map(|((name, _), array)| Field::new(*name, array.data_type().clone(), false))
        .collect();
    let metadata: HashMap<String, String> = metadata.iter().map(|(k, v)| ((*k).to_string(), v.clone())).collect();
    let schema = Arc::new(Schema::new(fields).with_metadata(metadata));
    let mut writer = FileWriter::try_new(Vec::new(), &schema)?;
    writer.write(&RecordBatch::try_new(schema, arrays)?)?;
    writer.into_inner()
}

/// Writes columns of one length as CSV with a header; NaN becomes an empty cell.
///
/// # Errors
/// [`vibes_data::Error`]: the file cannot be written, or the columns differ in length.
pub fn write_csv(path: &Path, columns: &[(&str, Column)]) -> Result<(), vibes_data::Error> {
    let column = |(name, column): &(&str, Column)| match column {
        Column::UInt32(values) => polars::prelude::Column::new((*name).into(), values),
        Column::Float32(values) => polars::prelude::Column::new((*name).into(), values),
        Column::Float64(values) => polars::prelude::Column::new((*name).into(), known(values)),
        Column::Text(values) => polars::prelude::Column::new((*name).into(), values),
    };
    let mut bytes = Vec::new();
    let frame = DataFrame::new_infer_height(columns.iter().map(column).collect());
    frame.and_then(|mut frame| CsvWriter::new(&mut bytes).finish(&mut frame)).map_err(|error| uneven(path, &error))?;
    vibes_data::write_atomically(path, &bytes)
}

/// Writes columns of one length as Parquet; NaN becomes null.
///
/// # Errors
/// As [`write_csv`].
pub fn write_parquet(path: &Path, columns: &[(&str, Column)]) -> Result<(), vibes_data::Error> {
    let array = |(name, column): &(&str, Column)| match column {
        Column::Float64(values) => ((*name).to_string(), Arc::new(Float64Array::from(known(values))) as ArrayRef),
        others => ((*name).to_string(), others.array()),
    };
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build();
    let write = || {
        let table = RecordBatch::try_from_iter(columns.iter().map(array))?;
        let mut writer = ArrowWriter::try_new(Vec::new(), table.schema(), Some(properties))?;
        writer.write(&table)?;
        writer.into_inner()
    };
    let bytes = write().map_err(|error: ParquetError| uneven(path, &error))?;
    vibes_data::write_atomically(path, &bytes)
}

/// Numbers, none where they are NaN.
fn known(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|v| Some(*v).filter(|v| !v.is_nan())).collect()
}

fn uneven(path: &Path, error: &impl ToString) -> vibes_data::Error {
    let expected = "columns of one length".into();
    vibes_data::Error::Malformed { fact: error.to_string(), expected, path: path.into() }
}
