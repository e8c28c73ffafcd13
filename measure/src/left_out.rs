//! Means of what is compared with other rows, without each trajectory in turn: what the jackknife of [`crate::intervals`] is made of.
//!
//! In: the parts of a mean, each with the trajectories that it is of, its value, and the value that it would have without a trajectory of what it was compared with. Out: a number
//! without each state trajectory (or episode) and without each distractor trajectory. A part of the trajectory that is left out is none.

use std::collections::BTreeMap;

use crate::intervals::Trajectories;

/// A trajectory: its kind, 0 of states and 1 of distractors, and its number.
pub(crate) type Trajectory = (usize, usize);

/// One part of a mean.
#[derive(Debug)]
pub(crate) struct Part<V> {
    /// The trajectories that it is of: it is left out with any of them.
    pub(crate) own: Vec<Trajectory>,
    /// Its value with everything.
    pub(crate) whole: V,
    /// Its value without others, where that is another one.
    pub(crate) without: BTreeMap<Trajectory, V>,
}

impl<V: Copy> Part<V> {
    /// Its value without a trajectory; none of one that is of it.
    pub(crate) fn left(&self, out: Trajectory) -> Option<V> {
        (!self.own.contains(&out)).then(|| self.without.get(&out).copied().unwrap_or(self.whole))
    }
}

/// The trajectories that a row is of.
pub(crate) fn of_row(trajectories: &Trajectories, row: usize) -> Vec<Trajectory> {
    trajectories.of_row(row).into_iter().enumerate().filter_map(|(kind, own)| Some((kind, own?))).collect()
}

/// A number without each trajectory of either kind.
pub(crate) fn each(trajectories: &Trajectories, number: impl Fn(Trajectory) -> f64) -> [Vec<f64>; 2] {
    let counts = trajectories.counts();
    [0, 1].map(|kind| (0..counts[kind]).map(|place| number((kind, place))).collect())
}

/// The mean of some values; not a number of none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
