//! Whether the recording that lies in a folder is the one that is asked for. In: two manifests. Out: the first thing that differs, in words.

use std::path::Path;

use crate::{Error, Manifest, Result, Video};

/// Of a longer list of videos this many are named.
const NAMED: usize = 8;

/// Compares everything but the episodes.
pub(super) fn same_request(path: &Path, found: &Manifest, asked: &Manifest) -> Result<()> {
    let as_map = |manifest: &Manifest| -> serde_json::Map<String, serde_json::Value> {
        let header = Manifest { episodes: Vec::new(), videos: Vec::new(), ..manifest.clone() };
        match serde_json::to_value(header) {
            Ok(serde_json::Value::Object(map)) => map,
            _ => serde_json::Map::new(),
        }
    };
    if let Some((key, found, asked)) = first_difference("", &as_map(found), &as_map(asked)) {
        return Err(Error::OtherRecording { key, found, asked, path: path.into() });
    }
    if found.videos == asked.videos {
        return Ok(());
    }
    // Where the names are the same, something else is not.
    let names = |videos: &[Video]| -> Vec<String> { videos.iter().map(|video| video.name.clone()).collect() };
    let only_names = names(&found.videos) != names(&asked.videos);
    let [found, asked] = [found, asked].map(|manifest| in_words(&manifest.videos, only_names));
    Err(Error::OtherVideos { found, asked, path: path.into() })
}

/// The first few videos of a list, and how many there are.
fn in_words(videos: &[Video], only_names: bool) -> String {
    let word = |video: &Video| {
        if only_names {
            return video.name.clone();
        }
        format!("{} ({} {} frames)", video.name, video.frames, video.set)
    };
    let mut words: Vec<String> = videos.iter().take(NAMED).map(word).collect();
    if videos.len() > NAMED {
        words.push(format!("… {} in all", videos.len()));
    }
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

fn first_difference(
    prefix: &str,
    found: &serde_json::Map<String, serde_json::Value>,
    asked: &serde_json::Map<String, serde_json::Value>,
) -> Option<(String, String, String)> {
    use serde_json::Value;
    let keys = asked.keys().chain(found.keys().filter(|key| !asked.contains_key(*key)));
    keys.into_iter().find_map(|key| {
        let (left, right) = (found.get(key).unwrap_or(&Value::Null), asked.get(key).unwrap_or(&Value::Null));
        match (left, right) {
            (left, right) if left == right => None,
            (Value::Object(left), Value::Object(right)) => first_difference(&format!("{prefix}{key}."), left, right),
            (left, right) => Some((format!("{prefix}{key}"), left.to_string(), right.to_string())),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_videos_the_first_few_are_named() {
        let video = |name: String| Video { name, set: "train".into(), frames: 9 };
        let videos: Vec<Video> = (0..30).map(|number| video(format!("f{number}"))).collect();
        assert_eq!(in_words(&videos[..2], true), "f0, f1");
        assert_eq!(in_words(&videos, true), "f0, f1, f2, f3, f4, f5, f6, f7, … 30 in all");
        assert_eq!(in_words(&videos[..1], false), "f0 (9 train frames)");
        assert_eq!(in_words(&[], true), "none");
    }
}
