//! A LeRobot v3 dataset: `meta/info.json`, `meta/stats.json`, `meta/tasks.parquet`, `meta/episodes/chunk-000/file-000.parquet`,
//! `data/chunk-000/file-000.parquet`, `videos/observation.images.camera/chunk-000/file-000.mp4`.
//!
//! Layout and names: huggingface/lerobot 0.4 `datasets/utils.py` and `datasets/lerobot_dataset.py`. A frame is a row that has an action, so that an episode of T actions
//! has T frames and its last observation is lost; episodes are numbered from 0.

mod episodes;
mod features;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ::parquet::arrow::ArrowWriter;
use serde_json::{Value, json};
use vibes_data::{Recording, Spec};

use self::episodes::{EpisodeRow, Place, write_episodes, write_tasks};
use self::features::{CAMERA, Features};
use super::columns::parquet_error;
use super::parquet::properties;
use super::statistics::Statistics;
use super::video::Video;
use super::{Pictures, go_on, make_parent, with_steps, write_json};
use crate::error::{Error, Result};
use crate::sound::check_intact;

/// Files of a kind in one folder.
const FILES_A_CHUNK: u32 = 1000;
/// Bytes after which a table is closed and another begun.
const TABLE_BYTES: usize = 100 << 20;
/// Bytes after which a video is closed and another begun.
const VIDEO_BYTES: u64 = 200 << 20;

/// Writes the dataset; returns the numbers of episodes and frames.
pub(super) fn write(recording: &Recording, pictures: Pictures, out: &Path, stop: &AtomicBool) -> Result<(usize, u64)> {
    let spec = &recording.manifest().spec;
    let features = Features::of(spec, pictures);
    let mut tables = Tables { out, place: Place::default(), writer: None };
    let mut videos = Videos::new(spec, pictures, out)?;
    let mut rows: Vec<EpisodeRow> = Vec::new();
    let mut frames = 0;
    for entry in with_steps(recording)? {
        go_on(stop)?;
        check_intact(recording, entry)?;
        let episode = recording.episode(entry.index)?.to_episode();
        episode.check(spec)?;
        let index = rows.len() as i64;
        let columns = features.columns(&episode, index, frames)?;
        let data = tables.push(&columns.table)?;
        let video = videos.as_mut().map(|videos| videos.push(&episode.pixels, episode.steps())).transpose()?;
        rows.push(EpisodeRow {
            index,
            from: frames,
            frames: episode.steps() as i64,
            data,
            video,
            statistics: columns.statistics,
        });
        frames += episode.steps() as i64;
    }
    tables.finish()?;
    if let Some(videos) = &mut videos {
        videos.video.finish()?;
    }
    write_episodes(&out.join("meta/episodes/chunk-000/file-000.parquet"), &spec.task, &rows)?;
    write_tasks(&out.join("meta/tasks.parquet"), &spec.task)?;
    write_json(&out.join("meta/stats.json"), &all_statistics(&rows))?;
    write_json(&out.join("meta/info.json"), &info(spec, &features, rows.len(), frames, pictures))?;
    Ok((rows.len(), frames as u64))
}

/// The tables of frames, one file after another.
struct Tables<'a> {
    out: &'a Path,
    place: Place,
    writer: Option<(PathBuf, ArrowWriter<File>)>,
}

impl Tables<'_> {
    /// Appends an episode's frames as a row group of their own; says in which file.
    fn push(&mut self, table: &arrow::array::RecordBatch) -> Result<Place> {
        if self.writer.as_ref().is_some_and(|(_, writer)| writer.bytes_written() > TABLE_BYTES) {
            self.finish()?;
            self.place = self.place.next();
        }
        let (path, writer) = match &mut self.writer {
            Some(open) => open,
            None => {
                let path = self.out.join("data").join(self.place.file("parquet"));
                make_parent(&path)?;
                let file = File::create(&path).map_err(Error::io("create", &path))?;
                let writer =
                    ArrowWriter::try_new(file, table.schema(), Some(properties()?)).map_err(parquet_error(&path))?;
                self.writer.insert((path, writer))
            }
        };
        writer.write(table).and_then(|()| writer.flush()).map_err(parquet_error(path))?;
        Ok(self.place)
    }

    fn finish(&mut self) -> Result<()> {
        let Some((path, writer)) = self.writer.take() else { return Ok(()) };
        writer.close().map(drop).map_err(parquet_error(&path))
    }
}

/// The videos, one file after another.
struct Videos {
    folder: PathBuf,
    video: Video,
    place: Place,
    /// Seconds in the file so far.
    pictures: u64,
    bytes_a_picture: usize,
    seconds: f64,
}

/// Where an episode's pictures are: the file, and the seconds in it.
#[derive(Clone, Copy, Debug)]
struct VideoPlace {
    place: Place,
    from: f64,
    to: f64,
}

impl Videos {
    fn new(spec: &Spec, pictures: Pictures, out: &Path) -> Result<Option<Self>> {
        let Some(size) = spec.pixels.filter(|_| pictures == Pictures::Video) else { return Ok(None) };
        let seconds = spec.agent_timestep();
        let folder = out.join("videos").join(CAMERA);
        let video = Video::new(size, seconds)?;
        Ok(Some(Self { folder, video, place: Place::default(), pictures: 0, bytes_a_picture: size.bytes(), seconds }))
    }

    fn push(&mut self, pixels: &[u8], frames: usize) -> Result<VideoPlace> {
        if self.video.bytes() > VIDEO_BYTES {
            self.video.finish()?;
            (self.place, self.pictures) = (self.place.next(), 0);
        }
        let path = self.folder.join(self.place.file("mp4"));
        let from = self.pictures as f64 * self.seconds;
        for picture in pixels.chunks_exact(self.bytes_a_picture).take(frames) {
            self.video.push(&path, picture)?;
            self.pictures += 1;
        }
        Ok(VideoPlace { place: self.place, from, to: self.pictures as f64 * self.seconds })
    }
}

fn all_statistics(rows: &[EpisodeRow]) -> Value {
    let mut all: std::collections::BTreeMap<&str, Statistics> = std::collections::BTreeMap::new();
    for (name, statistics) in rows.iter().flat_map(|row| &row.statistics) {
        let joined = all.entry(name).or_default().and(statistics);
        all.insert(name, joined);
    }
    all.iter().map(|(name, statistics)| ((*name).to_owned(), statistics.json(*name == CAMERA))).collect()
}

fn info(spec: &Spec, features: &Features<'_>, episodes: usize, frames: i64, pictures: Pictures) -> Value {
    let with_video = spec.pixels.is_some() && pictures == Pictures::Video;
    let chunk = "chunk-{chunk_index:03d}/file-{file_index:03d}";
    json!({
        "codebase_version": "v3.0",
        "robot_type": spec.task,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": TABLE_BYTES >> 20,
        "video_files_size_in_mb": VIDEO_BYTES >> 20,
        "fps": frames_a_second(spec),
        "splits": { "train": format!("0:{episodes}") },
        "data_path": format!("data/{chunk}.parquet"),
        "video_path": with_video.then(|| format!("videos/{{video_key}}/{chunk}.mp4")),
        "features": features.json(),
    })
}

/// A whole number where it is one, as LeRobot's own sets have it; 12.5 stays 12.5.
fn frames_a_second(spec: &Spec) -> Value {
    let rate = 1.0 / spec.agent_timestep();
    let whole = (rate - rate.round()).abs() < 1e-9 * rate;
    if whole { json!(rate.round() as i64) } else { json!(rate) }
}
