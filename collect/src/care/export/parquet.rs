//! A recording's own columns in Parquet, one file an episode, and its manifest beside them as `recording.json`. Pictures become PNG, or stay as they
//! are; everything else keeps its type, so that nothing is lost but the MCAP logs. All files have one schema.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use ::parquet::arrow::ArrowWriter;
use ::parquet::basic::{Compression, ZstdLevel};
use ::parquet::file::properties::WriterProperties;
use ::parquet::schema::types::ColumnPath;
use arrow::array::{Array, ArrayRef, AsArray, BinaryBuilder, RecordBatch, new_null_array};
use arrow::datatypes::{DataType, FieldRef, Schema};
use vibes_data::{ImageSize, Recording, Spec, episode_schema, episode_table};

use super::columns::{arrow_error, parquet_error};
use super::pictures::png;
use super::{Pictures, go_on, make_parent, write_json};
use crate::error::Result;
use crate::sound::check_intact;

/// Writes `episodes/000012.parquet` and so on; returns the numbers of episodes and rows.
pub(super) fn write(recording: &Recording, pictures: Pictures, out: &Path, stop: &AtomicBool) -> Result<(usize, u64)> {
    let spec = &recording.manifest().spec;
    let mut rows = 0;
    for entry in recording.episodes() {
        go_on(stop)?;
        check_intact(recording, entry)?;
        let source = recording.path().join(&entry.arrow.path);
        let mut table = with_all_columns(episode_table(&source, spec)?, spec, &source)?;
        if let (Pictures::Png, Some(size)) = (pictures, spec.pixels) {
            table = with_png(&table, spec, size, &source)?;
        }
        rows += table.num_rows() as u64;
        write_table(&out.join(format!("episodes/{:06}.parquet", entry.index)), &table)?;
    }
    write_json(&out.join("recording.json"), &serde_json::to_value(recording.manifest()).unwrap_or_default())?;
    Ok((recording.episodes().len(), rows))
}

/// The table with a column of nulls for every one that a recording of an earlier version lacks, so that all files have one schema.
fn with_all_columns(table: RecordBatch, spec: &Spec, source: &Path) -> Result<RecordBatch> {
    let all = episode_schema(spec);
    if table.num_columns() == all.fields().len() {
        return Ok(table);
    }
    let column = |field: &FieldRef| {
        let found = table.column_by_name(field.name()).cloned();
        found.unwrap_or_else(|| new_null_array(field.data_type(), table.num_rows()))
    };
    let columns = all.fields().iter().map(column).collect();
    let schema = all.with_metadata(table.schema().metadata().clone());
    RecordBatch::try_new(Arc::new(schema), columns).map_err(arrow_error(source))
}

/// One table in a file of its own.
fn write_table(path: &Path, table: &RecordBatch) -> Result<()> {
    make_parent(path)?;
    let file = File::create(path).map_err(crate::Error::io("create", path))?;
    let mut writer = ArrowWriter::try_new(file, table.schema(), Some(properties()?)).map_err(parquet_error(path))?;
    writer.write(table).map_err(parquet_error(path))?;
    writer.close().map_err(parquet_error(path))?;
    Ok(())
}

/// Zstandard everywhere; pictures hardly ever repeat, so that a dictionary of them would only cost memory.
pub(super) fn properties() -> Result<WriterProperties> {
    let level = ZstdLevel::try_new(3).map_err(parquet_error(Path::new("")))?;
    Ok(WriterProperties::builder()
        .set_compression(Compression::ZSTD(level))
        .set_column_dictionary_enabled(ColumnPath::from("pixels"), false)
        .build())
}

fn with_png(table: &RecordBatch, spec: &Spec, size: ImageSize, source: &Path) -> Result<RecordBatch> {
    let Ok(place) = table.schema().index_of("pixels") else { return Ok(table.clone()) };
    let pixels = table.column(place).as_fixed_size_binary();
    let mut pictures = BinaryBuilder::with_capacity(pixels.len(), pixels.len() * spec.pixels_len() / 2);
    for row in 0..pixels.len() {
        if pixels.is_valid(row) {
            pictures.append_value(png(pixels.value(row), size)?);
        } else {
            pictures.append_null();
        }
    }
    let mut columns: Vec<ArrayRef> = table.columns().to_vec();
    columns[place] = Arc::new(pictures.finish());
    let mut fields: Vec<_> = table.schema().fields().iter().cloned().collect();
    let field = fields[place].as_ref().clone().with_data_type(DataType::Binary);
    let metadata = field.metadata().iter().map(|(key, value)| (key.clone(), value.clone()));
    let metadata = metadata.chain([("encoding".to_owned(), "png".to_owned())]).collect();
    fields[place] = Arc::new(field.clone().with_metadata(metadata));
    let schema = Schema::new(fields).with_metadata(table.schema().metadata().clone());
    RecordBatch::try_new(Arc::new(schema), columns).map_err(arrow_error(source))
}
