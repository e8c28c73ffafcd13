//! An episode as an MCAP log, for Foxglove and Rerun: pictures as `foxglove.RawImage`, steps and distractors as Protobuf
//! messages of our own whose schemas are in the file. In: an [`Episode`]. Out: the bytes of the log, and the episode again.
//!
//! Topics: `/pixels` (`foxglove.RawImage`), `/step` (`vibes.Step`), `/distractor` (`vibes.Distractor`). A message's time is
//! its row's time in the episode, in nanoseconds from the start. The metadata record `vibes` holds spec and entry as JSON.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use foxglove::Encode;
use foxglove::messages::{RawImage, Timestamp};
use mcap::WriteOptions;
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost::Message;

use crate::mcap_log::messages::{Distractor, Step, file_descriptor_set};
use crate::{BackgroundFrame, CameraPose, Cell, Episode, EpisodeEntry, Error, Result, Spec};

mod messages;

const PIXELS: &str = "/pixels";
const STEP: &str = "/step";
const DISTRACTOR: &str = "/distractor";

/// The bytes of an episode's MCAP log.
///
/// # Errors
/// [`Error::Episode`] when the log cannot hold it.
pub fn mcap_bytes(episode: &Episode, spec: &Spec, entry: &EpisodeEntry) -> Result<Vec<u8>> {
    write(episode, spec, entry).map_err(|error| Error::Episode {
        index: episode.index,
        fact: error.to_string(),
        expected: "rows that MCAP can hold".into(),
    })
}

fn write(episode: &Episode, spec: &Spec, entry: &EpisodeEntry) -> anyhow_free::Result<Vec<u8>> {
    // One thread of compression, so that the bytes do not depend on the machine.
    let options = WriteOptions::new().profile("").library("vibes-data").compression_threads(0);
    let mut log = options.create(Cursor::new(Vec::with_capacity(episode.pixels.len())))?;
    let image_schema = RawImage::get_schema().map(|schema| (schema.name, schema.data));
    let (image_name, image_data) = image_schema.unwrap_or(("foxglove.RawImage".into(), Cow::Borrowed(&[])));
    let ours = file_descriptor_set().encode_to_vec();
    let mut channel = |topic: &str, name: &str, data: &[u8]| -> mcap::McapResult<u16> {
        let schema = log.add_schema(name, "protobuf", data)?;
        log.add_channel(schema, topic, "protobuf", &BTreeMap::new())
    };
    let steps = channel(STEP, "vibes.Step", &ours)?;
    let distractors = channel(DISTRACTOR, "vibes.Distractor", &ours)?;
    let images = match spec.pixels {
        Some(_) => Some(channel(PIXELS, &image_name, &image_data)?),
        None => None,
    };
    for row in 0..episode.rows() {
        let time = row_time(spec, row);
        let mut put = |channel_id: u16, body: Vec<u8>| {
            let header = MessageHeader { channel_id, sequence: row as u32, log_time: time, publish_time: time };
            log.write_to_known_channel(&header, &body)
        };
        if let (Some(images), Some(size)) = (images, spec.pixels) {
            let bytes = size.bytes();
            put(images, image(&episode.pixels[row * bytes..(row + 1) * bytes], size, time).encode_to_vec())?;
        }
        put(steps, step(episode, spec, row).encode_to_vec())?;
        put(distractors, distractor(episode, spec, row).encode_to_vec())?;
    }
    let json = BTreeMap::from([
        ("spec".to_owned(), serde_json::to_string(spec)?),
        ("episode".to_owned(), serde_json::to_string(entry)?),
    ]);
    log.write_metadata(&mcap::records::Metadata { name: "vibes".into(), metadata: json })?;
    log.finish()?;
    Ok(log.into_inner().into_inner())
}

/// The two kinds of failure inside [`write()`], joined without a dependency.
mod anyhow_free {
    pub(super) type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;
}

fn row_time(spec: &Spec, row: usize) -> u64 {
    (row as f64 * spec.agent_timestep() * 1e9).round() as u64
}

fn image(pixels: &[u8], size: crate::ImageSize, time: u64) -> RawImage {
    RawImage {
        timestamp: Some(Timestamp::new((time / 1_000_000_000) as u32, (time % 1_000_000_000) as u32)),
        frame_id: "camera".into(),
        width: size.width,
        height: size.height,
        encoding: "rgb8".into(),
        step: 3 * size.width,
        data: pixels.to_vec().into(),
    }
}

