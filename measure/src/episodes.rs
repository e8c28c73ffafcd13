//! Episodes of one or more recordings as one set: which of them are looked at, and of which trajectories they are.
//!
//! Episode 3 of one recording is another than episode 3 of the next, and so are states and distractors: together they are numbered anew. Yet episodes that
//! took the same actions are *views* of one state trajectory, which `vibes-collect render` draws again and `vibes-collect merge` puts into one recording, without
//! cells: what is fitted on one must not be checked on the other, and an interval must not take them for two trajectories.
//!
//! In: the episodes with their cells, and the actions of those that are asked for. Out: the episodes that are looked at, with their numbers among all.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hasher};

use crate::intervals::{Label, label};
use crate::table::number;

/// Most episodes of the recordings to fit on that probes are fitted on, unless told otherwise.
pub const PROBE_EPISODES: usize = 100;

/// An episode of one of the recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Episode {
    /// The recording, numbered from 0.
    pub recording: usize,
    /// The episode's number in it.
    pub index: u32,
    /// Its cell of that recording's grid: the state and the distractor.
    pub cell: Option<(u32, u32)>,
}

/// An episode that is looked at, by its numbers among those of all recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chosen {
    /// Its place in the list of all episodes.
    pub place: usize,
    /// Its number.
    pub episode: u32,
    /// Its state trajectory, where it lies on a grid or has views.
    pub state: Option<u32>,
    /// Its distractor trajectory: that of its cell, or one of its own where only its state is known.
    pub distractor: Option<u32>,
}

impl Chosen {
    /// What is drawn again for an interval.
    #[must_use]
    pub fn label(&self) -> Label {
        label(self.episode, self.state.zip(self.distractor))
    }
}

/// At most `most` of the episodes, with their numbers among them: as many state trajectories as there can be, before a second view of any, evenly spread over the list. `actions` gives all actions of the episode at a place of the list; it is asked of all of them, unless they are of one recording in which every one has a cell.
/// Episodes of one recording keep their numbers, and so do its cells where nothing is asked.
///
/// # Errors
/// What `actions` fails with.
pub fn chosen<E>(
    all: &[Episode],
    most: usize,
    mut actions: impl FnMut(usize) -> Result<Vec<f32>, E>,
) -> Result<Vec<Chosen>, E> {
    let is_one_recording = all.iter().all(|one| one.recording == all[0].recording);
    let states_of_cells: Option<Vec<u32>> = all.iter().map(|one| one.cell.map(|cell| cell.0)).collect();
    if is_one_recording && states_of_cells.is_some() {
        let places = spread(states_of_cells.as_deref(), all.len(), most);
        return Ok(places.into_iter().map(|place| as_recorded(all, place)).collect());
    }
    let taken = (0..all.len()).map(|place| actions(place).map(|own| digest(&own))).collect::<Result<Vec<u64>, E>>()?;
    let states = views(&taken);
    let places = spread(states.as_deref(), all.len(), most);
    let mut chosen: Vec<Chosen> = places.iter().map(|&place| as_recorded(all, place)).collect();
    if !is_one_recording {
        number_anew(all, &mut chosen);
    }
    if let Some(states) = states {
        for (one, distractor) in chosen.iter_mut().zip(distractors(all, &places)) {
            (one.state, one.distractor) = (Some(states[one.place]), Some(distractor));
        }
    }
    Ok(chosen)
}

/// At most `most` of the places of a list, ascending: one of every state trajectory before a second of any, the views in turn, and evenly spread where not all of a round
/// are taken. Where `states` says nothing, every place is a trajectory of its own.
fn spread(states: Option<&[u32]>, len: usize, most: usize) -> Vec<usize> {
    let mut of_state: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for place in 0..len {
        of_state.entry(states.map_or(place as u32, |states| states[place])).or_default().push(place);
    }
    let mut places = Vec::new();
    for round in 0.. {
        let left = most.max(1) - places.len();
        let view = |(at, views): (usize, &Vec<usize>)| (round < views.len()).then(|| views[(at + round) % views.len()]);
        let next: Vec<usize> = of_state.values().enumerate().filter_map(view).collect();
        let taken = next.len().min(left);
        places.extend((0..taken).map(|at| next[at * next.len() / taken]));
        if taken < next.len() || next.is_empty() || places.len() == most.max(1) {
            break;
        }
    }
    places.sort_unstable();
    places
}

fn as_recorded(all: &[Episode], place: usize) -> Chosen {
    let Episode { index, cell, .. } = all[place];
    let (state, distractor) = cell.unzip();
    Chosen { place, episode: index, state, distractor }
}

