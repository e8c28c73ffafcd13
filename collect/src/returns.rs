//! What a policy earned, of a recording. In: its episodes. Out: [`Returns`]: the mean, its 95% interval, and every return.

use serde::Serialize;
use vibes_data::Recording;
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
        let mut rows = std::collections::BTreeSet::new();
        let counts = |row: Option<u32>| row.is_none_or(|row| rows.insert(row));
        let returns = acted_once(recording, counts);
        let mean = mean_return(&returns).ok()?;
        let interval = [mean.low, mean.high];
        let is_known = interval.iter().all(|end| end.is_finite());
        Some(Self { mean_return: mean.estimate, interval: is_known.then_some(interval), returns })
    }
}

/// The returns of the episodes whose grid row `counts`.
fn acted_once(recording: &Recording, mut counts: impl FnMut(Option<u32>) -> bool) -> Vec<f64> {
    let episodes = recording.episodes().iter();
    let once = episodes.filter(|entry| counts(entry.cell.map(|cell| cell.state)));
    once.map(|entry| entry.episode_return).collect()
}
