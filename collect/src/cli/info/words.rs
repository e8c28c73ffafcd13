//! What a manifest says in JSON, in words. In: a recording, or its options. Out: the ends of lines of `info`.

use std::collections::BTreeSet;

use serde_json::Value;
use vibes_data::{EpisodeEntry, Manifest, Recording, Video};
use vibes_env::distractors::{Axes, DistractorSettings};

use crate::keys::{SUBSET, WHOLE};
use crate::sound::{planned_options, unplanned};

/// Of a longer list this many are named.
pub(super) const NAMED: usize = 8;

/// What kinds of distractors there are.
pub(super) fn distractors(options: &Value) -> String {
    let settings: Option<DistractorSettings> =
        options.get("distractors").and_then(|found| serde_json::from_value(found.clone()).ok());
    let Some(DistractorSettings { axes, difficulty, dynamic }) = settings else { return "unknown".to_owned() };
    if axes == Axes::NONE {
        return "none".to_owned();
    }
    let moves = if dynamic { "dynamic" } else { "static" };
    format!("{}; {difficulty}, {moves}", axes.names().join(", "))
}

/// Size and look of the pictures.
pub(super) fn pixels(manifest: &Manifest) -> String {
    let Some(size) = manifest.spec.pixels else { return "none".to_owned() };
    let look = manifest.options.get("look").and_then(Value::as_str);
    format!("{} x {} RGB{}", size.height, size.width, look.map_or_else(String::new, |look| format!(", {look} look")))
}

/// The videos by name, of many the first few, and of which set they are.
pub(super) fn videos(videos: &[Video]) -> String {
    let sets: BTreeSet<&str> = videos.iter().map(|video| video.set.as_str()).collect();
    let is_one_set = sets.len() == 1;
    let word = |video: &Video| {
        let set = if is_one_set { String::new() } else { format!(" of {}", video.set) };
        format!("{} ({} frames{set})", video.name, video.frames)
    };
    let named = first_few(videos.iter().map(word), "videos").join(", ");
    match sets.first() {
        None => "none".to_owned(),
        Some(set) if is_one_set => format!("{set}: {named}"),
        Some(_) => named,
    }
}

/// What a part says of the whole, and how it was chosen; none for what is whole itself.
pub(super) fn part_of(options: &Value) -> Option<String> {
    let note = options.get(SUBSET)?.as_object()?;
    let whole = note.get(WHOLE).and_then(Value::as_u64);
    let whole =
        whole.map_or_else(|| "another recording".to_owned(), |whole| format!("a recording of {whole} episodes"));
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let how = note.iter().filter(|(key, _)| !["verb", "of", WHOLE].contains(&key.as_str()));
    let how: Vec<String> = how.map(|(key, value)| format!("{} {}", key.replace('_', " "), plain(value))).collect();
    let verb = note.get("verb").and_then(Value::as_str).unwrap_or("unknown");
    Some(if how.is_empty() { format!("{whole}; {verb}") } else { format!("{whole}; {verb}: {}", how.join(", ")) })
}

/// How many episodes have a log.
pub(super) fn logs(episodes: &[EpisodeEntry]) -> String {
    match (episodes.iter().filter(|entry| entry.mcap.is_some()).count(), episodes.len()) {
        (0, _) => "none".to_owned(),
        (with, all) if with == all => "of every episode".to_owned(),
        (with, all) => format!("of {with} of {all} episodes"),
    }
}

/// How many episodes are listed whose files are not there, or cut off; none where all are.
pub(super) fn broken(recording: &Recording) -> Option<String> {
    let episodes = recording.episodes();
    let broken = episodes.iter().filter(|entry| !entry.has_its_files(recording.path())).count();
    let has = if broken == 1 { "has" } else { "have" };
    (broken > 0).then(|| format!("{broken} of {} {has} no whole file; verify says which", episodes.len()))
}

/// How many episodes are not those that were asked for; none where all are, or nobody asked.
pub(super) fn others(recording: &Recording) -> Option<String> {
    let options = planned_options(recording)?;
    let count = unplanned(recording, &options).len();
    let of = recording.episodes().len();
    (count > 0).then(|| format!("{count} of {of} episodes are not what its options ask for; verify says which"))
}

/// The first few of a list, and how many there are.
pub(super) fn first_few(list: impl ExactSizeIterator<Item = String>, what: &str) -> Vec<String> {
    let count = list.len();
    let more = (count > NAMED).then(|| format!("… {count} {what} in all"));
    list.take(NAMED).chain(more).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn options_are_said_in_words() {
        let axes = |background: bool| json!({ "background": background, "camera": background, "color": false });
        let of = |axes: Value| json!({ "distractors": { "axes": axes, "difficulty": "hard", "dynamic": false } });
        assert_eq!(distractors(&of(axes(true))), "background, camera; hard, static");
        assert_eq!(distractors(&of(axes(false))), "none");
        assert_eq!(distractors(&json!({})), "unknown");
        let note = json!({ "verb": "filter", "states": "1", "min_return": 3.5, "whole": 6, "of": { "verb": "split" } });
        let said = part_of(&json!({ "subset": note })).unwrap();
        assert_eq!(said, "a recording of 6 episodes; filter: min return 3.5, states 1");
        assert_eq!(part_of(&json!({ "subset": { "verb": "merge" } })).unwrap(), "another recording; merge");
        assert_eq!(part_of(&json!({})), None);
    }

    #[test]
    fn videos_say_their_set() {
        let video = |name: &str, set: &str| Video { name: name.into(), set: set.into(), frames: 9 };
        assert_eq!(videos(&[]), "none");
        assert_eq!(videos(&[video("a", "val"), video("b", "val")]), "val: a (9 frames), b (9 frames)");
        assert_eq!(videos(&[video("a", "train"), video("b", "val")]), "a (9 frames of train), b (9 frames of val)");
    }
}
