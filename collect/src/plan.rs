//! What a recording is asked to be, and the list of episodes that follows from it.
//!
//! In: [`RecordOptions`], resolved and serialisable, which the manifest keeps. Out: one [`PlannedEpisode`] per episode: which state trajectory,
//! which distractor trajectory, and the seeds of both, which depend on the recording's seed and the trajectory's number alone. So a
//! recording can be stopped, gone on with and extended, and always holds the same episodes.

mod world;

use serde::{Deserialize, Serialize};
use vibes_data::{Cell, Grid};

use crate::trained::ActedBy;
use vibes_env::distractors::{AxisSeeds, DistractorSettings};
use vibes_env::render::Look;
use vibes_env::videos::{VideoSet, VideoSource};

/// Everything that decides what a recording holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordOptions {
    /// The task's name.
    pub task: String,
    /// Behaviour policies with their shares, as [`vibes_env::PolicyMix`] writes them.
    pub policy: String,
    /// The grid; without one, every episode has distractors of its own.
    pub grid: Option<Grid>,
    /// Number of episodes; with a grid, its number of cells.
    pub episodes: u32,
    /// Agent steps an episode.
    pub steps: u32,
    /// Control steps an agent step.
    pub action_repeat: u32,
    /// One torque per joint instead of the swimmer's wave.
    pub raw_torques: bool,
    /// Which distractors, how strong, and whether they move.
    pub distractors: DistractorSettings,
    /// Where background videos come from.
    pub videos: VideoSource,
    /// Training or held-out videos.
    pub video_set: VideoSet,
    /// How many videos; the suite's number for the difficulty when none is given.
    pub video_count: Option<usize>,
    /// Side of the pictures in pixels; none records no pictures.
    pub size: Option<u32>,
    /// How pictures are drawn.
    pub look: Look,
    /// Seeds of single axes.
    #[serde(default, skip_serializing_if = "ChosenSeeds::is_empty")]
    pub axis_seeds: ChosenSeeds,
    /// The trained runs among the policies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub acting: Vec<ActedBy>,
    /// Degrees by which the states were turned about the origin after they were simulated; see [`vibes_env::Task::rotate`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotated: Option<f64>,
}

/// Seeds of single axes, instead of the recording's: the same camera walks under other videos, and the like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChosenSeeds {
    /// Choice of video, start and direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub background: Option<u64>,
    /// The camera's walk.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<u64>,
    /// The colours' walk.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<u64>,
}

impl ChosenSeeds {
    /// Whether every axis goes by the recording's seed.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The seeds of one distractor trajectory of a recording of that seed.
    pub fn of_trajectory(self, seed: u64, distractor: u32) -> AxisSeeds {
        let of = |chosen: Option<u64>| distractor_seed(chosen.unwrap_or(seed), distractor);
        AxisSeeds { background: of(self.background), camera: of(self.camera), color: of(self.color) }
    }
}

/// One episode to be recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedEpisode {
    /// Its number.
    pub index: u32,
    /// Its place in the grid.
    pub cell: Option<Cell>,
    /// Which state trajectory.
    pub state: u32,
    /// Which distractor trajectory.
    pub distractor: u32,
}

impl RecordOptions {
    /// The episodes, by number: a grid row by row, or one distractor trajectory per state trajectory.
    pub fn episodes(&self) -> impl Iterator<Item = PlannedEpisode> + use<> {
        let grid = self.grid;
        (0..self.episodes).map(move |index| match grid {
            None => PlannedEpisode { index, cell: None, state: index, distractor: index },
            Some(Grid { distractors, .. }) => {
                let (state, distractor) = (index / distractors, index % distractors);
                PlannedEpisode { index, cell: Some(Cell { state, distractor }), state, distractor }
            }
        })
    }
}

/// The distractor trajectory under which a policy that sees pictures acts out a state trajectory: the one of the same number. It does not depend on the number of
/// columns, so that a grid can be made wider; on a square grid it is the diagonal, and without a grid every episode's own.
pub fn acting_distractor(state: u32) -> u32 {
    state
}

/// The seed of a state trajectory.
pub fn state_seed(seed: u64, state: u32) -> u64 {
    mixed(seed, 1, state)
}

/// The seed of a distractor trajectory.
pub fn distractor_seed(seed: u64, distractor: u32) -> u64 {
    mixed(seed, 2, distractor)
}

/// `SplitMix64` over seed, kind and number, cut to 53 bits, which every JSON reader keeps exactly.
fn mixed(seed: u64, kind: u64, number: u32) -> u64 {
    let mut state = seed;
    for word in [kind, u64::from(number)] {
        state = state.wrapping_add(word.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        state = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        state = (state ^ (state >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        state ^= state >> 31;
    }
    state >> 11
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_differ_by_kind_and_number_and_fit_in_53_bits() {
        let mut seen = std::collections::BTreeSet::new();
        for seed in 0..4 {
            for number in 0..200 {
                assert!(seen.insert(state_seed(seed, number)) && seen.insert(distractor_seed(seed, number)));
            }
        }
        assert!(seen.iter().all(|&seed| seed < 1 << 53));
    }
}