/// Numbers that tell the recordings apart, in the order of the recordings and of the numbers in them.
fn number_anew(all: &[Episode], chosen: &mut [Chosen]) {
    let recording = |one: &Chosen| all[one.place].recording;
    let anew = |of: &dyn Fn(&Chosen) -> Option<u32>| -> Vec<Option<u32>> {
        // Those that have none come first and take a number or two that nobody sees.
        let labels: Vec<_> = chosen.iter().map(|one| of(one).map(|own| (recording(one), own))).collect();
        labels.iter().zip(number(&labels)).map(|(label, number)| label.map(|_| number)).collect()
    };
    let episodes = anew(&|one| Some(one.episode));
    let (states, distractors) = (anew(&|one| one.state), anew(&|one| one.distractor));
    for (at, one) in chosen.iter_mut().enumerate() {
        one.episode = episodes[at].unwrap_or_default();
        (one.state, one.distractor) = (states[at], distractors[at]);
    }
}

/// The distractor trajectory of the episode at each place, numbered together: a column of one recording's grid is the same in all of its rows, and neither a column
/// of another grid nor an episode outside any has its number.
fn distractors(all: &[Episode], places: &[usize]) -> Vec<u32> {
    let label = |&place: &usize| {
        let Episode { recording, index, cell } = all[place];
        cell.map_or((1, recording, index), |(_, column)| (0, recording, column))
    };
    number(&places.iter().map(label).collect::<Vec<(u8, usize, u32)>>())
}

/// What actions are told apart by, so that those of one episode at a time are in memory: two of a million episodes share it by chance in one of thirty million recordings.
fn digest(actions: &[f32]) -> u64 {
    let mut hasher = DefaultHasher::new();
    actions.iter().for_each(|value| hasher.write_u32(value.to_bits()));
    hasher.finish()
}

