//! Arrow tables of plain columns, written whole or not at all.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array};
use arrow::datatypes::{Field, Schema};
use arrow::error::ArrowError;
use arrow::ipc::writer::FileWriter;

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
