//! What of a grid is new beside what was trained or fitted on: its episodes, where its states begin, its background videos. In: a grid and recordings. Out: whether it is, or how many are.

use std::collections::HashSet;

use serde_json::Value;
use vibes_data::{EpisodeEntry, Recording, Video, is_same_place};
use vibes_env::videos::VideoSource;

use crate::run::Seen;

/// Whether a grid is new beside the recordings that something is fitted on: none of them under whatever path, and no episode of theirs in a copy. Other views of its states may be among
/// them: [`shared_starts`] counts those. So may its background videos: [`videos_of`] names those.
pub fn is_held_out(grid: &Recording, training: &[Recording]) -> bool {
    let files: HashSet<&str> = grid.episodes().iter().map(|entry| entry.arrow.sha256.as_str()).collect();
    let is_of_the_grid = |entry: &EpisodeEntry| files.contains(entry.arrow.sha256.as_str());
    !training.iter().any(|recording| {
        is_same_place(recording.path(), grid.path()) || recording.episodes().iter().any(is_of_the_grid)
    })
}

/// Whether a grid is new to a run; not known where some of what it learned from is gone and none of the rest is the grid's.
pub fn is_new_to(grid: &Recording, seen: &Seen) -> Option<bool> {
    let is_new = is_held_out(grid, &seen.recordings);
    (!is_new || seen.is_whole).then_some(is_new)
}

/// State trajectories of a grid that begin where an episode of these recordings began, by the seed that both were simulated with, and how many it has. Policies that draw nothing live
/// through the same states from there.
pub fn shared_starts(grid: &Recording, training: &[Recording]) -> (usize, usize) {
    let task = |recording: &Recording| recording.manifest().spec.task.clone();
    let alike = training.iter().filter(|recording| task(recording) == task(grid));
    let seeds: HashSet<u64> = alike.flat_map(|recording| recording.episodes()).map(|entry| entry.seed).collect();
    let own: HashSet<u64> = grid.episodes().iter().map(|entry| entry.seed).collect();
    (own.intersection(&seeds).count(), own.len())
}

/// The background videos of a grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GridVideos {
    /// How many it has.
    pub all: usize,
    /// Those that are among the videos of other recordings.
    pub known: Vec<Video>,
}

/// The background videos of a grid beside those of other recordings: known are those of the same name and the same source.
pub fn videos_of(grid: &Recording, training: &[Recording]) -> GridVideos {
    let seen: Vec<(VideoSource, Video)> = training.iter().flat_map(films).collect();
    let mut own: Vec<(VideoSource, Video)> = Vec::new();
    for film in films(grid) {
        // Parts of a merged recording may share theirs.
        if !own.contains(&film) {
            own.push(film);
        }
    }
    let all = own.len();
    let is_known = |source: &VideoSource, film: &Video| {
        seen.iter().any(|(other, known)| known.name == film.name && source.has_film(known, other))
    };
    let known = own.into_iter().filter(|(source, film)| is_known(source, film)).map(|(_, film)| film).collect();
    GridVideos { all, known }
}

/// Whether the background videos of a grid are new to a run, all of them; none of a grid without any, and where some of what the run learned from is gone and none of the rest shows one.
pub fn are_videos_new_to(grid: &Recording, seen: &Seen) -> Option<bool> {
    let videos = videos_of(grid, &seen.recordings);
    match (videos.all, videos.known.is_empty()) {
        (0, _) => None,
        (_, false) => Some(false),
        (_, true) => seen.is_whole.then_some(true),
    }
}

/// The videos of a recording and where they come from, which every part of a merged one says of its own.
pub(crate) fn films(recording: &Recording) -> Vec<(VideoSource, Video)> {
    let manifest = recording.manifest();
    let sourced = |options: &Value, videos: Vec<Video>| -> Vec<(VideoSource, Video)> {
        let source: Option<VideoSource> = serde_json::from_value(options["videos"].clone()).ok();
        let Some(source) = source.map(|source| source.found(recording.path())) else { return Vec::new() };
        videos.into_iter().map(|video| (source.clone(), video)).collect()
    };
    let Some(parts) = manifest.options["merged"].as_array() else {
        return sourced(&manifest.options, manifest.videos.clone());
    };
    let of_part = |part: &Value| {
        let places = part["videos"].as_array().into_iter().flatten().filter_map(Value::as_u64);
        let videos = places.filter_map(|place| manifest.videos.get(usize::try_from(place).ok()?).cloned());
        sourced(&part["options"], videos.collect())
    };
    parts.iter().flat_map(of_part).collect()
}
