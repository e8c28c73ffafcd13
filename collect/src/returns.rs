//! What a policy earned, of a recording. In: its episodes. Out: [`Returns`]: the mean, its 95% interval, and every return.

use std::collections::BTreeSet;

use serde::Serialize;
use vibes_data::Recording;
use vibes_measure::returns::mean_return;

use crate::trajectories::trajectories;

/// The returns of a recording's state trajectories. The cells of a grid's row share their actions and rewards, and so do views that were merged, so that each counts once.
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
        let returns = recording.episodes().iter().map(|entry| entry.episode_return);
        Self::of_episodes(returns.zip(acted(recording)))
    }

    /// Of some of a recording's episodes, by return and state trajectory (see [`acted`]); none of none.
    pub(crate) fn of_episodes(episodes: impl IntoIterator<Item = (f64, u32)>) -> Option<Self> {
        let mut seen = BTreeSet::new();
        let once = episodes.into_iter().filter(|&(_, trajectory)| seen.insert(trajectory));
        let returns: Vec<f64> = once.map(|(earned, _)| earned).collect();
        let mean = mean_return(&returns).ok()?;
        let interval = [mean.low, mean.high];
        let is_known = interval.iter().all(|end| end.is_finite());
        Some(Self { mean_return: mean.estimate, interval: is_known.then_some(interval), returns })
    }
}

/// The state trajectory of every episode of a recording. Where one is damaged that would have to be looked into, each counts for itself: what is damaged is for `verify` to say.
pub(crate) fn acted(recording: &Recording) -> Vec<u32> {
    let each = || recording.episodes().iter().map(|entry| entry.index).collect();
    trajectories(recording).unwrap_or_else(|_damaged| each())
}
