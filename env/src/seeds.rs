//! The seeds of an episode, from the recording's seed and the numbers of its state and distractor trajectories alone: so that whoever plays episode
//! 12 of seed 0, recorded or not, plays the same one.

use serde::{Deserialize, Serialize};

use crate::EpisodeSeeds;
use crate::distractors::AxisSeeds;

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

    /// The seeds of the episode of this state trajectory under this distractor trajectory, of a recording of that seed.
    pub fn of_episode(self, seed: u64, state: u32, distractor: u32) -> EpisodeSeeds {
        EpisodeSeeds { state: state_seed(seed, state), distractors: self.of_trajectory(seed, distractor) }
    }
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
