//! Videos from a folder: `DIR/<video>/<frame>.jpg`, as in DAVIS 2017, whose official train and validation lists are known by name.
//!
//! In: a folder. Out: the names of the videos of a set, and a video's frame files in the order people count. A folder most of whose videos have no DAVIS name is
//! used as it is: all its sub-folders, of which the first half is for training. Helper files of operating systems and editors are no videos and no frames.

use std::path::{Path, PathBuf};

use super::{VideoSet, picture};
use crate::error::{Error, Result};
use crate::names;

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

/// Frames of the first videos of both lists in DAVIS 2017, by which its own films are told from others of the same names.
pub const FIRST_FRAMES: [(&str, usize); 8] = [
    ("bear", 82),
    ("bmx-bumps", 90),
    ("boat", 75),
    ("boxing-fisheye", 87),
    ("bike-packing", 69),
    ("blackswan", 50),
    ("bmx-trees", 80),
    ("breakdance", 84),
];

/// The videos of one set of a folder.
#[derive(Debug)]
pub(super) struct Listed {
    /// Their names.
    pub(super) names: Vec<String>,
    /// What they are, for an error that counts them.
    pub(super) what: &'static str,
}

/// The videos of one set of `folder`, in the order in which the suite takes them: those of the official list if most videos of the folder are of either official
/// list, else half of the sub-folders that hold frames, in the order people count. One name alone, such as `train` or `dog`, makes no DAVIS of a folder of one's own, of
/// which it would be all that is left. Whoever trains under one set and whoever is evaluated under the other do not know each other's number of videos, so that only a
/// fixed half keeps the two apart; the middle one of an odd number is for training.
///
/// # Errors
/// When the folder cannot be read, or is official and holds none of the videos asked for: those of the other set must not stand in for them.
pub(super) fn list(folder: &Path, set: VideoSet) -> Result<Listed> {
    let holds_frames = |name: &str| frames(folder, name).is_ok();
    let folders = names::listed(folder)?.into_iter().filter(|path| path.is_dir());
    let named = folders.filter_map(|path| path.file_name()?.to_str().map(str::to_owned));
    let mut names: Vec<String> = named.filter(|name| is_official(name) || holds_frames(name)).collect();
    if 2 * names.iter().filter(|name| is_official(name)).count() > names.len() {
        return list_official(folder, set);
    }
    names.retain(|name| !is_official(name) || holds_frames(name));
    let held_out = names.split_off(names.len().div_ceil(2));
    Ok(match set {
        VideoSet::Train => Listed { names, what: "train videos (the first half of the folder)" },
        VideoSet::Val => Listed { names: held_out, what: "val videos (the second half of the folder)" },
    })
}

/// Whether a video is of either official list.
fn is_official(name: &str) -> bool {
    TRAIN.contains(&name) || VAL.contains(&name)
}

fn list_official(folder: &Path, set: VideoSet) -> Result<Listed> {
    let of = |set: VideoSet| -> Vec<String> {
        let official: &[&str] = match set {
            VideoSet::Train => &TRAIN,
            VideoSet::Val => &VAL,
        };
        official.iter().filter(|name| folder.join(name).is_dir()).map(|name| (*name).to_owned()).collect()
    };
    let (train, val) = (of(VideoSet::Train), of(VideoSet::Val));
    let (asked, other) = match set {
        VideoSet::Train => (train, val),
        VideoSet::Val => (val, train),
    };
    if !asked.is_empty() {
        let what = match set {
            VideoSet::Train => "official train videos of DAVIS",
            VideoSet::Val => "official val videos of DAVIS",
        };
        return Ok(Listed { names: asked, what });
    }
    let first = other.first().map_or("none", String::as_str);
    let fact = format!("no official {set} video of DAVIS, but {} of the other set ({first} …)", other.len());
    let expected = "a folder that holds some, since the videos of one set do not stand in for those of the other";
    Err(Error::malformed(folder, fact, expected))
}

/// The frame files of a video, in the order people count: `2.png` before `10.png`.
pub(super) fn frames(folder: &Path, video: &str) -> Result<Vec<PathBuf>> {
    let path = folder.join(video);
    let mut files = names::listed(&path)?;
    files.retain(|file| {
        let extension = file.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        matches!(extension.as_deref(), Some("jpg" | "jpeg" | "png")) && file.is_file()
    });
    if files.is_empty() {
        return Err(Error::malformed(path, "a video without frames", "a video is a folder of .jpg or .png files"));
    }
    Ok(files)
}

/// Decodes a frame: RGB, width, height.
pub(super) fn decode(file: &Path) -> Result<(Vec<u8>, usize, usize)> {
    let bytes = std::fs::read(file).map_err(Error::io("read the frame", file))?;
    picture::decode(&bytes).map_err(|fact| Error::malformed(file, fact, "frames are whole .jpg or .png files"))
}
