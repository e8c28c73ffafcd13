//! Whether the episodes of a recording are what was written and what was planned, and how to mend one that is not.
//!
//! In: a recording and an episode of it. Out: an error, or words, for people. What is drawn, written or exported anew has checksums of its own, so that whoever does it asks here
//! first: of a damaged episode it would make a sound one.

use vibes_data::{EpisodeEntry, Recording, check_file};

use crate::keys::SUBSET;
use crate::plan::{PlannedEpisode, RecordOptions, state_seed};
use crate::stored::options_of;
use crate::{Error, Result};

/// That an episode's table is what was written.
///
/// # Errors
/// [`Error::Malformed`] names the file and how to mend it.
pub(crate) fn check_intact(recording: &Recording, entry: &EpisodeEntry) -> Result<()> {
    check_file(recording.path(), &entry.arrow)
        .map_err(|finding| Error::malformed(finding.path, finding.fault, mending(recording)))
}

/// How damaged files of a recording are mended.
pub(crate) fn mending(recording: &Recording) -> &'static str {
    if planned_options(recording).is_some() {
        return "to mend it, remove the file and repeat the recording's command, which makes it again";
    }
    "to mend it, put the file back from where it was made; no command makes it again"
}

/// The options of a recording whose command makes again whatever is missing; none for one that was put together, imported, or played by others.
pub(crate) fn planned_options(recording: &Recording) -> Option<RecordOptions> {
    let is_part = recording.manifest().options.get(SUBSET).is_some();
    let options = options_of(recording).ok().filter(|options| !is_part && options.episodes > 0)?;
    options.mix().is_ok().then_some(options)
}

/// The episodes that are not those that the recording's options plan under their numbers, by cell, seed and length; beyond the last one nothing is planned.
pub(crate) fn unplanned<'r>(recording: &'r Recording, options: &RecordOptions) -> Vec<&'r EpisodeEntry> {
    let seed = recording.manifest().seed;
    let planned: Vec<PlannedEpisode> = options.episodes().collect();
    let is_planned = |entry: &&EpisodeEntry| {
        planned.get(entry.index as usize).is_some_and(|planned| {
            planned.cell == entry.cell && entry.seed == state_seed(seed, planned.state) && entry.steps == options.steps
        })
    };
    recording.episodes().iter().filter(|entry| !is_planned(entry)).collect()
}

/// What is wrong with an episode that is not planned.
pub(crate) fn unplanned_in_words(entry: &EpisodeEntry, options: &RecordOptions) -> String {
    if entry.index >= options.episodes {
        return format!("episode {} is beyond the {} that were asked for", entry.index, options.episodes);
    }
    format!("episode {} is not the one that its options make", entry.index)
}
