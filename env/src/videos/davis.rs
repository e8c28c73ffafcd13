//! Videos from a folder: `DIR/<video>/<frame>.jpg`, as in DAVIS 2017, whose official train and validation lists are known by name.
//!
//! In: a folder. Out: the names of its videos, and a video's frame files in sorted order. A folder without the DAVIS names
//! is used as it is: all its sub-folders, sorted.

use std::path::{Path, PathBuf};

use super::VideoSet;
use crate::error::{Error, Result};

/// The official training list. The suite takes the first 4, 8 or all.
pub const TRAIN: [&str; 60] = [
    "bear",
    "bmx-bumps",
    "boat",
    "boxing-fisheye",
    "breakdance-flare",
    "bus",
    "car-turn",
    "cat-girl",
    "classic-car",
    "color-run",
    "crossing",
    "dance-jump",
    "dancing",
    "disc-jockey",
    "dog-agility",
    "dog-gooses",
    "dogs-scale",
    "drift-turn",
    "drone",
    "elephant",
    "flamingo",
    "hike",
    "hockey",
    "horsejump-low",
    "kid-football",
    "kite-walk",
    "koala",
    "lady-running",
    "lindy-hop",
    "longboard",
    "lucia",
    "mallard-fly",
    "mallard-water",
    "miami-surf",
    "motocross-bumps",
    "motorbike",
    "night-race",
    "paragliding",
    "planes-water",
    "rallye",
    "rhino",
    "rollerblade",
    "schoolgirls",
    "scooter-board",
    "scooter-gray",
    "sheep",
    "skate-park",
    "snowboard",
    "soccerball",
    "stroller",
    "stunt",
    "surf",
    "swing",
    "tennis",
    "tractor-sand",
    "train",
    "tuk-tuk",
    "upside-down",
    "varanus-cage",
    "walking",
];

/// The official validation list.
pub const VAL: [&str; 30] = [
    "bike-packing",
    "blackswan",
    "bmx-trees",
    "breakdance",
    "camel",
    "car-roundabout",
    "car-shadow",
    "cows",
    "dance-twirl",
    "dog",
    "dogs-jump",
    "drift-chicane",
    "drift-straight",
    "goat",
    "gold-fish",
    "horsejump-high",
    "india",
    "judo",
    "kite-surf",
    "lab-coat",
    "libby",
    "loading",
    "mbike-trick",
    "motocross-jump",
    "paragliding-launch",
    "parkour",
    "pigs",
    "scooter-black",
    "shooting",
    "soapbox",
];

/// The videos of `folder`, in the order in which the suite takes them: the official list if the folder has the first video of either list,
/// else every sub-folder that holds frames, sorted.
pub(super) fn list(folder: &Path, set: VideoSet) -> Result<Vec<String>> {
    let official: &[&str] = match set {
        VideoSet::Train => &TRAIN,
        VideoSet::Val => &VAL,
    };
    if folder.join(TRAIN[0]).is_dir() || folder.join(VAL[0]).is_dir() {
        let present = official.iter().filter(|name| folder.join(name).is_dir());
        return Ok(present.map(|name| (*name).to_owned()).collect());
    }
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("read the videos", folder))? {
        let entry = entry.map_err(Error::io("read the videos", folder))?;
        if let (true, Ok(name)) = (entry.path().is_dir(), entry.file_name().into_string()) {
            names.push(name);
        }
    }
    names.sort();
    names.retain(|name| frames(folder, name).is_ok());
    Ok(names)
}

/// The frame files of a video, sorted by name.
pub(super) fn frames(folder: &Path, video: &str) -> Result<Vec<PathBuf>> {
    let path = folder.join(video);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(&path).map_err(Error::io("read the video", &path))? {
        let file = entry.map_err(Error::io("read the video", &path))?.path();
        let extension = file.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        if matches!(extension.as_deref(), Some("jpg" | "jpeg" | "png")) {
            files.push(file);
        }
    }
    if files.is_empty() {
        return Err(Error::malformed(path, "a video without frames", "a video is a folder of .jpg or .png files"));
    }
    files.sort();
    Ok(files)
}

/// Decodes a frame: RGB, width, height.
pub(super) fn decode(file: &Path) -> Result<(Vec<u8>, usize, usize)> {
    let bytes = std::fs::read(file).map_err(Error::io("read the frame", file))?;
    let picture = image::load_from_memory(&bytes)
        .map_err(|error| {
            Error::malformed(file, format!("not a readable picture ({error})"), "frames are .jpg or .png files")
        })?
        .into_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    if width == 0 || height == 0 {
        return Err(Error::malformed(file, "an empty picture", "frames have at least one pixel"));
    }
    Ok((picture.into_raw(), width, height))
}
