//! What a latent shows: pictures that a decoder draws of frozen latents, written by `vibes-train decode` and drawn by `vibes-analyze decode`.
//!
//! One row per recorded row of a strip. Columns: `strip`, `episode`, `step`, `start` (uint32; `start` is the step from which on the open-loop prediction
//! sees nothing but actions), `recorded`, `shown` (fixed-size binary, RGB row major: the frame, and the decoder's picture of the latent of that row) and
//! `predicted` (nullable: the decoder's picture of the latent that the dynamics predict from the latent at `start` and the recorded actions). Schema
//! metadata names recording, checkpoint, picture size and how good the decoder is.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, FixedSizeBinaryArray, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Schema, UInt32Type};
use arrow::ipc::writer::FileWriter;

use crate::atomic::write_atomically;
use crate::map::MappedTable;
use crate::{Error, Result};

const KEYS: [&str; 4] = ["strip", "episode", "step", "start"];

/// Strips of pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decoded {
    /// Height and width of every picture.
    pub size: (u32, u32),
    /// The pictures in order of strip and step.
    pub rows: Vec<DecodedRow>,
    /// The recording whose rows are shown.
    pub recording: Option<String>,
    /// The checkpoint whose latents are shown.
    pub checkpoint: Option<String>,
    /// The objective that made the latents.
    pub objective: Option<String>,
    /// Share of the pixels' variance over held-out rows that the decoder's pictures explain.
    pub explained: Option<f64>,
}

/// One row of a strip.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DecodedRow {
    /// Number of the strip.
    pub strip: u32,
    /// Episode of the recording.
    pub episode: u32,
    /// Row of the episode.
    pub step: u32,
    /// The step from which on the prediction is open-loop.
    pub start: u32,
    /// The recorded frame, `[height, width, 3]`.
    pub recorded: Vec<u8>,
    /// What the decoder draws of the row's latent.
    pub shown: Vec<u8>,
    /// What it draws of the predicted latent; none before `start`.
    pub predicted: Option<Vec<u8>>,
}

impl DecodedRow {
    /// Its two or three pictures.
    fn pictures(&self) -> impl Iterator<Item = &Vec<u8>> {
        [&self.recorded, &self.shown].into_iter().chain(&self.predicted)
    }
}

impl Decoded {
    /// Writes the strips whole or not at all.
    ///
    /// # Errors
    /// [`Error::Malformed`] if pictures differ in size, [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let fault = |error: arrow::error::ArrowError| {
            Error::malformed(path, error.to_string(), "pictures of one size and a disk with room")
        };
        let batch = self.batch().map_err(fault)?;
        let mut writer = FileWriter::try_new(Vec::new(), &batch.schema()).map_err(fault)?;
        writer.write(&batch).map_err(fault)?;
        write_atomically(path, &writer.into_inner().map_err(fault)?)
    }

    /// Reads strips back.
    ///
    /// # Errors
    /// [`Error::Malformed`] for a damaged file or other columns.
    pub fn read(path: &Path) -> Result<Self> {
        let table = MappedTable::open(path)?;
        let schema = table.schema();
        let text = |key: &str| schema.metadata().get(&format!("vibes.{key}")).cloned();
        let number = |key: &str| text(key).and_then(|text| text.parse::<u32>().ok());
        let other = |fact: &str| Error::malformed(path, fact, "the file that `vibes-train decode` writes");
        let size = number("height").zip(number("width")).ok_or_else(|| other("no picture size in its metadata"))?;
        let mut decoded = Self {
            size,
            rows: Vec::new(),
            recording: text("recording"),
            checkpoint: text("checkpoint"),
            objective: text("objective"),
            explained: text("explained").and_then(|text| text.parse().ok()),
        };
        let bytes = (size.0 as usize).checked_mul(size.1 as usize).and_then(|pixels| pixels.checked_mul(3));
        let bytes = bytes.ok_or_else(|| other("a picture size that no picture has"))?;
        for index in 0..table.batches() {
            let batch = table.batch(index)?;
            let rows = rows(&batch).ok_or_else(|| other("other columns"))?;
            if rows.iter().any(|row| row.pictures().any(|picture| picture.len() != bytes)) {
                return Err(other("pictures of another size than its metadata says"));
            }
            decoded.rows.extend(rows);
        }
        Ok(decoded)
    }

    fn batch(&self) -> std::result::Result<RecordBatch, arrow::error::ArrowError> {
        let keys = |of: fn(&DecodedRow) -> u32| -> ArrayRef {
            Arc::new(UInt32Array::from(self.rows.iter().map(of).collect::<Vec<_>>()))
        };
        let width = (self.size.0 * self.size.1 * 3) as i32;
        let pictures = |of: &dyn Fn(&DecodedRow) -> Option<Vec<u8>>| -> std::result::Result<ArrayRef, _> {
            let pictures = self.rows.iter().map(of);
            FixedSizeBinaryArray::try_from_sparse_iter_with_size(pictures, width)
                .map(|array| Arc::new(array) as ArrayRef)
        };
        let columns = vec![
            keys(|row| row.strip),
            keys(|row| row.episode),
            keys(|row| row.step),
            keys(|row| row.start),
            pictures(&|row| Some(row.recorded.clone()))?,
            pictures(&|row| Some(row.shown.clone()))?,
            pictures(&|row| row.predicted.clone())?,
        ];
        let picture = DataType::FixedSizeBinary(width);
        let mut fields: Vec<Field> = KEYS.iter().map(|name| Field::new(*name, DataType::UInt32, false)).collect();
        fields.extend(["recorded", "shown"].map(|name| Field::new(name, picture.clone(), false)));
        fields.push(Field::new("predicted", picture, true));
        let texts = [
            ("height", Some(self.size.0.to_string())),
            ("width", Some(self.size.1.to_string())),
            ("recording", self.recording.clone()),
            ("checkpoint", self.checkpoint.clone()),
            ("objective", self.objective.clone()),
            ("explained", self.explained.map(|share| share.to_string())),
        ];
        let texts = texts.into_iter().filter_map(|(key, text)| Some((format!("vibes.{key}"), text?)));
        let schema = Schema::new(fields).with_metadata(texts.collect::<HashMap<_, _>>());
        RecordBatch::try_new(Arc::new(schema), columns)
    }
}

