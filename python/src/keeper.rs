//! Where worlds put their episodes: a recording that several threads write to.

use std::sync::Arc;

use vibes_data::RecordingWriter;

/// Where worlds put their episodes.
#[derive(Clone, Debug)]
pub(crate) struct Keeper {
    pub writer: Arc<RecordingWriter>,
    /// The recording's seed: its episodes are told apart by their numbers under this seed.
    pub seed: u64,
}
