//! The features of a LeRobot dataset made of a recording: their names, types and shapes, and an episode's frames as columns.
//!
//! `observation.state` is the vector observation, `observation.images.camera` the picture. What policies must not be fed (states, distractors, cells) is
//! called `info.*`.

use std::sync::Arc;

use arrow::array::{ArrayRef, BinaryArray, BooleanArray, RecordBatch, StringArray, StructArray};
use arrow::datatypes::{Float32Type, Float64Type, Int64Type, Schema};
use arrow::error::ArrowError;
use serde_json::{Value, json};
use vibes_data::{Episode, Spec};

use super::super::Pictures;
use super::super::columns::{arrow_error, field, numbers};
use super::super::pictures::png;
use super::super::statistics::Statistics;
use super::frames_a_second;
use crate::error::Result;

/// The pictures' feature.
pub(super) const CAMERA: &str = "observation.images.camera";

/// What the tables and the metadata say of each other.
pub(super) struct Features<'a> {
    spec: &'a Spec,
    pictures: Pictures,
}

/// An episode's frames, and the statistics of each feature.
pub(super) struct Columns {
    pub(super) table: RecordBatch,
    pub(super) statistics: Vec<(String, Statistics)>,
}

/// A column, its dimensions, and its values for the statistics.
struct Column {
    name: &'static str,
    array: ArrayRef,
    dims: usize,
    values: Vec<f64>,
}

impl<'a> Features<'a> {
    pub(super) fn of(spec: &'a Spec, pictures: Pictures) -> Self {
        Self { spec, pictures }
    }

    /// Name, type and length of every feature but the picture; a length of 0 leaves it out.
    fn list(&self) -> Vec<(&'static str, &'static str, usize)> {
        let spec = self.spec;
        let all = [
            ("observation.state", "float32", spec.observation_len()),
            ("action", "float32", spec.action_len()),
            ("next.reward", "float32", 1),
            ("next.discount", "float32", 1),
            ("next.done", "bool", 1),
            ("info.qpos", "float64", spec.qpos),
            ("info.qvel", "float64", spec.qvel),
            ("info.camera", "float64", 4),
            ("info.colors", "float32", 3 * spec.materials.len()),
            ("info.video", "int64", 1),
            ("info.frame", "int64", 1),
            ("info.state", "int64", 1),
            ("info.distractor", "int64", 1),
            ("timestamp", "float32", 1),
            ("frame_index", "int64", 1),
            ("episode_index", "int64", 1),
            ("index", "int64", 1),
            ("task_index", "int64", 1),
        ];
        all.into_iter().filter(|(_, _, len)| *len > 0).collect()
    }

    /// As `info.json` has them.
    pub(super) fn json(&self) -> Value {
        let names = |name: &str, len: usize| -> Value {
            match name {
                "observation.state" => json!(self.spec.observation_names()),
                "action" => json!((0..len).map(|i| format!("action[{i}]")).collect::<Vec<_>>()),
                "info.camera" => json!(["r", "h", "v", "roll"]),
                _ => Value::Null,
            }
        };
        let plain = self.list().into_iter().map(|(name, dtype, len)| {
            (name.to_owned(), json!({ "dtype": dtype, "shape": [len], "names": names(name, len) }))
        });
        let mut features: serde_json::Map<String, Value> = plain.collect();
        features.extend(self.picture_feature());
        Value::Object(features)
    }

    fn picture_feature(&self) -> Option<(String, Value)> {
        let size = self.spec.pixels?;
        let mut feature = json!({
            "dtype": if self.pictures == Pictures::Video { "video" } else { "image" },
            "shape": [size.height, size.width, 3],
            "names": ["height", "width", "channels"],
        });
        if self.pictures == Pictures::Video {
            feature["info"] = json!({
                "video.height": size.height, "video.width": size.width, "video.codec": "h264", "video.pix_fmt": "yuvj420p",
                "video.is_depth_map": false, "video.fps": frames_a_second(self.spec), "video.channels": 3, "has_audio": false,
            });
        }
        Some((CAMERA.into(), feature))
    }

