//! The cache of decoded videos: every frame, resized, with its mipmap levels, in one file a video.
//!
//! In: a video as a description that names its contents, and its pictures one by one. Out: any frame, as the bytes the renderer uploads. The
//! file lies in the user's cache folder, is made once and found again by later runs; frames are read from it on demand,
//! so that memory does not grow with the number of videos.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use vibes_data::sha256_hex;

use super::resample::halve;
use crate::error::{Error, Result};

/// Levels kept of a frame: its side, half of it, a quarter of it.
pub(crate) const LEVELS: usize = 3;
/// Changes whenever the bytes of a cache file would.
const VERSION: u32 = 1;

/// Bytes of one frame with all its levels.
pub(crate) fn frame_bytes(side: usize) -> usize {
    (0..LEVELS).map(|level| 3 * (side >> level) * (side >> level)).sum()
}

/// One video's frames.
#[derive(Debug)]
pub(super) struct FrameStore {
    file: File,
    path: PathBuf,
    pub(super) frames: usize,
    side: usize,
}

impl FrameStore {
    /// Opens the video described by `identity` (everything its pictures depend on), or makes it from `picture(frame)`, `[side, side, 3]`.
    pub(super) fn open_or_make(
        folder: &Path,
        name: &str,
        identity: &str,
        frames: usize,
        side: usize,
        mut picture: impl FnMut(usize) -> Result<Vec<u8>>,
    ) -> Result<Self> {
        // A checksum, since a hasher of the standard library may be another in the next release of Rust, and every cached video would be made again.
        let contents = sha256_hex(format!("{VERSION}\n{frames}\n{side}\n{identity}").as_bytes());
        let plain: String = name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
        let path = folder.join(format!("{plain}-{side}-{}.frames", &contents[..16]));
        let whole = (frames * frame_bytes(side)) as u64;
        if !path.metadata().is_ok_and(|metadata| metadata.len() == whole) {
            write_whole(&path, (0..frames).map(|frame| picture(frame).map(|rgb| with_levels(rgb, side))))?;
        }
        let file = File::open(&path).map_err(Error::io("open the cached video", &path))?;
        Ok(Self { file, path, frames, side })
    }

    /// Reads a frame and its levels into `bytes`.
    pub(super) fn read(&self, frame: usize, bytes: &mut Vec<u8>) -> Result<()> {
        let length = frame_bytes(self.side);
        bytes.resize(length, 0);
        self.file.read_exact_at(bytes, (frame * length) as u64).map_err(Error::io("read the cached video", &self.path))
    }
}

/// Appends half and quarter size.
fn with_levels(mut rgb: Vec<u8>, side: usize) -> Vec<u8> {
    let mut start = 0;
    for level in 1..LEVELS {
        let half = halve(&rgb[start..], side >> (level - 1));
        start = rgb.len();
        rgb.extend(half);
    }
    rgb
}

/// Writes beside the path and renames, so that a file is there whole or not at all, whoever else writes it.
fn write_whole(path: &Path, frames: impl Iterator<Item = Result<Vec<u8>>>) -> Result<()> {
    static WRITERS: AtomicU32 = AtomicU32::new(0);
    let writer = WRITERS.fetch_add(1, Ordering::Relaxed);
    let partial = path.with_extension(format!("{}-{writer}.partial", std::process::id()));
    let written = write_frames(&partial, frames)
        .and_then(|()| std::fs::rename(&partial, path).map_err(Error::io("keep the cached video", path)));
    if written.is_err() {
        // What is half written is of no use to anyone; that it may already be gone does not matter.
        let _ = std::fs::remove_file(&partial);
    }
    written
}

fn write_frames(path: &Path, frames: impl Iterator<Item = Result<Vec<u8>>>) -> Result<()> {
    let mut file = BufWriter::new(File::create(path).map_err(Error::io("cache the video", path))?);
    for frame in frames {
        file.write_all(&frame?).map_err(Error::io("cache the video", path))?;
    }
    file.flush().map_err(Error::io("cache the video", path))
}

/// The folder for cached videos, made if missing: `$XDG_CACHE_HOME/vibes/videos`, `~/.cache/vibes/videos`, or a temporary one.
pub(super) fn cache_folder() -> Result<PathBuf> {
    let from = |variable: &str| std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let bases = [from("XDG_CACHE_HOME"), from("HOME").map(|home| home.join(".cache")), Some(std::env::temp_dir())];
    let mut refusal = None;
    for folder in bases.into_iter().flatten().map(|base| base.join("vibes/videos")) {
        match std::fs::create_dir_all(&folder).and_then(|()| probe(&folder)) {
            Ok(()) => return Ok(folder),
            Err(cause) => refusal = Some((cause, folder)),
        }
    }
    let (cause, path) = refusal.unwrap_or_else(|| (std::io::Error::other("no cache folder"), std::env::temp_dir()));
    Err(Error::Io { action: "make a folder for decoded videos", cause, path })
}

fn probe(folder: &Path) -> std::io::Result<()> {
    let path = folder.join(format!(".{}-{:?}.probe", std::process::id(), std::thread::current().id()));
    File::create(&path)?;
    std::fs::remove_file(path)
}
