//! A Minari 0.5 dataset in its Arrow storage: `data/metadata.json`, and for every episode `data/N/part-0.arrow` with `data/N/metadata.json`.
//!
//! Layout and names: Farama-Foundation/Minari `minari/dataset/_storages/arrow_storage.py` and `minari/serialization.py`. A table has T + 1 rows;
//! actions, rewards and flags of the last are padding, as Minari writes and drops them itself. Observations are a `Dict` of the pictures and the
//! parts of the vector observation; what Minari has no place for (states, discounts, distractors) goes into `infos`, what belongs to
//! an episode into its metadata, and the recording's spec into the dataset's, so that an import brings it all back.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arrow::array::{ArrayRef, BooleanArray, Int64Array, RecordBatch, StructArray, UInt8Array};
use arrow::datatypes::{Field, Float32Type, Float64Type, Schema};
use arrow::error::ArrowError;
use arrow::ipc::writer::FileWriter;
use serde_json::{Value, json};
use vibes_data::{Episode, EpisodeEntry, Recording, Spec};

use super::columns::{arrow_error, field, list, numbers};
use super::{go_on, make_parent, with_steps, write_json};
use crate::error::{Error, Result};
use crate::paths::rebase;
use crate::sound::check_intact;

/// The key of the dataset's metadata under which the recording's own header stands.
pub(crate) const HEADER: &str = "vibes";
/// The name of the pictures in the observation space.
pub(crate) const PIXELS: &str = "pixels";
/// The version of Minari whose layout this is.
const MINARI_VERSION: &str = "0.5.4";

/// The dataset's name: that of its folder, with the version that Minari asks for.
fn dataset_id(out: &Path) -> String {
    let name = out.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let plain: String = name.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' }).collect();
    let versioned = plain.rsplit_once("-v").is_some_and(|(_, version)| version.parse::<u32>().is_ok());
    if versioned { plain } else { format!("{plain}-v0") }
}

/// Writes the dataset; returns the numbers of episodes and rows.
/// `place` is where the dataset will be, `out` where it is made.
pub(super) fn write(recording: &Recording, place: &Path, out: &Path, stop: &AtomicBool) -> Result<(usize, u64)> {
    let data = out.join("data");
    let spec = &recording.manifest().spec;
    check(spec)?;
    let (mut rows, mut bytes) = (0, 0);
    let with_steps = with_steps(recording)?;
    for (number, &entry) in with_steps.iter().enumerate() {
        go_on(stop)?;
        check_intact(recording, entry)?;
        let episode = recording.episode(entry.index)?.to_episode();
        episode.check(spec)?;
        let path = data.join(number.to_string()).join("part-0.arrow");
        make_parent(&path)?;
        let table = table(&episode, spec).map_err(arrow_error(&path))?;
        write_table(&path, &table)?;
        rows += episode.rows() as u64;
        bytes += path.metadata().map_or(0, |file| file.len());
        write_json(&path.with_file_name("metadata.json"), &episode_metadata(number, entry, &episode))?;
    }
    write_json(&data.join("metadata.json"), &metadata(recording, &with_steps, place, bytes))?;
    Ok((with_steps.len(), rows))
}

/// That every part of an observation has a name of its own, and that there is one: a Dict of no spaces is a column of no length, which nobody reads.
fn check(spec: &Spec) -> Result<()> {
    let parts = spec.observation.iter().filter(|part| part.len > 0).map(|part| part.name.as_str());
    let mut names: Vec<&str> = spec.pixels.map(|_| PIXELS).into_iter().chain(parts).collect();
    names.sort_unstable();
    let twice = names.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
    let fact = match (names.is_empty(), twice) {
        (true, _) => "the recording has neither pictures nor a vector observation, and Minari asks for one".to_owned(),
        (_, Some(PIXELS)) => format!("a part of the vector observation is named {PIXELS}, as Minari's pictures are"),
        (_, Some(name)) => format!("two parts of the vector observation are named {name}"),
        (false, None) => return Ok(()),
    };
    Err(Error::Selection { fact, expected: "--format parquet takes every recording".to_owned() })
}

fn write_table(path: &Path, table: &RecordBatch) -> Result<()> {
    let file = File::create(path).map_err(Error::io("create", path))?;
    let mut writer = FileWriter::try_new_buffered(file, &table.schema()).map_err(arrow_error(path))?;
    writer.write(table).map_err(arrow_error(path))?;
    writer.finish().map_err(arrow_error(path))
}