fn step(episode: &Episode, spec: &Spec, row: usize) -> Step {
    let acted = row < episode.steps();
    let last = !acted;
    Step {
        episode: episode.index,
        step: row as u32,
        state: episode.cell.map(|cell| cell.state),
        distractor: episode.cell.map(|cell| cell.distractor),
        is_first: row == 0,
        is_last: last,
        is_terminal: last && episode.is_terminal,
        action: if acted { slice(&episode.actions, row, spec.action_len()) } else { Vec::new() },
        reward: acted.then(|| episode.rewards[row]),
        discount: acted.then(|| episode.discounts[row]),
        observation: slice(&episode.observations, row, spec.observation_len()),
        qpos: slice(&episode.qpos, row, spec.qpos),
        qvel: slice(&episode.qvel, row, spec.qvel),
        acting_distractor: episode.acting_distractor,
    }
}

fn distractor(episode: &Episode, spec: &Spec, row: usize) -> Distractor {
    let CameraPose { r, h, v, roll } = episode.cameras[row];
    let background = episode.backgrounds[row];
    Distractor {
        r,
        h,
        v,
        roll,
        video: background.map(|shown| shown.video),
        frame: background.map(|shown| shown.frame),
        colors: slice(&episode.colors, row, 3 * spec.materials.len()),
    }
}

fn slice<T: Clone>(values: &[T], row: usize, len: usize) -> Vec<T> {
    values[row * len..(row + 1) * len].to_vec()
}

/// Reads an episode back from its MCAP log.
///
/// # Errors
/// [`Error::Malformed`] for a damaged log, or rows that do not fit the spec.
pub fn read_mcap(path: &Path, spec: &Spec) -> Result<Episode> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    let broken = |fact: String| Error::malformed(path, fact, "a whole MCAP log of an episode");
    let mut episode = Episode::default();
    each_message(&bytes, |topic, data| append(&mut episode, spec, topic, data)).map_err(broken)?;
    if episode.cameras.is_empty() {
        return Err(broken("no steps".into()));
    }
    episode.check(spec)?;
    Ok(episode)
}

/// No record of ours comes near this; a damaged length must not become an allocation.
const LARGEST_RECORD: usize = 1 << 26;

/// Calls `each` with the topic and the body of every message, in the order of the file. Lengths and checksums are checked
/// before anything is allocated or passed on.
fn each_message(
    bytes: &[u8],
    mut each: impl FnMut(&str, &[u8]) -> std::result::Result<(), String>,
) -> std::result::Result<(), String> {
    let text = |error: mcap::McapError| error.to_string();
    let options =
        LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LARGEST_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    let mut rest = bytes;
    while let Some(event) = reader.next_event() {
        match event.map_err(text)? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode: op::CHANNEL } => {
                let (id, topic) = channel(data).ok_or("a damaged channel")?;
                topics.insert(id, topic);
            }
            LinearReadEvent::Record { data, opcode: op::MESSAGE } => {
                if let Record::Message { header, data } = mcap::parse_record(op::MESSAGE, data).map_err(text)? {
                    let topic = topics.get(&header.channel_id).ok_or("a message of an unknown channel")?;
                    each(topic, &data)?;
                }
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(())
}

/// A channel's number and topic: the number, that of its schema, then the topic's length and bytes. The parser of the `mcap` package would allocate
/// whatever length stands there.
fn channel(data: &[u8]) -> Option<(u16, String)> {
    let id = u16::from_le_bytes(data.get(..2)?.try_into().ok()?);
    let length = u32::from_le_bytes(data.get(4..8)?.try_into().ok()?) as usize;
    let topic = data.get(8..)?.get(..length)?;
    Some((id, String::from_utf8(topic.to_vec()).ok()?))
}

fn append(episode: &mut Episode, spec: &Spec, topic: &str, data: &[u8]) -> std::result::Result<(), String> {
    let text = |error: prost::DecodeError| error.to_string();
    match topic {
        PIXELS => {
            let picture = RawImage::decode(data).map_err(text)?.data;
            if picture.len() != spec.pixels_len() {
                return Err(format!("a picture of {} bytes", picture.len()));
            }
            episode.pixels.extend_from_slice(&picture);
        }
        STEP => append_step(episode, Step::decode(data).map_err(text)?),
        DISTRACTOR => {
            let shown = Distractor::decode(data).map_err(text)?;
            episode.cameras.push(CameraPose { r: shown.r, h: shown.h, v: shown.v, roll: shown.roll });
            let background = shown.video.zip(shown.frame).map(|(video, frame)| BackgroundFrame { video, frame });
            episode.backgrounds.push(background);
            episode.colors.extend(shown.colors);
        }
        _ => {}
    }
    Ok(())
}

fn append_step(episode: &mut Episode, step: Step) {
    episode.index = step.episode;
    episode.cell = step.state.zip(step.distractor).map(|(state, distractor)| Cell { state, distractor });
    episode.acting_distractor = step.acting_distractor;
    episode.is_terminal |= step.is_terminal;
    episode.actions.extend(step.action);
    episode.rewards.extend(step.reward);
    episode.discounts.extend(step.discount);
    episode.observations.extend(step.observation);
    episode.qpos.extend(step.qpos);
    episode.qvel.extend(step.qvel);
}
