//! What a policy earned, of a recording. In: its episodes. Out: [`Returns`]: the mean, its 95% interval, and every return.

use std::collections::BTreeSet;

use serde::Serialize;
use vibes_data::{EpisodeEntry, Recording};
use vibes_measure::returns::mean_return;

/// The returns of a recording's state trajectories. The cells of a grid's row share their actions and rewards, so that a row counts once.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Returns {
    /// The mean over state trajectories.
    pub mean_return: f64,
    /// The 95% interval of the mean ([`vibes_measure::returns::mean_return`]); none of fewer than two state trajectories.
    pub interval: Option<[f64; 2]>,
    /// Every return, by state trajectory.
    pub returns: Vec<f64>,
}

impl Returns {
    /// Of a recording; none when it has no episode yet.
    pub fn of(recording: &Recording) -> Option<Self> {
        Self::of_episodes(recording.episodes())
    }

    /// Of some of a recording's episodes; none of none.
    pub fn of_episodes<'e>(episodes: impl IntoIterator<Item = &'e EpisodeEntry>) -> Option<Self> {
        let returns = acted_once(episodes);
        let mean = mean_return(&returns).ok()?;
        let interval = [mean.low, mean.high];
        let is_known = interval.iter().all(|end| end.is_finite());
        Some(Self { mean_return: mean.estimate, interval: is_known.then_some(interval), returns })
    }
}

/// The returns of the first episode of each grid row, and of every episode without a cell.
fn acted_once<'e>(episodes: impl IntoIterator<Item = &'e EpisodeEntry>) -> Vec<f64> {
    let mut rows = BTreeSet::new();
    let once = episodes.into_iter().filter(|entry| entry.cell.is_none_or(|cell| rows.insert(cell.state)));
    once.map(|entry| entry.episode_return).collect()
}
