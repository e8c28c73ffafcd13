//! An MP4 file (ISO/IEC 14496-12 and -15) with one H.264 track, every sample of one length and a key frame.
//!
//! In: the parameter sets and one NAL unit a picture. Out: the file; samples are written as they come, so that memory does not follow the video's length,
//! and the tables that find them stand at the end.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use vibes_data::ImageSize;

use super::make_parent;
use crate::error::{Error, Result};

/// An open MP4 file.
pub(super) struct Mp4Writer {
    path: PathBuf,
    file: BufWriter<File>,
    size: ImageSize,
    clock: Clock,
    parameters: [Vec<u8>; 2],
    /// Bytes of every sample.
    samples: Vec<u32>,
    /// Bytes written so far.
    written: u64,
}

/// Ticks a second, and ticks a picture.
#[derive(Clone, Copy)]
struct Clock {
    scale: u32,
    tick: u32,
}

/// Where the bytes of the samples begin: after `ftyp` and the head of a `mdat` of 64-bit size.
const SAMPLES_AT: u64 = 32 + 16;

impl Mp4Writer {
    /// Begins a file.
    pub(super) fn create(path: &Path, size: ImageSize, seconds: f64, sps: &[u8], pps: &[u8]) -> Result<Self> {
        make_parent(path)?;
        let file = File::create(path).map_err(Error::io("create", path))?;
        let mut writer = Self {
            path: path.to_owned(),
            file: BufWriter::new(file),
            size,
            clock: clock(seconds),
            parameters: [sps.to_vec(), pps.to_vec()],
            samples: Vec::new(),
            written: 0,
        };
        let brands: [&[u8]; 6] = [b"isom", &[0, 0, 2, 0], b"isom", b"iso2", b"avc1", b"mp41"];
        writer.put(&boxed(b"ftyp", &brands.concat()))?;
        // Size 1 says that the real size follows in 64 bits; it is filled in at the end.
        writer.put(&[&[0, 0, 0, 1], &b"mdat"[..], &[0; 8]].concat())?;
        Ok(writer)
    }

    /// Appends one picture's NAL unit.
    pub(super) fn push(&mut self, unit: &[u8]) -> Result<()> {
        let length = u32::try_from(unit.len()).unwrap_or(u32::MAX);
        self.put(&length.to_be_bytes())?;
        self.put(unit)?;
        self.samples.push(length + 4);
        Ok(())
    }

    /// Bytes written so far.
    pub(super) fn bytes(&self) -> u64 {
        self.written
    }