fn rows(batch: &RecordBatch) -> Option<Vec<DecodedRow>> {
    let keys = |name: &str| Some(batch.column_by_name(name)?.as_primitive_opt::<UInt32Type>()?.values().to_vec());
    let pictures = |name: &str| batch.column_by_name(name)?.as_fixed_size_binary_opt().cloned();
    let [strip, episode, step, start] = KEYS.map(keys);
    let (strip, episode, step, start) = (strip?, episode?, step?, start?);
    let (recorded, shown, predicted) = (pictures("recorded")?, pictures("shown")?, pictures("predicted")?);
    let row = |i: usize| DecodedRow {
        strip: strip[i],
        episode: episode[i],
        step: step[i],
        start: start[i],
        recorded: recorded.value(i).to_vec(),
        shown: shown.value(i).to_vec(),
        predicted: predicted.is_valid(i).then(|| predicted.value(i).to_vec()),
    };
    Some((0..batch.num_rows()).map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_read_back_as_they_were_written() {
        let dir = tempfile::tempdir().expect("folder");
        let path = dir.path().join("decoded.arrow");
        let row = |step: u32| DecodedRow {
            strip: 0,
            episode: 3,
            step,
            start: 5,
            recorded: vec![step as u8; 12],
            shown: vec![9; 12],
            predicted: (step >= 5).then(|| vec![7; 12]),
        };
        let decoded = Decoded {
            size: (2, 2),
            rows: (3..8).map(row).collect(),
            recording: Some("recordings/x".into()),
            checkpoint: None,
            objective: Some("vibes".into()),
            explained: Some(0.5),
        };
        decoded.write(&path).expect("written");
        assert_eq!(Decoded::read(&path).expect("read"), decoded);
        std::fs::write(&path, b"ARROW1 and no more").expect("file");
        assert!(Decoded::read(&path).is_err());
    }

    /// The size in the metadata is a text that anyone can have written; what is drawn of the pictures relies on it.
    #[test]
    fn pictures_of_another_size_than_the_metadata_says_are_refused() {
        let dir = tempfile::tempdir().expect("folder");
        let path = dir.path().join("decoded.arrow");
        let picture = vec![1; 12];
        let row = DecodedRow {
            recorded: picture.clone(),
            shown: picture.clone(),
            predicted: Some(picture),
            ..DecodedRow::default()
        };
        let decoded = Decoded { size: (2, 2), rows: vec![row], ..Decoded::default() };
        let batch = decoded.batch().expect("a batch");
        for (height, is_read) in [("2", true), ("3", false), ("4294967295", false)] {
            let sizes = [("vibes.height", height), ("vibes.width", if is_read { "2" } else { "4294967295" })];
            let metadata = sizes.map(|(key, text)| (key.to_owned(), text.to_owned())).into_iter().collect();
            let schema = Arc::new(batch.schema().as_ref().clone().with_metadata(metadata));
            let mut writer = FileWriter::try_new(Vec::new(), &schema).expect("a writer");
            let renamed = RecordBatch::try_new(schema, batch.columns().to_vec()).expect("the same columns");
            writer.write(&renamed).expect("written");
            std::fs::write(&path, writer.into_inner().expect("bytes")).expect("file");
            assert_eq!(Decoded::read(&path).is_ok(), is_read, "{height}");
        }
    }
}
