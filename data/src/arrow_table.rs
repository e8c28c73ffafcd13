//! An episode as an Arrow table: one row per agent step, one record batch per file, nothing compressed, so that it can be
//! memory-mapped. In: an [`Episode`]. Out: the bytes of an Arrow IPC file, and the schema that every such file must have.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, FixedSizeBinaryArray, FixedSizeListArray, Float32Array, Float64Array, StructArray,
    UInt32Array,
};
use arrow::buffer::{BooleanBuffer, Buffer, NullBuffer};
use arrow::datatypes::{DataType, Field, Fields, Schema, SchemaRef};
use arrow::ipc::writer::FileWriter;
use arrow::record_batch::RecordBatch;

use crate::map::MappedTable;
use crate::{Episode, EpisodeEntry, Error, Result, Spec};

/// The schema metadata key under which an episode's own entry (JSON) stands.
const ENTRY: &str = "vibes.episode";

/// The column of the distractor trajectory that a policy saw while it acted; recordings from before policies saw pictures lack it.
pub(crate) const ACTING_DISTRACTOR: &str = "acting_distractor";

/// The columns of an episode of this spec. A column of no numbers (`observation`, `qpos`, `qvel`, `pixels`, `colors` where the
/// spec has none) is left out.
pub fn episode_schema(spec: &Spec) -> Schema {
    let field = Field::new;
    let mut fields = vec![
        field("episode", DataType::UInt32, false),
        field("step", DataType::UInt32, false),
        field("state", DataType::UInt32, true),
        field("distractor", DataType::UInt32, true),
        field(ACTING_DISTRACTOR, DataType::UInt32, true),
        field("is_first", DataType::Boolean, false),
        field("is_last", DataType::Boolean, false),
        field("is_terminal", DataType::Boolean, false),
        field("action", list(DataType::Float32, spec.action_len()), true),
        field("reward", DataType::Float32, true),
        field("discount", DataType::Float32, true),
    ];
    let lists = [
        ("observation", DataType::Float32, spec.observation_len()),
        ("qpos", DataType::Float64, spec.qpos),
        ("qvel", DataType::Float64, spec.qvel),
    ];
    let present = lists.into_iter().filter(|(_, _, len)| *len > 0);
    fields.extend(present.map(|(name, of, len)| field(name, list(of, len), false)));
    if let Some(size) = spec.pixels {
        let shape = [("height", size.height.to_string()), ("width", size.width.to_string())];
        let metadata = shape.map(|(key, value)| (key.to_owned(), value));
        let bytes = DataType::FixedSizeBinary(size.bytes() as i32);
        fields.push(field("pixels", bytes, true).with_metadata(HashMap::from(metadata)));
    }
    fields.push(field("camera", DataType::Struct(camera_fields()), false));
    fields.push(field("video", DataType::UInt32, true));
    fields.push(field("frame", DataType::UInt32, true));
    if !spec.materials.is_empty() {
        fields.push(field("colors", list(DataType::Float32, 3 * spec.materials.len()), false));
    }
    Schema::new(fields)
}

/// The bytes of the Arrow file of one episode; `entry` goes into the schema's metadata. In a recording that `is_older` than the column of the distractor that a policy saw, a table has
/// it only where it says something. The pictures of an owned episode are not copied before they are in the file.
pub(crate) fn arrow_bytes(
    mut episode: Cow<'_, Episode>,
    spec: &Spec,
    entry: &EpisodeEntry,
    is_older: bool,
) -> Result<Vec<u8>> {
    let pixels = match &mut episode {
        Cow::Borrowed(episode) => Buffer::from_slice_ref(&episode.pixels),
        Cow::Owned(episode) => Buffer::from_vec(std::mem::take(&mut episode.pixels)),
    };
    let as_error =
        |fact: String| Error::Episode { index: episode.index, fact, expected: "columns that Arrow can hold".into() };
    let entry = serde_json::to_string(entry).map_err(|error| as_error(error.to_string()))?;
    let schema = episode_schema(spec).with_metadata(HashMap::from([(ENTRY.to_owned(), entry)]));
    let is_left_out = |name: &str| is_older && episode.acting_distractor.is_none() && name == ACTING_DISTRACTOR;
    let write = || -> std::result::Result<Vec<u8>, arrow::error::ArrowError> {
        let kept: Vec<usize> = (0..schema.fields().len()).filter(|&at| !is_left_out(schema.field(at).name())).collect();
        let capacity = pixels.len() + 65_536;
        let columns = columns(&episode, pixels, spec)?;
        let batch = RecordBatch::try_new(Arc::new(schema.clone()), columns)?.project(&kept)?;
        let mut writer = FileWriter::try_new(Vec::with_capacity(capacity), &batch.schema())?;
        writer.write(&batch)?;
        writer.finish()?;
        writer.into_inner()
    };
    write().map_err(|error| as_error(error.to_string()))
}

