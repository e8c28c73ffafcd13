//! What a recording is asked to be, and the list of episodes that follows from it.
//!
//! In: [`RecordOptions`], resolved and serialisable, which the manifest keeps. Out: one [`PlannedEpisode`] per episode: which state trajectory,
//! which distractor trajectory, and the seeds of both, which depend on the recording's seed and the trajectory's number alone. So a
//! recording can be stopped, gone on with and extended, and always holds the same episodes.

mod world;

use serde::{Deserialize, Serialize};
use vibes_data::{Cell, Grid};

use crate::trained::ActedBy;
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::Look;
use vibes_env::videos::{VideoSet, VideoSource};
pub use vibes_env::{ChosenSeeds, distractor_seed, state_seed};

/// The key of the options under which a part says what it is a part of.
pub(crate) const SUBSET: &str = "subset";

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
    /// The protocol of the trained run that acts, where whole episodes of that run's own world are recorded: numbers of another world are not the protocol's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub protocol: Option<String>,
    /// Degrees by which the states were turned about the origin after they were simulated; see [`vibes_env::Task::rotate`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotated: Option<f64>,
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
