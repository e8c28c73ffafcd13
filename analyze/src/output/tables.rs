//! Tables of plain columns as Arrow, CSV and Parquet, written whole or not at all.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array};
use arrow::datatypes::{Field, Schema};
use arrow::error::ArrowError;
use arrow::ipc::writer::FileWriter;
use polars::prelude::{DataFrame, PolarsError};
use polars_io::SerWriter;

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
    let bytes = encode(columns, metadata).map_err(|error| vibes_data::Error::Malformed {
        fact: error.to_string(),
        expected: "columns of one length".into(),
        path: path.into(),
    })?;
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
    let write =
        |mut frame: DataFrame, bytes: &mut Vec<u8>| polars_io::csv::write::CsvWriter::new(bytes).finish(&mut frame);
    write_frame(path, columns, write)
}

/// Writes columns of one length as Parquet; NaN becomes null.
///
/// # Errors
/// As [`write_csv`].
pub fn write_parquet(path: &Path, columns: &[(&str, Column)]) -> Result<(), vibes_data::Error> {
    let write = |mut frame: DataFrame, bytes: &mut Vec<u8>| {
        polars_io::parquet::write::ParquetWriter::new(bytes).finish(&mut frame).map(|_| ())
    };
    write_frame(path, columns, write)
}

fn write_frame(
    path: &Path,
    columns: &[(&str, Column)],
    write: impl FnOnce(DataFrame, &mut Vec<u8>) -> Result<(), PolarsError>,
) -> Result<(), vibes_data::Error> {
    let column = |(name, column): &(&str, Column)| match column {
        Column::UInt32(values) => polars::prelude::Column::new((*name).into(), values),
        Column::Float32(values) => polars::prelude::Column::new((*name).into(), values),
        Column::Float64(values) => {
            let known: Vec<Option<f64>> = values.iter().map(|v| Some(*v).filter(|v| !v.is_nan())).collect();
            polars::prelude::Column::new((*name).into(), known)
        }
        Column::Text(values) => polars::prelude::Column::new((*name).into(), values),
    };
    let mut bytes = Vec::new();
    let frame = DataFrame::new_infer_height(columns.iter().map(column).collect());
    frame.and_then(|frame| write(frame, &mut bytes)).map_err(|error| vibes_data::Error::Malformed {
        fact: error.to_string(),
        expected: "columns of one length".into(),
        path: path.into(),
    })?;
    vibes_data::write_atomically(path, &bytes)
}