/// The entry that an episode's Arrow file carries of itself; its checksums are empty.
///
/// # Errors
/// [`Error::Malformed`] for a file that is no Arrow table of an episode.
pub fn read_episode_entry(path: &Path) -> Result<EpisodeEntry> {
    entry_of(&MappedTable::open(path)?.schema(), path)
}

pub(crate) fn entry_of(schema: &SchemaRef, path: &Path) -> Result<EpisodeEntry> {
    let text = schema.metadata().get(ENTRY).map_or("", String::as_str);
    serde_json::from_str(text).map_err(|error| {
        Error::malformed(path, format!("no episode entry in the metadata ({error})"), format!("{ENTRY} as JSON"))
    })
}

/// The columns of an episode whose pictures are `pixels`.
fn columns(
    episode: &Episode,
    pixels: Buffer,
    spec: &Spec,
) -> std::result::Result<Vec<ArrayRef>, arrow::error::ArrowError> {
    let rows = episode.rows();
    let last = episode.steps();
    let flag = |set: &dyn Fn(usize) -> bool| -> ArrayRef {
        Arc::new(BooleanArray::new(BooleanBuffer::collect_bool(rows, set), None))
    };
    let same = |value: Option<u32>| -> ArrayRef { Arc::new(UInt32Array::from(vec![value; rows])) };
    // Row T has neither action nor reward nor discount.
    let acted = NullBuffer::new(BooleanBuffer::collect_bool(rows, |row| row < last));
    let scalar = |values: &[f32]| -> ArrayRef {
        let padded: Vec<f32> = values.iter().copied().chain([0.0]).collect();
        Arc::new(Float32Array::new(padded.into(), Some(acted.clone())))
    };
    let padded_actions: Vec<f32> =
        episode.actions.iter().copied().chain(std::iter::repeat_n(0.0, spec.action_len())).collect();
    let mut columns: Vec<ArrayRef> = vec![
        Arc::new(UInt32Array::from(vec![episode.index; rows])),
        Arc::new(UInt32Array::from_iter_values(0..rows as u32)),
        same(episode.cell.map(|cell| cell.state)),
        same(episode.cell.map(|cell| cell.distractor)),
        same(episode.acting_distractor),
        flag(&|row| row == 0),
        flag(&|row| row == last),
        flag(&|row| row == last && episode.is_terminal),
        floats(&padded_actions, spec.action_len(), Some(acted.clone()))?,
        scalar(&episode.rewards),
        scalar(&episode.discounts),
    ];
    if spec.observation_len() > 0 {
        columns.push(floats(&episode.observations, spec.observation_len(), None)?);
    }
    for (values, len) in [(&episode.qpos, spec.qpos), (&episode.qvel, spec.qvel)] {
        if len > 0 {
            columns.push(doubles(values, len)?);
        }
    }
    if let Some(size) = spec.pixels {
        columns.push(Arc::new(FixedSizeBinaryArray::try_new(size.bytes() as i32, pixels, None)?));
    }
    columns.push(cameras(episode)?);
    let background = |pick: fn(crate::BackgroundFrame) -> u32| -> ArrayRef {
        Arc::new(episode.backgrounds.iter().map(|shown| shown.map(pick)).collect::<UInt32Array>())
    };
    columns.push(background(|shown| shown.video));
    columns.push(background(|shown| shown.frame));
    if !spec.materials.is_empty() {
        columns.push(floats(&episode.colors, 3 * spec.materials.len(), None)?);
    }
    Ok(columns)
}

fn cameras(episode: &Episode) -> std::result::Result<ArrayRef, arrow::error::ArrowError> {
    let part = |pick: fn(&crate::CameraPose) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(episode.cameras.iter().map(pick)))
    };
    let parts = vec![part(|c| c.r), part(|c| c.h), part(|c| c.v), part(|c| c.roll)];
    Ok(Arc::new(StructArray::try_new(camera_fields(), parts, None)?))
}

fn camera_fields() -> Fields {
    ["r", "h", "v", "roll"].map(|name| Field::new(name, DataType::Float64, false)).to_vec().into()
}

fn item(of: DataType) -> Arc<Field> {
    Arc::new(Field::new("item", of, false))
}

fn list(of: DataType, len: usize) -> DataType {
    DataType::FixedSizeList(item(of), len as i32)
}

fn floats(
    values: &[f32],
    len: usize,
    valid: Option<NullBuffer>,
) -> std::result::Result<ArrayRef, arrow::error::ArrowError> {
    let values = Arc::new(Float32Array::from(values.to_vec()));
    Ok(Arc::new(FixedSizeListArray::try_new(item(DataType::Float32), len as i32, values, valid)?))
}

fn doubles(values: &[f64], len: usize) -> std::result::Result<ArrayRef, arrow::error::ArrowError> {
    let values = Arc::new(Float64Array::from(values.to_vec()));
    Ok(Arc::new(FixedSizeListArray::try_new(item(DataType::Float64), len as i32, values, None)?))
}
