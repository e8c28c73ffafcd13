//! The table of latents that `vibes-train encode` writes and `vibes-analyze` reads: one row per row of the recording.
//!
//! Columns: `episode`, `step` (uint32), `state`, `distractor` (uint32, nullable), `reward` (float32, nullable), `latent`
//! (`fixed_size_list<float32>`, the posterior mean). Schema metadata names the recording and the checkpoint.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, FixedSizeListArray, Float32Array, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Float32Type, Schema, UInt32Type};
use arrow::ipc::writer::FileWriter;

use crate::atomic::partial_path;
use crate::map::MappedTable;
use crate::{Error, Result};

const RECORDING: &str = "vibes.recording";
const CHECKPOINT: &str = "vibes.checkpoint";

/// A table of latents, or a chunk of one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latents {
    /// `[rows]`, the episode's number in the recording.
    pub episode: Vec<u32>,
    /// `[rows]`, the row within the episode.
    pub step: Vec<u32>,
    /// `[rows]`, the grid's row, if there is a grid.
    pub state: Vec<Option<u32>>,
    /// `[rows]`, the grid's column.
    pub distractor: Vec<Option<u32>>,
    /// `[rows]`, none at an episode's last row.
    pub reward: Vec<Option<f32>>,
    /// Dimensions of a latent.
    pub dims: usize,
    /// `[rows, dims]`.
    pub latent: Vec<f32>,
    /// Where the latents come from.
    pub source: LatentsSource,
}

/// Where latents come from: [places](crate::relative_place) relative to the table's folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LatentsSource {
    /// The recording whose rows were encoded.
    pub recording: Option<String>,
    /// The checkpoint that encoded them.
    pub checkpoint: Option<String>,
}

impl Latents {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.episode.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.episode.is_empty()
    }

    /// One latent, `[dims]`.
    pub fn row(&self, row: usize) -> &[f32] {
        &self.latent[row * self.dims..(row + 1) * self.dims]
    }

    /// Reads a table that [`LatentsWriter`] wrote.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a damaged file or other columns; it names those that are needed.
    pub fn read(path: &Path) -> Result<Self> {
        let table = MappedTable::open(path)?;
        let schema = table.schema();
        let dims = latent_dims(&schema).ok_or_else(|| other_columns(path, &schema))?;
        if schema.fields() != latents_schema(dims, &LatentsSource::default()).fields() {
            return Err(other_columns(path, &schema));
        }
        let named = |key: &str| schema.metadata().get(key).cloned();
        let source = LatentsSource { recording: named(RECORDING), checkpoint: named(CHECKPOINT) };
        let mut latents = Self { dims, source, ..Self::default() };
        for index in 0..table.batches() {
            latents.append(&table.batch(index)?);
        }
        Ok(latents)
    }

    /// Writes the table whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut writer = LatentsWriter::create(path, self.dims, &self.source)?;
        writer.append(self)?;
        writer.finish()
    }

    fn append(&mut self, batch: &RecordBatch) {
        let uint = |name: &str| batch[name].as_primitive::<UInt32Type>().clone();
        self.episode.extend(uint("episode").values());
        self.step.extend(uint("step").values());
        self.state.extend(uint("state").iter());
        self.distractor.extend(uint("distractor").iter());
        self.reward.extend(batch["reward"].as_primitive::<Float32Type>().iter());
        let latent = batch["latent"].as_fixed_size_list();
        self.latent.extend(latent.values().as_primitive::<Float32Type>().values());
    }
}

/// Writes a table of latents chunk by chunk, so that memory follows the chunk; it appears when it is finished.
pub struct LatentsWriter {
    path: PathBuf,
    writer: FileWriter<BufWriter<File>>,
    dims: usize,
    partial: Partial,
}

/// The file that is being written; unless it is finished, it goes with its writer.
struct Partial {
    path: PathBuf,
    finished: bool,
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.finished {
            // What went wrong before is the error to report.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl std::fmt::Debug for LatentsWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LatentsWriter").field("path", &self.path).field("dims", &self.dims).finish_non_exhaustive()
    }
}

