//! Episodes that several of the recordings to be merged hold, as those do that overlap, or that one was made of another: each is to be there once. In: the recordings, and where
//! their videos are in the merged list. Out: for every recording the numbers of its episodes that one before it holds too, and an episode as the merged recording has it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::AtomicBool;

use vibes_data::{BackgroundFrame, Episode, EpisodeEntry, Recording};

use crate::care::go_on;
use crate::error::{Error, Result};
use crate::sound::check_intact;

/// What two entries of one episode have in common, whatever its number. Those alone are read that have it with an episode of another recording.
type Likeness = (u64, u32, u64);

fn likeness(entry: &EpisodeEntry) -> Likeness {
    (entry.seed, entry.steps, entry.episode_return.to_bits())
}

/// For every part the numbers of its episodes that a part before it holds too: with every column the same but the number and the cell, and the same changes of the model.
pub(super) fn repeats(parts: &[Recording], videos: &[Vec<u32>], stop: &AtomicBool) -> Result<Vec<BTreeSet<u32>>> {
    let mut holders: BTreeMap<Likeness, BTreeSet<usize>> = BTreeMap::new();
    for (place, part) in parts.iter().enumerate() {
        for entry in part.episodes() {
            holders.entry(likeness(entry)).or_default().insert(place);
        }
    }
    let is_elsewhere = |entry: &&EpisodeEntry| holders.get(&likeness(entry)).is_some_and(|places| places.len() > 1);
    let mut before: BTreeSet<String> = BTreeSet::new();
    let mut repeats = Vec::new();
    for (part, videos) in parts.iter().zip(videos) {
        let (mut own, mut found) = (BTreeSet::new(), BTreeSet::new());
        for entry in part.episodes().iter().filter(is_elsewhere) {
            go_on(stop)?;
            let said = format!("{} {}", moved(part, entry, 0, videos)?.digest(), entry.model_overrides);
            if before.contains(&said) {
                found.insert(entry.index);
            }
            own.insert(said);
        }
        before.extend(own);
        repeats.push(found);
    }
    Ok(repeats)
}

/// An episode of a part as the merged recording has it: under another number, without its cell, its videos found in the merged list.
///
/// # Errors
/// When its file is damaged.
pub(super) fn moved(part: &Recording, entry: &EpisodeEntry, index: u32, videos: &[u32]) -> Result<Episode> {
    check_intact(part, entry)?;
    let mut episode = Episode { index, cell: None, ..part.episode(entry.index)?.to_episode() };
    for shown in episode.backgrounds.iter_mut().flatten() {
        let unknown = || {
            let expected = format!("one of the manifest's {} videos", videos.len());
            Error::malformed(part.path().join(&entry.arrow.path), format!("video {}", shown.video), expected)
        };
        let video = *videos.get(shown.video as usize).ok_or_else(unknown)?;
        *shown = BackgroundFrame { video, ..*shown };
    }
    Ok(episode)
}
