//! Where worlds put their episodes: a recording that several threads write to.

use std::sync::Arc;

use vibes_data::{Cell, Grid, RecordingWriter};

/// Where worlds put their episodes.
#[derive(Clone, Debug)]
pub(crate) struct Keeper {
    pub writer: Arc<RecordingWriter>,
    /// The recording's seed: its episodes are told apart by their numbers under this seed.
    pub seed: u64,
    /// The grid that is filled, if it is one.
    pub grid: Option<Grid>,
    /// Whether the policy looks at the pictures of the distractor trajectory that has its state trajectory's number, as `vibes-collect` lets it.
    pub acts_by_pictures: bool,
}

impl Keeper {
    /// The number and the cell of a state trajectory under a distractor trajectory in this recording.
    pub(crate) fn place(&self, state: u32, distractor: u32) -> Result<(u32, Option<Cell>), String> {
        match self.grid {
            Some(Grid { states, distractors }) if state < states && distractor < distractors => {
                Ok((state * distractors + distractor, Some(Cell { state, distractor })))
            }
            Some(Grid { states, distractors }) => Err(format!(
                "state {state} under distractor {distractor}; this recording's cells are below {states} and {distractors}"
            )),
            None if state == distractor => Ok((state, None)),
            None => Err(format!(
                "state {state} under distractor {distractor}; kept episodes have one number for both, or a Writer with a grid"
            )),
        }
    }
}
