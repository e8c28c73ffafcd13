//! Parquet files, with any of the compressions that pandas, polars, `DuckDB` and Spark write.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use polars::prelude::{ArrowDataType, Series};
use polars_arrow::array::Array;
use polars_arrow::datatypes::Field;
use polars_buffer::Buffer;
use polars_parquet::read::{
    BasicDecompressor, ColumnChunkMetadata, PageReader, column_iter_to_arrays, infer_schema, read_metadata,
};

use super::plain::series;
use super::{InputError, damaged, not_a_table};

pub(super) fn schema(path: &Path) -> Result<(Vec<String>, BTreeMap<String, String>), InputError> {
    let metadata = read_metadata(&mut open(path)?).map_err(|error| damaged(path, &error))?;
    let schema = infer_schema(&metadata).map_err(|error| damaged(path, &error))?;
    let texts = metadata.key_value_metadata.iter().flatten();
    let texts = texts.filter_map(|pair| Some((pair.key.to_string(), pair.value.as_ref()?.to_string())));
    Ok((schema.iter_names().map(|name| name.to_string()).collect(), texts.collect()))
}

fn open(path: &Path) -> Result<BufReader<File>, InputError> {
    File::open(path).map(BufReader::new).map_err(InputError::io(path))
}

pub(super) fn read(path: &Path, names: &[String]) -> Result<Vec<Series>, InputError> {
    let mut file = open(path)?;
    let metadata = read_metadata(&mut file).map_err(|error| damaged(path, &error))?;
    let schema = infer_schema(&metadata).map_err(|error| damaged(path, &error))?;
    let column = |name: &String| {
        let Some(field) = schema.get(name.as_str()) else { return Err(not_a_table(path, format!("no column {name}"))) };
        let field = without_dictionary(field.clone());
        let mut chunks: Vec<Box<dyn Array>> = Vec::new();
        for group in &metadata.row_groups {
            let parts = group.columns_under_root_iter(name).into_iter().flatten();
            let parts =
                parts.map(|part| Ok((part, bytes(&mut file, part, path)?))).collect::<Result<Vec<_>, InputError>>()?;
            chunks.extend(arrays(parts, field.clone()).map_err(|error| damaged(path, &error))?);
        }
        series(path, name, chunks)
    };
    names.iter().map(column).collect()
}

/// A dictionary is a way to store values; what is asked for are the values.
fn without_dictionary(mut field: Field) -> Field {
    if let ArrowDataType::Dictionary(_, values, _) = field.dtype {
        field.dtype = *values;
    }
    field
}

/// The bytes of one column of one row group.
fn bytes(file: &mut (impl Read + Seek), part: &ColumnChunkMetadata, path: &Path) -> Result<Buffer<u8>, InputError> {
    let range = part.byte_range();
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(range.start)).map_err(InputError::io(path))?;
    let length = range.end.saturating_sub(range.start);
    file.by_ref().take(length).read_to_end(&mut bytes).map_err(InputError::io(path))?;
    if bytes.len() as u64 != length {
        return Err(not_a_table(path, "a truncated Parquet file"));
    }
    Ok(Buffer::from_vec(bytes))
}

fn arrays(
    parts: Vec<(&ColumnChunkMetadata, Buffer<u8>)>,
    field: Field,
) -> Result<Vec<Box<dyn Array>>, polars::prelude::PolarsError> {
    let pages = parts.into_iter().map(|(part, bytes)| {
        let pages = PageReader::new(Cursor::new(bytes), part, vec![], usize::MAX);
        (BasicDecompressor::new(pages, vec![]), &part.descriptor().descriptor.primitive_type)
    });
    let (pages, types): (Vec<_>, Vec<_>) = pages.unzip();
    Ok(column_iter_to_arrays(pages, types, field, None)?.0)
}