/// A number for every episode, the same for those that took the same actions; nothing where all differ, or where none do, as under a policy that always does
/// the same.
fn views(actions: &[u64]) -> Option<Vec<u32>> {
    let mut numbers: BTreeMap<u64, u32> = BTreeMap::new();
    let mut state = |actions: &u64| {
        let next = numbers.len() as u32;
        *numbers.entry(*actions).or_insert(next)
    };
    let states: Vec<u32> = actions.iter().map(&mut state).collect();
    (1 < numbers.len() && numbers.len() < actions.len()).then_some(states)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::intervals::Trajectories;

    fn episode(recording: usize, index: u32, cell: Option<(u32, u32)>) -> Episode {
        Episode { recording, index, cell }
    }

    fn choose(all: &[Episode], most: usize, actions: impl Fn(Episode) -> f32) -> Vec<Chosen> {
        let given = |place: usize| Ok::<_, Infallible>(vec![0.25, actions(all[place])]);
        chosen(all, most, given).unwrap()
    }

    #[test]
    fn a_grid_keeps_its_numbers_and_nobody_asks_for_its_actions() {
        let all: Vec<Episode> = (0..10).map(|index| episode(0, 7 * index, Some((index / 5, index % 5)))).collect();
        let refuse = |_: usize| Err("asked");
        let some = chosen(&all, 4, refuse).unwrap();
        assert_eq!(some.iter().map(|one| one.place).collect::<Vec<_>>(), [0, 1, 6, 7], "of every state alike");
        assert_eq!(some[2], Chosen { place: 6, episode: 42, state: Some(1), distractor: Some(1) });
        assert_eq!(chosen(&all, usize::MAX, refuse).unwrap().len(), 10);
        assert!(chosen(&[], 4, refuse).unwrap().is_empty());
    }

    #[test]
    fn one_recording_of_other_actions_keeps_its_numbers() {
        let alone: Vec<Episode> = (0..101).map(|index| episode(0, 7 * index, None)).collect();
        let found = choose(&alone, 100, |one| one.index as f32);
        assert_eq!(found.len(), 100, "as many as may be looked at");
        let own = |one: &Chosen| one.episode == 7 * one.place as u32 && one.state.is_none() && one.distractor.is_none();
        assert!(found.iter().all(own), "{found:?}");
    }

    /// As `vibes-collect merge`, and then `filter`, leave them: without cells.
    #[test]
    fn views_within_one_recording_are_one() {
        let merged: Vec<Episode> = (0..12).map(|index| episode(0, 7 * index, None)).collect();
        let action = |one: Episode| (one.index / 7 % 4) as f32;
        let found = choose(&merged, usize::MAX, action);
        assert_eq!(
            found.iter().map(|one| one.episode).collect::<Vec<_>>(),
            (0..12).map(|n| 7 * n).collect::<Vec<u32>>()
        );
        let states: Vec<Option<u32>> = found.iter().map(|one| one.state).collect();
        assert_eq!(states, [Some(0), Some(1), Some(2), Some(3)].repeat(3));
        let labels: Vec<Label> = found.iter().map(Chosen::label).collect();
        assert_eq!(Trajectories::new(&labels).units(), 12, "each under a distractor of its own");
        let some: Vec<Option<u32>> = choose(&merged, 4, action).iter().map(|one| one.state).collect();
        assert_eq!(some.iter().collect::<std::collections::BTreeSet<_>>().len(), 4, "before a second view of any");
    }

    #[test]
    fn a_column_of_a_grid_is_one_distractor_beside_views_and_no_other_grids() {
        let cells = |recording, index: u32| episode(recording, index, Some((index / 2, index % 2)));
        let grids = (0..2).flat_map(|recording| (0..6).map(move |index| cells(recording, index)));
        let all: Vec<Episode> = grids.chain((0..3).map(|index| episode(2, index, None))).collect();
        let found = choose(&all, usize::MAX, |one| one.cell.map_or(one.index, |cell| cell.0) as f32);
        let states: Vec<u32> = found.iter().filter_map(|one| one.state).collect();
        assert_eq!(states, [0, 0, 1, 1, 2, 2, 0, 0, 1, 1, 2, 2, 0, 1, 2]);
        let distractors: Vec<u32> = found.iter().filter_map(|one| one.distractor).collect();
        assert_eq!(distractors, [0, 1, 0, 1, 0, 1, 2, 3, 2, 3, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn views_of_one_state_trajectory_are_one() {
        let all: Vec<Episode> = (0..3).flat_map(|view| (0..4).map(move |index| episode(view, index, None))).collect();
        let found = choose(&all, usize::MAX, |one| one.index as f32);
        assert_eq!(found.iter().map(|one| one.episode).collect::<Vec<_>>(), (0..12).collect::<Vec<u32>>());
        let states: Vec<Option<u32>> = found.iter().map(|one| one.state).collect();
        assert_eq!(states[..8], [Some(0), Some(1), Some(2), Some(3), Some(0), Some(1), Some(2), Some(3)]);
        assert!(found.iter().all(|one| one.distractor == Some(one.episode)));
    }

    /// Every so-manieth of a list of views is a view of the same few trajectories, where their number and the stride share a divisor.
    #[test]
    fn there_are_as_many_trajectories_as_there_can_be() {
        let all: Vec<Episode> = (0..3).flat_map(|view| (0..12).map(move |index| episode(view, index, None))).collect();
        let count = |most| {
            let found = choose(&all, most, |one| one.index as f32);
            let states: std::collections::BTreeSet<Option<u32>> = found.iter().map(|one| one.state).collect();
            let recordings: std::collections::BTreeSet<usize> =
                found.iter().map(|one| all[one.place].recording).collect();
            (found.len(), states.len(), recordings.len())
        };
        assert_eq!(count(9), (9, 9, 3));
        assert_eq!(count(12), (12, 12, 3));
        assert_eq!(count(20), (20, 12, 3));
        assert_eq!(count(usize::MAX), (36, 12, 3));
        // A recording of other trajectories has its share.
        let more: Vec<Episode> =
            all.iter().copied().chain((0..40).map(|index| episode(3, 100 + index, None))).collect();
        let found = choose(&more, 26, |one| one.index as f32);
        assert_eq!(found.iter().filter(|one| all.get(one.place).is_none()).count(), 20, "40 of 52 trajectories");
    }

    #[test]
    fn other_actions_are_other_trajectories_and_the_same_ones_always_say_nothing() {
        let cells = |recording, index: u32| episode(recording, index, Some((index / 2, index % 2)));
        let all: Vec<Episode> = (0..2).flat_map(|one| (0..4).map(move |index| cells(one, index))).collect();
        let expected: Vec<Option<u32>> = [0, 0, 1, 1, 2, 2, 3, 3].map(Some).to_vec();
        let state = |chosen: Vec<Chosen>| chosen.iter().map(|one| one.state).collect::<Vec<_>>();
        assert_eq!(state(choose(&all, usize::MAX, |one| (10 * one.recording) as f32 + one.index as f32)), expected);
        assert_eq!(state(choose(&all, usize::MAX, |_| 1.0)), expected);
        let mixed = [cells(0, 0), cells(0, 2), episode(1, u32::MAX, None)];
        let found = choose(&mixed, usize::MAX, |one| one.index as f32);
        assert_eq!(found[2], Chosen { place: 2, episode: 2, state: None, distractor: None });
    }

    /// Labels that number recordings in a byte take the 256th for another.
    #[test]
    fn three_hundred_recordings_are_told_apart() {
        let all: Vec<Episode> = (0..300).map(|recording| episode(recording, 0, Some((0, 0)))).collect();
        let found = choose(&all, usize::MAX, |one| one.recording as f32);
        let labels: Vec<Label> = found.iter().map(Chosen::label).collect();
        assert_eq!(Trajectories::new(&labels).units(), 300);
    }
}