fn table(episode: &Episode, spec: &Spec) -> std::result::Result<RecordBatch, ArrowError> {
    let (rows, steps) = (episode.rows(), episode.steps());
    let padded = |values: &[f32], len: usize| values.iter().copied().chain(std::iter::repeat_n(0.0, len)).collect();
    let ends =
        |ends: bool| -> ArrayRef { Arc::new(BooleanArray::from_iter((0..rows).map(|t| Some(ends && t + 1 == steps)))) };
    let columns = [
        ("observations", observations(episode, spec)?),
        ("actions", numbers::<Float32Type>(padded(&episode.actions, spec.action_len()), spec.action_len(), false)?),
        ("rewards", numbers::<Float32Type>(padded(&episode.rewards, 1), 1, true)?),
        ("terminations", ends(episode.is_terminal)),
        ("truncations", ends(!episode.is_terminal)),
        ("infos", infos(episode, spec, padded(&episode.discounts, 1))?),
    ];
    let schema = Schema::new(columns.iter().map(|(name, column)| field(name, column)).collect::<Vec<_>>());
    RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, column)| column).collect())
}

fn observations(episode: &Episode, spec: &Spec) -> std::result::Result<ArrayRef, ArrowError> {
    let mut parts: Vec<(Field, ArrayRef)> = Vec::new();
    if spec.pixels.is_some() {
        let pixels: ArrayRef = Arc::new(UInt8Array::from(episode.pixels.clone()));
        let pixels = list(pixels, spec.pixels_len())?;
        parts.push((field(PIXELS, &pixels), pixels));
    }
    let width = spec.observation_len();
    let mut from = 0;
    for part in spec.observation.iter().filter(|part| part.len > 0) {
        let row = |row: usize| &episode.observations[row * width + from..row * width + from + part.len];
        let values = (0..episode.rows()).flat_map(row).copied().collect();
        let column = numbers::<Float32Type>(values, part.len, false)?;
        parts.push((field(&part.name, &column), column));
        from += part.len;
    }
    structure(parts)
}

/// Everything else a row has. A list says its shape in its metadata, from which Minari's reader takes it.
fn infos(episode: &Episode, spec: &Spec, discounts: Vec<f32>) -> std::result::Result<ArrayRef, ArrowError> {
    let cameras = episode.cameras.iter().flat_map(|camera| [camera.r, camera.h, camera.v, camera.roll]).collect();
    let background = |pick: fn(vibes_data::BackgroundFrame) -> u32| -> ArrayRef {
        Arc::new(Int64Array::from_iter_values(
            episode.backgrounds.iter().map(|shown| shown.map_or(-1, |s| i64::from(pick(s)))),
        ))
    };
    let discount = numbers::<Float32Type>(discounts, 1, true)?;
    let mut parts = vec![(field("discount", &discount), discount)];
    let lists = [
        ("qpos", spec.qpos, (spec.qpos > 0).then(|| numbers::<Float64Type>(episode.qpos.clone(), spec.qpos, false))),
        ("qvel", spec.qvel, (spec.qvel > 0).then(|| numbers::<Float64Type>(episode.qvel.clone(), spec.qvel, false))),
        ("camera", 4, Some(numbers::<Float64Type>(cameras, 4, false))),
        (
            "colors",
            3 * spec.materials.len(),
            (!spec.materials.is_empty())
                .then(|| numbers::<Float32Type>(episode.colors.clone(), 3 * spec.materials.len(), false)),
        ),
    ];
    for (name, len, column) in lists {
        let Some(column) = column.transpose()? else { continue };
        let shape = [("shape".to_owned(), len.to_string())].into();
        parts.push((field(name, &column).with_metadata(shape), column));
    }
    for (name, column) in [("video", background(|s| s.video)), ("frame", background(|s| s.frame))] {
        parts.push((field(name, &column), column));
    }
    structure(parts)
}

fn structure(parts: Vec<(Field, ArrayRef)>) -> std::result::Result<ArrayRef, ArrowError> {
    let (fields, columns): (Vec<Field>, Vec<ArrayRef>) = parts.into_iter().unzip();
    Ok(Arc::new(StructArray::try_new(fields.into(), columns, None)?))
}