impl LatentsWriter {
    /// Begins a table beside its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(path: &Path, dims: usize, source: &LatentsSource) -> Result<Self> {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
        }
        let file = File::create(partial_path(path)).map_err(Error::io("create", path))?;
        let partial = Partial { path: partial_path(path), finished: false };
        let writer = FileWriter::try_new(BufWriter::new(file), &latents_schema(dims, source));
        let writer = writer.map_err(|error| Error::malformed(path, error.to_string(), "a disk with room"))?;
        Ok(Self { path: path.into(), writer, dims, partial })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// [`Error::Malformed`] when the chunk's columns differ in length or its latents in size; an I/O fault.
    pub fn append(&mut self, chunk: &Latents) -> Result<()> {
        let fault = |error: arrow::error::ArrowError| {
            Error::malformed(&self.path, error.to_string(), "columns of one length and a disk with room")
        };
        if chunk.dims != self.dims {
            let fact = format!("latents of {} numbers", chunk.dims);
            return Err(Error::malformed(&self.path, fact, format!("{} as in the chunks before", self.dims)));
        }
        let schema = Arc::new(latents_schema(self.dims, &LatentsSource::default()));
        let batch = columns(chunk).and_then(|columns| RecordBatch::try_new(schema, columns)).map_err(fault)?;
        self.writer.write(&batch).map_err(fault)
    }

    /// Puts the finished table in its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map_err(|error| Error::malformed(&self.path, error.to_string(), "a disk with room"))?;
        self.writer.get_ref().get_ref().sync_data().map_err(Error::io("write", &self.path))?;
        std::fs::rename(&self.partial.path, &self.path).map_err(Error::io("write", &self.path))?;
        self.partial.finished = true;
        Ok(())
    }
}

fn latents_schema(dims: usize, source: &LatentsSource) -> Schema {
    let item = Arc::new(Field::new("item", DataType::Float32, false));
    let metadata = [(RECORDING, &source.recording), (CHECKPOINT, &source.checkpoint)];
    let named = metadata.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value.clone()?)));
    Schema::new(vec![
        Field::new("episode", DataType::UInt32, false),
        Field::new("step", DataType::UInt32, false),
        Field::new("state", DataType::UInt32, true),
        Field::new("distractor", DataType::UInt32, true),
        Field::new("reward", DataType::Float32, true),
        Field::new("latent", DataType::FixedSizeList(item, dims as i32), false),
    ])
    .with_metadata(named.collect::<HashMap<_, _>>())
}

fn columns(chunk: &Latents) -> std::result::Result<Vec<ArrayRef>, arrow::error::ArrowError> {
    let item = Arc::new(Field::new("item", DataType::Float32, false));
    let values = Arc::new(Float32Array::from(chunk.latent.clone()));
    Ok(vec![
        Arc::new(UInt32Array::from(chunk.episode.clone())),
        Arc::new(UInt32Array::from(chunk.step.clone())),
        Arc::new(UInt32Array::from(chunk.state.clone())),
        Arc::new(UInt32Array::from(chunk.distractor.clone())),
        Arc::new(Float32Array::from(chunk.reward.clone())),
        Arc::new(FixedSizeListArray::try_new(item, chunk.dims as i32, values, None)?),
    ])
}

fn latent_dims(schema: &Schema) -> Option<usize> {
    match schema.field_with_name("latent").ok()?.data_type() {
        DataType::FixedSizeList(_, dims) => usize::try_from(*dims).ok(),
        _ => None,
    }
}

fn other_columns(path: &Path, schema: &Schema) -> Error {
    let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    let fact = format!("columns {}", names.join(", "));
    Error::malformed(
        path,
        fact,
        "episode, step, state, distractor, reward and latent as `vibes-train encode` writes them",
    )
}