    /// The frames of an episode that is number `index` of the dataset and begins at frame `from`.
    pub(super) fn columns(&self, episode: &Episode, index: i64, from: i64) -> Result<Columns> {
        let path = std::path::PathBuf::from(format!("episode {}", episode.index));
        let built = self.build(episode, index, from).map_err(arrow_error(&path))?;
        let mut statistics: Vec<(String, Statistics)> =
            built.iter().map(|column| (column.name.to_owned(), Statistics::of(&column.values, column.dims))).collect();
        let mut columns: Vec<(&str, ArrayRef)> = built.into_iter().map(|column| (column.name, column.array)).collect();
        let bytes = self.spec.pixels_len();
        if let Some(size) = self.spec.pixels {
            let pixels = &episode.pixels[..episode.steps() * bytes];
            statistics.push((CAMERA.into(), Statistics::of_pictures(pixels, bytes)));
            if self.pictures == Pictures::Png {
                let files = pixels.chunks_exact(bytes).map(|picture| png(picture, size)).collect::<Result<Vec<_>>>()?;
                columns.push((CAMERA, images(&files).map_err(arrow_error(&path))?));
            }
        }
        let schema = Schema::new(columns.iter().map(|(name, column)| field(name, column)).collect::<Vec<_>>());
        let table = RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, column)| column).collect());
        Ok(Columns { table: table.map_err(arrow_error(&path))?, statistics })
    }

    fn build(&self, episode: &Episode, index: i64, from: i64) -> std::result::Result<Vec<Column>, ArrowError> {
        let steps = episode.steps();
        let clock = self.spec.agent_timestep();
        let rows = 0..steps as i64;
        let same = |value: Option<u32>| vec![value.map_or(-1, i64::from); steps];
        let shown = |pick: fn(vibes_data::BackgroundFrame) -> u32| -> Vec<i64> {
            episode.backgrounds[..steps].iter().map(|shown| shown.map_or(-1, |shown| i64::from(pick(shown)))).collect()
        };
        let cameras = || episode.cameras[..steps].iter().flat_map(|camera| [camera.r, camera.h, camera.v, camera.roll]);
        let mut columns = Vec::new();
        for (name, _, dims) in self.list() {
            let singles = |values: &[f32]| single(name, values[..steps * dims].to_vec(), dims);
            columns.push(match name {
                "observation.state" => singles(&episode.observations),
                "action" => singles(&episode.actions),
                "next.reward" => singles(&episode.rewards),
                "next.discount" => singles(&episode.discounts),
                "info.colors" => singles(&episode.colors),
                "timestamp" => single(name, rows.clone().map(|row| (row as f64 * clock) as f32).collect(), 1),
                "info.qpos" => double(name, episode.qpos[..steps * dims].to_vec(), dims),
                "info.qvel" => double(name, episode.qvel[..steps * dims].to_vec(), dims),
                "info.camera" => double(name, cameras().collect(), dims),
                "next.done" => done(name, steps),
                "info.video" => whole(name, shown(|shown| shown.video)),
                "info.frame" => whole(name, shown(|shown| shown.frame)),
                "info.state" => whole(name, same(episode.cell.map(|cell| cell.state))),
                "info.distractor" => whole(name, same(episode.cell.map(|cell| cell.distractor))),
                "frame_index" => whole(name, rows.clone().collect()),
                "episode_index" => whole(name, vec![index; steps]),
                "index" => whole(name, rows.clone().map(|row| from + row).collect()),
                _ => whole(name, vec![0; steps]),
            }?);
        }
        Ok(columns)
    }
}

fn single(name: &'static str, values: Vec<f32>, dims: usize) -> std::result::Result<Column, ArrowError> {
    let plain = values.iter().map(|&value| f64::from(value)).collect();
    Ok(Column { name, array: numbers::<Float32Type>(values, dims, true)?, dims, values: plain })
}

fn double(name: &'static str, values: Vec<f64>, dims: usize) -> std::result::Result<Column, ArrowError> {
    Ok(Column { name, array: numbers::<Float64Type>(values.clone(), dims, true)?, dims, values })
}

fn whole(name: &'static str, values: Vec<i64>) -> std::result::Result<Column, ArrowError> {
    let plain = values.iter().map(|&value| value as f64).collect();
    Ok(Column { name, array: numbers::<Int64Type>(values, 1, true)?, dims: 1, values: plain })
}

/// Set at the last frame, after which the episode is over.
fn done(name: &'static str, steps: usize) -> std::result::Result<Column, ArrowError> {
    let ends: Vec<bool> = (0..steps).map(|row| row + 1 == steps).collect();
    let values = ends.iter().map(|&end| f64::from(u8::from(end))).collect();
    Ok(Column { name, array: Arc::new(BooleanArray::from(ends)), dims: 1, values })
}

/// Pictures as Hugging Face keeps them in a table: the file's bytes, and a path that there is none of.
fn images(files: &[Vec<u8>]) -> std::result::Result<ArrayRef, ArrowError> {
    let bytes: ArrayRef = Arc::new(BinaryArray::from_iter_values(files));
    let path: ArrayRef = Arc::new(StringArray::from(vec![None::<&str>; files.len()]));
    let fields =
        vec![field("bytes", &bytes), arrow::datatypes::Field::new("path", arrow::datatypes::DataType::Utf8, true)];
    Ok(Arc::new(StructArray::try_new(fields.into(), vec![bytes, path], None)?))
}
