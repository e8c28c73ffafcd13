//! Which episodes of a recording are of one state trajectory: the cells of a grid's row, and, without cells, views of one that were drawn under several distractors and
//! merged. What is divided by episodes or averaged over them counts each once.
//!
//! In: a recording. Out: for every episode the name of its trajectory, as [`vibes_measure::episodes`] tells them apart for probes.

use std::collections::BTreeMap;

use vibes_data::{EpisodeEntry, Recording};
use vibes_measure::episodes::{Chosen, Episode, chosen};

use crate::Result;

/// The state trajectory of every episode of a recording, in their order: on a grid the number of its row, elsewhere that of its first episode. Without cells, episodes are of one
/// trajectory if they have one seed and took the same actions; only those that share a seed and a length are looked into.
///
/// # Errors
/// When one of these is damaged.
pub(crate) fn trajectories(recording: &Recording) -> Result<Vec<u32>> {
    let entries = recording.episodes();
    let mut all: Vec<Episode> = entries.iter().map(as_episode).collect();
    let is_seeded = entries.iter().any(|entry| entry.seed != 0);
    if is_seeded && entries.iter().any(|entry| entry.cell.is_none()) {
        // Another trajectory beside them, without which views of one alone would pass for episodes whose actions say nothing.
        all.push(Episode { recording: 0, index: u32::MAX, cell: None });
    }
    let mut alike: BTreeMap<(u64, u32), usize> = BTreeMap::new();
    for entry in entries {
        *alike.entry((entry.seed, entry.steps)).or_default() += 1;
    }
    let marks = |place: usize| match entries.get(place) {
        Some(entry) => mark(recording, entry, alike.get(&(entry.seed, entry.steps)).is_some_and(|&count| count > 1)),
        None => Ok(Vec::new()),
    };
    let found = chosen(&all, usize::MAX, marks)?;
    let is_grid = entries.iter().all(|entry| entry.cell.is_some());
    let mut names: BTreeMap<(bool, u32), u32> = BTreeMap::new();
    let name = |(one, entry): (&Chosen, &EpisodeEntry)| match entry.cell {
        Some(cell) if is_grid => cell.state,
        _ => *names.entry((one.state.is_some(), one.state.unwrap_or(entry.index))).or_insert(entry.index),
    };
    Ok(found.iter().zip(entries).map(name).collect())
}

fn as_episode(entry: &EpisodeEntry) -> Episode {
    Episode { recording: 0, index: entry.index, cell: entry.cell.map(|cell| (cell.state, cell.distractor)) }
}

/// What episodes are told apart by, bit by bit: seed and length, and where others have these too, what was done.
fn mark(recording: &Recording, entry: &EpisodeEntry, has_likes: bool) -> Result<Vec<f32>> {
    let mut mark = [entry.seed as u32, (entry.seed >> 32) as u32, entry.steps].map(f32::from_bits).to_vec();
    if has_likes {
        let view = recording.episode(entry.index)?;
        // 0 is no seed but what stands for one that nobody said: then the start tells apart what a policy without a choice did.
        mark.extend(view.observation(0).iter().filter(|_| entry.seed == 0));
        mark.extend(view.actions());
    }
    Ok(mark)
}

/// How many state trajectories have more than one episode.
///
/// # Errors
/// As [`trajectories`].
pub(crate) fn with_views(recording: &Recording) -> Result<usize> {
    let mut views: BTreeMap<u32, usize> = BTreeMap::new();
    for name in trajectories(recording)? {
        *views.entry(name).or_default() += 1;
    }
    Ok(views.values().filter(|&&count| count > 1).count())
}