    /// Writes the tables and the samples' total size.
    pub(super) fn finish(mut self) -> Result<()> {
        let size = self.written - (SAMPLES_AT - 16);
        let tables = self.movie();
        self.put(&tables)?;
        let fill = |file: &mut BufWriter<File>| -> std::io::Result<()> {
            file.seek(SeekFrom::Start(SAMPLES_AT - 8))?;
            file.write_all(&size.to_be_bytes())?;
            file.flush()
        };
        fill(&mut self.file).map_err(Error::io("write", &self.path))
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.written += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::io("write", &self.path))
    }

    fn movie(&self) -> Vec<u8> {
        let duration = (self.samples.len() as u32).saturating_mul(self.clock.tick);
        let clock = [0, 0, self.clock.scale, duration];
        // Rate 1, volume, the unit matrix, and the number of the next track.
        let header = [
            numbers(&[0]),
            numbers(&clock),
            numbers(&[0x1_0000, 0x100_0000, 0, 0]),
            matrix(),
            numbers(&[0; 6]),
            numbers(&[2]),
        ];
        boxed(b"moov", &[boxed(b"mvhd", &header.concat()), self.track(duration)].concat())
    }

    fn track(&self, duration: u32) -> Vec<u8> {
        // Flags 3: enabled, in the movie. The sides are 16.16 fixed point.
        let ImageSize { height, width } = self.size;
        let header =
            [numbers(&[3, 0, 0, 1, 0, duration]), numbers(&[0; 4]), matrix(), numbers(&[width << 16, height << 16])];
        let media_header = numbers(&[0, 0, 0, self.clock.scale, duration, 0x55C4_0000]);
        let handler = [numbers(&[0, 0]), b"vide".to_vec(), numbers(&[0; 3]), b"pictures\0".to_vec()];
        let reference = [numbers(&[0, 1]), boxed(b"url ", &numbers(&[1]))].concat();
        let information = [
            boxed(b"vmhd", &numbers(&[1, 0, 0])),
            boxed(b"dinf", &boxed(b"dref", &reference)),
            boxed(b"stbl", &self.sample_table()),
        ];
        let media =
            [boxed(b"mdhd", &media_header), boxed(b"hdlr", &handler.concat()), boxed(b"minf", &information.concat())];
        boxed(b"trak", &[boxed(b"tkhd", &header.concat()), boxed(b"mdia", &media.concat())].concat())
    }

    /// One chunk holds all samples; without an `stss` box every one of them is a key frame.
    fn sample_table(&self) -> Vec<u8> {
        let count = self.samples.len() as u32;
        let description = [numbers(&[0, 1]), self.sample_entry()].concat();
        let sizes = [numbers(&[0, 0, count]), numbers(&self.samples)].concat();
        let chunk = [numbers(&[0, 1]), SAMPLES_AT.to_be_bytes().to_vec()].concat();
        [
            boxed(b"stsd", &description),
            boxed(b"stts", &numbers(&[0, 1, count, self.clock.tick])),
            boxed(b"stsc", &numbers(&[0, 1, 1, count, 1])),
            boxed(b"stsz", &sizes),
            boxed(b"co64", &chunk),
        ]
        .concat()
    }

    fn sample_entry(&self) -> Vec<u8> {
        let [sps, pps] = &self.parameters;
        let sides = [(self.size.width as u16).to_be_bytes(), (self.size.height as u16).to_be_bytes()].concat();
        // 72 dots an inch, one picture a sample, no compressor's name, 24 bits, no colour table.
        let rest = [numbers(&[0x48_0000, 0x48_0000, 0]), vec![0, 1], vec![0; 32], vec![0, 24, 0xFF, 0xFF]].concat();
        let length = |bytes: &[u8]| (bytes.len() as u16).to_be_bytes();
        // Profile, compatibility and level stand after the first byte of the parameter set; lengths of units have four bytes.
        let profile = sps.get(1..4).unwrap_or(&[66, 0, 10]);
        let configuration =
            [&[1], profile, &[0xFF, 0xE1], &length(sps), sps.as_slice(), &[1], &length(pps), pps.as_slice()].concat();
        let head = [&[0; 6][..], &[0, 1], &[0; 16]].concat();
        boxed(b"avc1", &[head, sides, rest, boxed(b"avcC", &configuration)].concat())
    }
}

/// Ticks that give the pictures' time exactly where 90 kHz can, else microseconds.
fn clock(seconds: f64) -> Clock {
    let exact = [90_000_u32, 1_000_000].into_iter().find(|&scale| {
        let ticks = seconds * f64::from(scale);
        (ticks - ticks.round()).abs() < 1e-6
    });
    let scale = exact.unwrap_or(1_000_000);
    Clock { scale, tick: (seconds * f64::from(scale)).round().clamp(1.0, f64::from(u32::MAX)) as u32 }
}

fn boxed(name: &[u8; 4], contents: &[u8]) -> Vec<u8> {
    let size = (contents.len() as u32 + 8).to_be_bytes();
    [&size[..], name, contents].concat()
}

fn numbers(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_be_bytes()).collect()
}

/// No rotation, no scaling.
fn matrix() -> Vec<u8> {
    numbers(&[0x1_0000, 0, 0, 0, 0x1_0000, 0, 0, 0, 0x4000_0000])
}
