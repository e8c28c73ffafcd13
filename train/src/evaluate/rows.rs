//! The rows that are measured: every row of some episodes, with their keys, their cells and what they say. In: recordings. Out: columns for `vibes-measure`.

use std::collections::BTreeMap;

use vibes_data::{About, EpisodeEntry, EpisodeView, Readable, Recording};
use vibes_measure::Table;
use vibes_measure::episodes::{Chosen, Episode, chosen};
use vibes_measure::intervals::Label;
use vibes_measure::past_actions::{past_action_dims, past_action_features};
use vibes_measure::probes::{HoldOut, Quantity, Values};

use super::Features;
use crate::error::Result;

/// All rows of some episodes of one or more recordings, episode after episode.
#[derive(Debug)]
pub struct Rows {
    views: Vec<EpisodeView>,
    /// What the rows of each episode say, by recording.
    readable: Vec<Vec<Readable>>,
    /// The recording of each episode.
    recording: Vec<usize>,
    /// Columns of all rows; episodes and cells of different recordings have different numbers.
    episode: Vec<u32>,
    step: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
}

impl Rows {
    /// The rows of at most `most` episodes, evenly spread over the recordings; views of one state trajectory are one (see [`vibes_measure::episodes`]).
    ///
    /// # Errors
    /// An episode cannot be read.
    pub fn of(recordings: &[Recording], most: usize) -> Result<Self> {
        let all = episodes(recordings);
        let mut rows = Self {
            views: Vec::new(),
            readable: recordings.iter().map(|recording| recording.manifest().spec.readable()).collect(),
            recording: Vec::new(),
            episode: Vec::new(),
            step: Vec::new(),
            state: Vec::new(),
            distractor: Vec::new(),
        };
        for one in chosen(&all, most, |place| actions(recordings, all[place]))? {
            let Episode { recording, index, .. } = all[one.place];
            rows.push(recording, recordings[recording].episode(index)?, one);
        }
        Ok(rows)
    }

    fn push(&mut self, recording: usize, view: EpisodeView, numbers: Chosen) {
        let count = view.rows();
        self.episode.extend(std::iter::repeat_n(numbers.episode, count));
        self.step.extend(0..count as u32);
        self.state.extend(std::iter::repeat_n(numbers.state, count));
        self.distractor.extend(std::iter::repeat_n(numbers.distractor, count));
        self.recording.push(recording);
        self.views.push(view);
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.episode.is_empty()
    }

    /// Number of episodes.
    pub fn episodes(&self) -> usize {
        self.views.len()
    }

    /// The episodes.
    pub fn views(&self) -> &[EpisodeView] {
        &self.views
    }

    /// A table of all rows.
    ///
    /// # Errors
    /// Features of other rows, or values that are not finite.
    pub fn table<'a>(&'a self, features: &'a Features) -> Result<Table<'a>> {
        let table = Table::new(features.dims, &features.values, &self.episode, &self.step)?;
        Ok(table.with_grid(&self.state, &self.distractor)?)
    }

    /// The action-only control's features of all rows.
    pub fn past_actions(&self) -> Features {
        let axes = self.views.first().filter(|view| view.steps() > 0).map_or(0, |view| view.action(0).len());
        let of = |view: &EpisodeView| past_action_features(&view.actions(), axes);
        Features {
            name: "past_actions",
            dims: past_action_dims(axes),
            values: self.views.iter().flat_map(of).collect(),
        }
    }

    /// What the rows of every recording say, by name; of rows that say different things, what the first says.
    pub fn readable(&self) -> &[Readable] {
        self.readable.first().map_or(&[], Vec::as_slice)
    }

    /// The rows with an action, so that every quantity can have a value, and the columns of these rows alone.
    pub fn acting(&self) -> Acting {
        let ends = self.views.iter().scan(0, |end, view| {
            *end += view.rows();
            Some(*end - 1)
        });
        let last: Vec<usize> = ends.collect();
        let kept: Vec<usize> = (0..self.episode.len()).filter(|row| last.binary_search(row).is_err()).collect();
        Acting {
            episode: kept.iter().map(|&row| self.episode[row]).collect(),
            step: kept.iter().map(|&row| self.step[row]).collect(),
            state: kept.iter().map(|&row| self.state[row]).collect(),
            distractor: kept.iter().map(|&row| self.distractor[row]).collect(),
            kept,
        }
    }

    /// The values of a quantity in the rows with an action; none if some row has none.
    pub fn quantity(&self, name: &str) -> Option<Quantity> {
        let mut values = Vec::new();
        let (mut classes, mut hold_out) = (false, HoldOut::State);
        for (view, &recording) in self.views.iter().zip(&self.recording) {
            let readable = self.readable[recording].iter().find(|readable| readable.name == name)?;
            classes = readable.is_class();
            if readable.about == About::Distractor {
                hold_out = HoldOut::of_distractor(classes, self.state.iter().all(Option::is_some));
            }
            for row in 0..view.steps() {
                values.push(readable.value(view, row)?);
            }
        }
        Some(Quantity { name: name.to_owned(), hold_out, values: Values::of(classes, values) })
    }
}

/// What is drawn again for an interval, by recording and episode: the cell of an episode, or the episode itself; views of one state trajectory are one.
///
/// # Errors
/// An episode cannot be read.
pub fn trajectories(recordings: &[Recording]) -> Result<BTreeMap<(usize, u32), Label>> {
    let all = episodes(recordings);
    let numbered = chosen(&all, usize::MAX, |place| actions(recordings, all[place]))?;
    Ok(numbered.iter().map(|one| ((all[one.place].recording, all[one.place].index), one.label())).collect())
}

/// All episodes of some recordings, recording after recording.
fn episodes(recordings: &[Recording]) -> Vec<Episode> {
    let of = |(recording, of): (usize, &Recording)| {
        let episode = |entry: &EpisodeEntry| Episode {
            recording,
            index: entry.index,
            cell: entry.cell.map(|cell| (cell.state, cell.distractor)),
        };
        of.episodes().iter().map(episode).collect::<Vec<_>>()
    };
    recordings.iter().enumerate().flat_map(of).collect()
}

/// All actions of an episode, one after the other.
fn actions(recordings: &[Recording], of: Episode) -> Result<Vec<f32>> {
    Ok(recordings[of.recording].episode(of.index)?.actions())
}

/// The rows with an action.
#[derive(Debug)]
pub struct Acting {
    kept: Vec<usize>,
    episode: Vec<u32>,
    step: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
}

impl Acting {
    /// These rows of a table of features of all rows.
    pub fn of(&self, features: &Features) -> Features {
        let row = |&row: &usize| &features.values[row * features.dims..(row + 1) * features.dims];
        Features { values: self.kept.iter().flat_map(row).copied().collect(), ..Features::clone(features) }
    }

    /// A table of these rows.
    ///
    /// # Errors
    /// Features of other rows, or values that are not finite.
    pub fn table<'a>(&'a self, features: &'a Features) -> Result<Table<'a>> {
        let table = Table::new(features.dims, &features.values, &self.episode, &self.step)?;
        Ok(table.with_grid(&self.state, &self.distractor)?)
    }
}