fn episode_metadata(place: usize, entry: &EpisodeEntry, episode: &Episode) -> Value {
    let steps = episode.steps().max(1) as f64;
    let rewards = episode.rewards.iter().map(|&reward| f64::from(reward));
    let sum: f64 = rewards.clone().sum();
    let mean = sum / steps;
    let spread = (rewards.clone().map(|r| (r - mean).powi(2)).sum::<f64>() / steps).sqrt();
    let (low, high) = rewards.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(r), high.max(r)));
    json!({
        "id": place,
        "total_steps": episode.steps(),
        "seed": entry.seed,
        "rewards_sum": sum, "rewards_mean": mean, "rewards_std": spread, "rewards_min": low, "rewards_max": high,
        HEADER: {
            "index": entry.index, "cell": entry.cell, "acting_distractor": episode.acting_distractor, "policy": entry.policy, "model_overrides": entry.model_overrides,
        },
    })
}

fn metadata(recording: &Recording, episodes: &[&EpisodeEntry], place: &Path, bytes: u64) -> Value {
    let manifest = recording.manifest();
    let mut options = manifest.options.clone();
    rebase(&mut options, Some(recording.path()), Some(place));
    let policies: std::collections::BTreeSet<&str> = episodes.iter().map(|e| e.policy.as_str()).collect();
    let steps: u64 = episodes.iter().map(|entry| u64::from(entry.steps)).sum();
    json!({
        "dataset_id": dataset_id(place),
        "total_episodes": episodes.len(),
        "total_steps": steps,
        "data_format": "arrow",
        "jpeg_encoding": false,
        "observation_space": observation_space(&manifest.spec),
        "action_space": action_space(&manifest.spec),
        "algorithm_name": policies.into_iter().collect::<Vec<_>>().join(", "),
        "description": format!("{} recorded by vibes-collect", manifest.spec.task),
        "minari_version": MINARI_VERSION,
        "dataset_size": (bytes as f64 / 1e5).round() / 10.0,
        HEADER: {
            "spec": manifest.spec, "options": options, "seed": manifest.seed, "versions": manifest.versions,
            "grid": manifest.grid, "videos": manifest.videos,
        },
    })
}

/// Spaces are JSON in a string, with Python's spelling of the infinities, which JSON proper does not have.
fn observation_space(spec: &Spec) -> String {
    let mut parts = Vec::new();
    if let Some(size) = spec.pixels {
        let nested = |value: u8| {
            let pixel = format!("[{value}, {value}, {value}]");
            let row = format!("[{}]", vec![pixel; size.width as usize].join(", "));
            format!("[{}]", vec![row; size.height as usize].join(", "))
        };
        let shape = format!("[{}, {}, 3]", size.height, size.width);
        parts.push((PIXELS.to_owned(), boxed("uint8", &shape, &nested(0), &nested(255))));
    }
    for part in spec.observation.iter().filter(|part| part.len > 0) {
        let all = |value: &str| format!("[{}]", vec![value; part.len].join(", "));
        let shape = format!("[{}]", part.len);
        parts.push((part.name.clone(), boxed("float32", &shape, &all("-Infinity"), &all("Infinity"))));
    }
    let parts: Vec<String> = parts.into_iter().map(|(name, space)| format!("{}: {space}", Value::from(name))).collect();
    format!("{{\"type\": \"Dict\", \"subspaces\": {{{}}}}}", parts.join(", "))
}

fn action_space(spec: &Spec) -> String {
    let shape = format!("[{}]", spec.action_len());
    boxed(
        "float32",
        &shape,
        &Value::from(spec.action.min.clone()).to_string(),
        &Value::from(spec.action.max.clone()).to_string(),
    )
}

fn boxed(dtype: &str, shape: &str, low: &str, high: &str) -> String {
    format!("{{\"type\": \"Box\", \"dtype\": \"{dtype}\", \"shape\": {shape}, \"low\": {low}, \"high\": {high}}}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_is_named_after_its_folder_with_a_version() {
        assert_eq!(dataset_id(Path::new("sets/reacher-v2")), "reacher-v2");
        assert_eq!(dataset_id(Path::new("sets/reacher easy")), "reacher_easy-v0");
        assert_eq!(dataset_id(Path::new("very-vivid")), "very-vivid-v0");
    }
}
