//! The numbers of `metrics.jsonl` and `evaluations.jsonl` once more, for TensorBoard. In: rows. Out: an event file in the run folder; every time training goes on
//! begins another, which tells TensorBoard to forget what a stopped run wrote after its last checkpoint.
//!
//! A file is a sequence of records: length (8 bytes), its checksum, a Protobuf `Event`, its checksum (little-endian; CRC-32C, rotated and shifted so
//! that the checksum of a checksum is not constant).

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use prost::Message;
use serde::Serialize;
use serde_json::Value as Json;

use crate::error::{Result, io, malformed};

/// The part of TensorFlow's `event.proto` that is used here.
#[derive(Clone, PartialEq, Message)]
struct Event {
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
    #[prost(message, optional, tag = "7")]
    session_log: Option<SessionLog>,
}

#[derive(Clone, PartialEq, Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    value: Vec<Scalar>,
}

#[derive(Clone, PartialEq, Message)]
struct Scalar {
    #[prost(string, tag = "1")]
    tag: String,
    #[prost(float, tag = "2")]
    simple_value: f32,
}

#[derive(Clone, PartialEq, Message)]
struct SessionLog {
    /// 1: a session starts at this step; what came after it before is void.
    #[prost(int32, tag = "1")]
    status: i32,
}

/// An open event file.
#[derive(Debug)]
pub struct EventFile {
    path: PathBuf,
    file: File,
}

impl EventFile {
    /// Begins a file in `folder` for the updates after `update`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn begin(folder: &Path, update: u64) -> Result<Self> {
        let path = folder.join(format!("events.out.tfevents.{:010}.vibes-train.{update:08}", now() as u64));
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(io("open", &path))?;
        let mut events = Self { path, file };
        events.write(&Event { file_version: Some("brain.Event:2".to_owned()), ..Event::default() })?;
        if update > 0 {
            let session_log = Some(SessionLog { status: 1 });
            events.write(&Event { step: update as i64 + 1, session_log, ..Event::default() })?;
        }
        Ok(events)
    }

    /// Appends every number of a row, its tags under `group`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, group: &str, update: u64, row: &impl Serialize) -> Result<()> {
        let row =
            serde_json::to_value(row).map_err(|error| malformed(&self.path, error, "numbers that JSON can hold"))?;
        let mut value = Vec::new();
        collect(group, &row, &mut value);
        value.retain(|scalar| scalar.tag != format!("{group}/update"));
        self.write(&Event { step: update as i64, summary: Some(Summary { value }), ..Event::default() })
    }

    fn write(&mut self, event: &Event) -> Result<()> {
        let event = Event { wall_time: now(), ..event.clone() };
        let record = record(&event.encode_to_vec());
        self.file.write_all(&record).map_err(io("write", &self.path))
    }
}

/// Seconds since 1970.
fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |elapsed| elapsed.as_secs_f64())
}

fn record(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    [&length[..], &masked(&length), data, &masked(data)].concat()
}

fn masked(data: &[u8]) -> [u8; 4] {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(0xa282_ead8).to_le_bytes()
}

/// Numbers by their path of names; of a list, the `latents` of its named items.
fn collect(path: &str, value: &Json, out: &mut Vec<Scalar>) {
    match value {
        Json::Number(number) => {
            let simple_value = number.as_f64().unwrap_or(f64::NAN) as f32;
            out.push(Scalar { tag: path.to_owned(), simple_value });
        }
        Json::Object(fields) => {
            fields.iter().for_each(|(name, field)| collect(&format!("{path}/{name}"), field, out));
        }
        Json::Array(items) => {
            for item in items {
                if let (Some(Json::String(name)), Some(latents)) = (item.get("name"), item.get("latents")) {
                    collect(&format!("{path}/{name}"), latents, out);
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    /// Reads the records back, checking both checksums.
    fn read(path: &Path) -> Vec<Event> {
        let bytes = std::fs::read(path).unwrap();
        let (mut rest, mut events) = (&bytes[..], Vec::new());
        while !rest.is_empty() {
            let length = u64::from_le_bytes(rest[..8].try_into().unwrap()) as usize;
            assert_eq!(rest[8..12], masked(&rest[..8]));
            let data = &rest[12..12 + length];
            assert_eq!(rest[12 + length..16 + length], masked(data));
            events.push(Event::decode(data).unwrap());
            rest = &rest[16 + length..];
        }
        events
    }

    #[test]
    fn numbers_come_back_under_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = EventFile::begin(folder.path(), 40).unwrap();
        let row = serde_json::json!({ "update": 60, "gap": 0.5, "shares": { "state": 0.25 }, "note": "text",
            "probes": [{ "name": "position", "kind": "task", "latents": 0.75, "actions": 0.1 }] });
        file.append("held-out", 60, &row).unwrap();
        let events = read(&file.path);
        assert_eq!(events[0].file_version.as_deref(), Some("brain.Event:2"));
        assert_eq!((events[1].step, events[1].session_log.as_ref().unwrap().status), (41, 1));
        let values: Vec<(&str, f32)> =
            events[2].summary.as_ref().unwrap().value.iter().map(|v| (v.tag.as_str(), v.simple_value)).collect();
        assert_eq!(events[2].step, 60);
        assert_eq!(
            values,
            [("held-out/gap", 0.5), ("held-out/probes/position", 0.75), ("held-out/shares/state", 0.25)]
        );
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        // RFC 3720, B.4: 32 bytes of zeros have CRC-32C 8a9136aa.
        assert_eq!(crc32c::crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(masked(&[0; 32]), 0x8a91_36aa_u32.rotate_right(15).wrapping_add(0xa282_ead8).to_le_bytes());
    }
}
