//! The tables of `meta/`: which file and which seconds an episode's frames are in, its statistics, and the list of tasks.

use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use ::parquet::arrow::ArrowWriter;
use arrow::array::{ArrayRef, Float64Array, Int64Array, ListArray, RecordBatch, StringArray};
use arrow::buffer::OffsetBuffer;
use arrow::datatypes::{Field, Schema};
use arrow::error::ArrowError;
use serde_json::json;

use super::super::columns::{arrow_error, field, parquet_error};
use super::super::make_parent;
use super::super::parquet::properties;
use super::super::statistics::Statistics;
use super::features::CAMERA;
use super::{FILES_A_CHUNK, VideoPlace};
use crate::error::{Error, Result};

/// A file of a kind, by folder and number.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    chunk: u32,
    file: u32,
}

impl Place {
    /// `chunk-000/file-000.parquet`.
    pub(super) fn file(self, ending: &str) -> String {
        format!("chunk-{:03}/file-{:03}.{ending}", self.chunk, self.file)
    }

    pub(super) fn next(self) -> Self {
        if self.file + 1 == FILES_A_CHUNK {
            Self { chunk: self.chunk + 1, file: 0 }
        } else {
            Self { file: self.file + 1, ..self }
        }
    }
}

/// What is known of an episode.
pub(super) struct EpisodeRow {
    pub(super) index: i64,
    /// Its first frame in the dataset.
    pub(super) from: i64,
    pub(super) frames: i64,
    pub(super) data: Place,
    pub(super) video: Option<VideoPlace>,
    pub(super) statistics: Vec<(String, Statistics)>,
}

/// Writes the table of episodes.
pub(super) fn write_episodes(path: &Path, task: &str, rows: &[EpisodeRow]) -> Result<()> {
    let table = episodes(task, rows).map_err(arrow_error(path))?;
    write(path, &table)
}

/// Writes the table of tasks as pandas does, the task's name being its index.
pub(super) fn write_tasks(path: &Path, task: &str) -> Result<()> {
    let columns: [(&str, ArrayRef); 2] = [
        ("task_index", Arc::new(Int64Array::from(vec![0]))),
        ("__index_level_0__", Arc::new(StringArray::from(vec![task]))),
    ];
    let column = |name: Option<&str>, field: &str, of: &str, numpy: &str| json!({ "name": name, "field_name": field, "pandas_type": of, "numpy_type": numpy, "metadata": null });
    let pandas = json!({
        "index_columns": ["__index_level_0__"],
        "column_indexes": [{ "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object", "metadata": { "encoding": "UTF-8" } }],
        "columns": [column(Some("task_index"), "task_index", "int64", "int64"), column(None, "__index_level_0__", "unicode", "object")],
        "creator": { "library": "vibes-collect", "version": env!("CARGO_PKG_VERSION") },
        "pandas_version": "2.0.0",
    });
    let table = record(columns.into_iter().map(|(name, column)| (name.to_owned(), column)).collect())
        .map_err(arrow_error(path))?;
    let schema =
        table.schema().as_ref().clone().with_metadata(HashMap::from([("pandas".to_owned(), pandas.to_string())]));
    let table = table.with_schema(Arc::new(schema)).map_err(arrow_error(path))?;
    write(path, &table)
}

fn write(path: &Path, table: &RecordBatch) -> Result<()> {
    make_parent(path)?;
    let file = File::create(path).map_err(Error::io("create", path))?;
    let mut writer = ArrowWriter::try_new(file, table.schema(), Some(properties()?)).map_err(parquet_error(path))?;
    writer.write(table).map_err(parquet_error(path))?;
    writer.close().map(drop).map_err(parquet_error(path))
}

fn record(columns: Vec<(String, ArrayRef)>) -> std::result::Result<RecordBatch, ArrowError> {
    let schema = Schema::new(columns.iter().map(|(name, column)| field(name, column)).collect::<Vec<_>>());
    RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, column)| column).collect())
}

fn episodes(task: &str, rows: &[EpisodeRow]) -> std::result::Result<RecordBatch, ArrowError> {
    let whole = |pick: &dyn Fn(&EpisodeRow) -> i64| -> ArrayRef {
        Arc::new(Int64Array::from_iter_values(rows.iter().map(pick)))
    };
    let tasks: ArrayRef = Arc::new(StringArray::from(vec![task; rows.len()]));
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("episode_index".into(), whole(&|row| row.index)),
        ("tasks".into(), lists(tasks, 1)?),
        ("length".into(), whole(&|row| row.frames)),
        ("data/chunk_index".into(), whole(&|row| i64::from(row.data.chunk))),
        ("data/file_index".into(), whole(&|row| i64::from(row.data.file))),
        ("dataset_from_index".into(), whole(&|row| row.from)),
        ("dataset_to_index".into(), whole(&|row| row.from + row.frames)),
        ("meta/episodes/chunk_index".into(), whole(&|_| 0)),
        ("meta/episodes/file_index".into(), whole(&|_| 0)),
    ];
    let videos: Vec<VideoPlace> = rows.iter().filter_map(|row| row.video).collect();
    if videos.len() == rows.len() {
        let place = |pick: &dyn Fn(Place) -> u32| -> ArrayRef {
            Arc::new(Int64Array::from_iter_values(videos.iter().map(|video| i64::from(pick(video.place)))))
        };
        let time = |pick: fn(&VideoPlace) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(videos.iter().map(pick)))
        };
        columns.extend([
            (format!("videos/{CAMERA}/chunk_index"), place(&|place| place.chunk)),
            (format!("videos/{CAMERA}/file_index"), place(&|place| place.file)),
            (format!("videos/{CAMERA}/from_timestamp"), time(|video| video.from)),
            (format!("videos/{CAMERA}/to_timestamp"), time(|video| video.to)),
        ]);
    }
    columns.extend(statistics(rows)?);
    record(columns)
}

/// `stats/FEATURE/STATISTIC`, a list a row; of pictures `[3, 1, 1]`.
fn statistics(rows: &[EpisodeRow]) -> std::result::Result<Vec<(String, ArrayRef)>, ArrowError> {
    let mut columns = Vec::new();
    for (place, (feature, first)) in rows.first().map_or(&[][..], |row| &row.statistics).iter().enumerate() {
        let of = |row: &EpisodeRow| -> Statistics { row.statistics[place].1.clone() };
        for (number, (name, values)) in first.named().enumerate() {
            let dims = values.len();
            let all = rows
                .iter()
                .flat_map(|row| of(row).named().nth(number).map_or(Vec::new(), |(_, values)| values.to_vec()));
            let values: ArrayRef = Arc::new(Float64Array::from_iter_values(all));
            let column =
                if feature == CAMERA { lists(lists(lists(values, 1)?, 1)?, dims)? } else { lists(values, dims)? };
            columns.push((format!("stats/{feature}/{name}"), column));
        }
        let counts: ArrayRef = Arc::new(Int64Array::from_iter_values(rows.iter().map(|row| of(row).count as i64)));
        columns.push((format!("stats/{feature}/count"), lists(counts, 1)?));
    }
    Ok(columns)
}

/// Lists of variable size, though all have `len` values: what LeRobot's own files have.
fn lists(values: ArrayRef, len: usize) -> std::result::Result<ArrayRef, ArrowError> {
    let count = values.len() / len.max(1);
    let item = Arc::new(Field::new("item", values.data_type().clone(), true));
    Ok(Arc::new(ListArray::try_new(item, OffsetBuffer::from_lengths(std::iter::repeat_n(len, count)), values, None)?))
}
