//! What the recording that is named beside a table of latents knows of its rows and the table does not say: cells of a grid, rewards, and for a plain array
//! the key of every row.
//!
//! In: the recording, and the keys. Out: columns, so that latents of a user's own are measured as those are that `vibes-train encode` writes.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

use polars::prelude::{Column, DataFrame, PolarsError};
use vibes_data::{Cell, EpisodeEntry, EpisodeView, Recording};

use super::InputError;
use super::tables::column;

/// An opened recording.
pub(super) struct Recorded {
    recording: Recording,
    path: PathBuf,
}

impl Recorded {
    pub(super) fn open(path: &Path) -> Result<Self, InputError> {
        Ok(Self { recording: Recording::open(path)?, path: path.into() })
    }

    /// The columns of these rows that a table lacks: the cell of a grid and the reward, but for what the recording does not have either. Rows that the recording
    /// lacks are an error, whatever the table has.
    pub(super) fn columns(
        &self,
        episodes: &[u32],
        steps: &[u32],
        lacks: impl Fn(&str) -> bool,
    ) -> Result<Vec<Column>, InputError> {
        let rows = episodes.iter().zip(steps).map(|(&episode, &step)| self.entry(episode, step));
        let entries = rows.collect::<Result<Vec<_>, InputError>>()?;
        let cells =
            |of: fn(Cell) -> u32| -> Vec<Option<u32>> { entries.iter().map(|entry| entry.cell.map(of)).collect() };
        let mut columns = Vec::new();
        for (name, values) in [("state", cells(|cell| cell.state)), ("distractor", cells(|cell| cell.distractor))] {
            if lacks(name) && values.iter().any(Option::is_some) {
                columns.push(Column::new(name.into(), values));
            }
        }
        if lacks("reward") {
            columns.push(Column::new("reward".into(), self.rewards(episodes, steps)?));
        }
        Ok(columns)
    }

    /// The episode, if it has this step.
    fn entry(&self, episode: u32, step: u32) -> Result<&EpisodeEntry, InputError> {
        let other = |fact: String| InputError::OtherRecording { fact, path: self.path.clone() };
        let all = self.recording.episodes();
        let Ok(at) = all.binary_search_by_key(&episode, |entry| entry.index) else {
            return Err(other(format!("it has no episode {episode}")));
        };
        if step > all[at].steps {
            let rows = u64::from(all[at].steps) + 1;
            return Err(other(format!("step {step} of episode {episode} is past its {rows} rows")));
        }
        Ok(&all[at])
    }

    /// The reward of every row; an episode's last row has none.
    fn rewards(&self, episodes: &[u32], steps: &[u32]) -> Result<Vec<Option<f32>>, InputError> {
        let mut views: BTreeMap<u32, EpisodeView> = BTreeMap::new();
        let mut rewards = Vec::with_capacity(steps.len());
        for (&episode, &step) in episodes.iter().zip(steps) {
            let view = match views.entry(episode) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(place) => place.insert(self.recording.episode(episode)?),
            };
            rewards.push(((step as usize) < view.steps()).then(|| view.reward(step as usize)));
        }
        Ok(rewards)
    }
}

/// Gives the rows of a plain array the keys of the recording's rows, in order, and says so: nothing in the array tells whether they are.
pub(super) fn number_rows(
    frame: &mut DataFrame,
    recorded: Option<&Recorded>,
    path: &Path,
) -> Result<String, InputError> {
    let rows = frame.height();
    let no_keys = |fact: String| InputError::NoKeys { rows, fact, path: path.into() };
    let Some(recorded) = recorded else { return Err(no_keys(String::new())) };
    let (name, entries) = (recorded.path.display(), recorded.recording.episodes());
    let keys = entries.iter().flat_map(|entry| (0..=entry.steps).map(move |step| (entry.index, step)));
    let (episodes, steps): (Vec<u32>, Vec<u32>) = keys.unzip();
    if episodes.len() != rows {
        return Err(no_keys(format!(", and {name} has {}", episodes.len())));
    }
    add_keys(frame, (&episodes, &steps), path)?;
    // Where it lies on this machine is nobody's business: a report shows this.
    let name = recorded.path.file_name().map_or_else(|| "the recording".into(), |name| name.to_string_lossy());
    Ok(format!(
        "a plain array has no keys: its {rows} rows are taken for those of {name} in order, {} episodes one after the other, each with its T + 1 rows",
        entries.len()
    ))
}

/// Gives the rows of a plain array these keys, in order: those of a map that was made of all of its rows, when a recording said whose they are.
pub(super) fn key_rows(frame: &mut DataFrame, keys: (&[u32], &[u32]), path: &Path) -> Result<(), InputError> {
    if frame.height() != keys.0.len() {
        return Err(InputError::SomeOfArray { rows: frame.height(), of_map: keys.0.len(), path: path.into() });
    }
    add_keys(frame, keys, path)
}

fn add_keys(frame: &mut DataFrame, (episodes, steps): (&[u32], &[u32]), path: &Path) -> Result<(), InputError> {
    let fault = |error: PolarsError| column(path, "episode and step", error.to_string(), "one of each a row");
    frame.with_column(Column::new("episode".into(), episodes.to_vec())).map_err(fault)?;
    frame.with_column(Column::new("step".into(), steps.to_vec())).map_err(fault)?;
    Ok(())
}
