//! The cache of decoded videos: every frame, resized, with its mipmap levels, in one file a video.
//!
//! In: a video as a description that names its contents, and its pictures one by one. Out: any frame, as the bytes the renderer uploads. The
//! file lies in the user's cache folder, is made once and found again by later runs; frames are read from it on demand,
//! so that memory does not grow with the number of videos.

use std::fs::File;
use std::hash::{BuildHasher, RandomState};
use std::io::{BufWriter, ErrorKind, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use vibes_data::sha256_hex;

use super::resample::halve;
use crate::error::{Error, Result};

/// Levels kept of a frame: its side, half of it, a quarter of it.
pub(crate) const LEVELS: usize = 3;
/// Changes whenever the bytes of a cache file would.
const VERSION: u32 = 1;
/// How many names are tried for a file that nobody else writes. They are random, so that a second one is hardly ever needed.
const NAMES_TRIED: usize = 8;

/// Bytes of one frame with all its levels.
pub(crate) fn frame_bytes(side: usize) -> usize {
    (0..LEVELS).map(|level| 3 * (side >> level) * (side >> level)).sum()
}

/// One video's frames.
#[derive(Debug)]
pub(super) struct FrameStore {
    path: PathBuf,
    pub(super) frames: usize,
    side: usize,
    /// The file, where it is kept open; else it is opened for every frame.
    pub(super) file: Option<File>,
}

impl FrameStore {
    /// Where the video described by `identity` (everything its pictures depend on) is in the cache, or will be.
    pub(super) fn of(folder: &Path, name: &str, identity: &str, frames: usize, side: usize) -> Self {
        // A checksum, since a hasher of the standard library may be another in the next release of Rust, and every cached video would be made again.
        let contents = sha256_hex(format!("{VERSION}\n{frames}\n{side}\n{identity}").as_bytes());
        let plain: String = name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
        let path = folder.join(format!("{plain}-{side}-{}.frames", &contents[..16]));
        Self { path, frames, side, file: None }
    }

    /// Whether the video is there, with all its frames.
    pub(super) fn is_whole(&self) -> bool {
        let whole = (self.frames * frame_bytes(self.side)) as u64;
        self.path.metadata().is_ok_and(|metadata| metadata.len() == whole)
    }

    /// Makes the video from `picture(frame)`, `[side, side, 3]`.
    pub(super) fn make(&self, mut picture: impl FnMut(usize) -> Result<Vec<u8>>) -> Result<()> {
        let frames = (0..self.frames).map(|frame| picture(frame).map(|rgb| with_levels(rgb, self.side)));
        // Whoever else made the same video meanwhile made the same bytes.
        write_whole(&self.path, frames).or_else(|error| if self.is_whole() { Ok(()) } else { Err(error) })
    }

    /// Keeps the file open, so that its frames can be read even when somebody clears the cache.
    pub(super) fn keep_open(&mut self) -> Result<()> {
        self.file = Some(self.open()?);
        Ok(())
    }

    /// Reads a frame and its levels into `bytes`.
    pub(super) fn read(&self, frame: usize, bytes: &mut Vec<u8>) -> Result<()> {
        let opened;
        let file = match &self.file {
            Some(file) => file,
            None => {
                opened = self.open()?;
                &opened
            }
        };
        let length = frame_bytes(self.side);
        bytes.resize(length, 0);
        file.read_exact_at(bytes, (frame * length) as u64).map_err(Error::io("read the cached video", &self.path))
    }

    fn open(&self) -> Result<File> {
        File::open(&self.path).map_err(Error::io("open the cached video", &self.path))
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
    let (file, partial) =
        create(|own| path.with_extension(format!("{own}.partial"))).map_err(Error::io("cache the video", path))?;
    let written = write_frames(file, &partial, frames)
        .and_then(|()| std::fs::rename(&partial, path).map_err(Error::io("keep the cached video", path)));
    if written.is_err() {
        // What is half written is of no use to anyone; that it may already be gone does not matter.
        let _ = std::fs::remove_file(&partial);
    }
    written
}

fn write_frames(file: File, path: &Path, frames: impl Iterator<Item = Result<Vec<u8>>>) -> Result<()> {
    let mut file = BufWriter::new(file);
    for frame in frames {
        file.write_all(&frame?).map_err(Error::io("cache the video", path))?;
    }
    file.flush().map_err(Error::io("cache the video", path))
}

/// Creates a file that nobody else has, under the path that `named` makes of a random word. The number of the process would not do: in two containers that share
/// the cache two processes may have the same one.
fn create(named: impl Fn(&str) -> PathBuf) -> std::io::Result<(File, PathBuf)> {
    let attempt = || {
        // The number tells apart processes that were forked, whose random numbers are the same.
        let path = named(&format!("{:016x}", RandomState::new().hash_one(std::process::id())));
        File::create_new(&path).map(|file| (file, path))
    };
    let is_taken = |created: &std::io::Result<(File, PathBuf)>| {
        created.as_ref().is_err_and(|error| error.kind() == ErrorKind::AlreadyExists)
    };
    let mut created = attempt();
    for _ in 1..NAMES_TRIED {
        if !is_taken(&created) {
            break;
        }
        created = attempt();
    }
    created
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

/// That files can be made in a folder.
fn probe(folder: &Path) -> std::io::Result<()> {
    let (_file, path) = create(|own| folder.join(format!(".{own}.probe")))?;
    std::fs::remove_file(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every byte of every frame is its number.
    fn plain(side: usize) -> impl Fn(usize) -> Result<Vec<u8>> {
        move |frame| Ok(vec![frame as u8; 3 * side * side])
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    fn assert_readable(store: &FrameStore) {
        let mut bytes = Vec::new();
        for frame in 0..store.frames {
            store.read(frame, &mut bytes).unwrap();
            assert!(bytes.iter().all(|&byte| byte == frame as u8), "frame {frame}");
        }
    }

    #[test]
    fn a_video_is_made_once_and_read_open_or_closed() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = FrameStore::of(folder.path(), "a film", "its contents", 3, 8);
        assert!(!store.is_whole());
        store.make(plain(8)).unwrap();
        assert!(store.is_whole() && FrameStore::of(folder.path(), "a film", "its contents", 3, 8).is_whole());
        assert!(!FrameStore::of(folder.path(), "a film", "other contents", 3, 8).is_whole());
        assert_readable(&store);
        store.keep_open().unwrap();
        std::fs::remove_file(&files(folder.path())[0]).unwrap();
        assert_readable(&store);
    }

    /// A process of the same number, in a container that shares the cache, is in the middle of its files.
    #[test]
    fn files_of_a_process_of_the_same_number_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let store = FrameStore::of(folder.path(), "film", "contents", 2, 8);
        let process = std::process::id();
        let of_another = |number: u32| store.path.with_extension(format!("{process}-{number}.partial"));
        (0..100).for_each(|number| std::fs::write(of_another(number), b"half a film").unwrap());
        store.make(plain(8)).unwrap();
        assert_readable(&store);
        assert!((0..100).all(|number| std::fs::read(of_another(number)).unwrap() == b"half a film"));
        let (_, taken) = create(|own| folder.path().join(own)).unwrap();
        assert_eq!(create(|_| taken.clone()).unwrap_err().kind(), ErrorKind::AlreadyExists);
        let thread = std::thread::current().id();
        let probed = folder.path().join(format!(".{process}-{thread:?}.probe"));
        std::fs::write(&probed, b"").unwrap();
        probe(folder.path()).unwrap();
        assert!(probed.exists(), "another's probe is its own to remove");
    }

    #[test]
    fn a_video_that_another_has_made_meanwhile_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let store = FrameStore::of(folder.path(), "film", "contents", 2, 8);
        let another = FrameStore::of(folder.path(), "film", "contents", 2, 8);
        let and_then = |frame: usize| {
            if frame == 1 {
                // Whoever clears what looks half written takes ours, so that it cannot be renamed.
                files(folder.path()).iter().for_each(|file| std::fs::remove_file(file).unwrap());
                another.make(plain(8))?;
            }
            plain(8)(frame)
        };
        store.make(and_then).unwrap();
        assert_readable(&store);
        assert_eq!(files(folder.path()), std::slice::from_ref(&store.path));
        let failing = FrameStore::of(folder.path(), "film", "of which no frame can be read", 2, 8);
        assert!(failing.make(|_| Err(Error::Stopped)).is_err());
        assert_eq!(files(folder.path()), [store.path], "nothing half written is left");
    }
}
