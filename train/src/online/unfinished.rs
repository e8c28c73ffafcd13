//! The episodes of an evaluation that is not over: kept beside the run after every one, so that a run that is killed or stopped in the middle of a hundred episodes goes on with the
//! next one. In: returns, one after another. Out: `evaluating.json` in the run folder, which is gone once the evaluation is saved with a checkpoint.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vibes_env::videos::VideoSet;

use super::evaluate::Counters;
use crate::error::{Result, io};
use crate::json::write_json;

const FILE: &str = "evaluating.json";

/// The returns so far of one evaluation.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Unfinished {
    /// Updates that the agent has learned from, and the control steps: which evaluation it is.
    update: u64,
    control_steps: u64,
    is_final: bool,
    held_out: Vec<f64>,
    training_videos: Vec<f64>,
    #[serde(skip)]
    file: PathBuf,
}

impl Unfinished {
    /// What is there of this evaluation; nothing of another one.
    pub(super) fn open(run: &Path, counters: Counters, is_final: bool) -> Self {
        let file = run.join(FILE);
        let Counters { update, control_steps, .. } = counters;
        let found = std::fs::read(&file).ok().and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let same = found.filter(|found| {
            (found.update, found.control_steps, found.is_final) == (update, control_steps, is_final)
        });
        Self { update, control_steps, is_final, file, ..same.unwrap_or_default() }
    }

    /// The returns under the videos of a set.
    pub(super) fn of(&self, videos: VideoSet) -> &[f64] {
        match videos {
            VideoSet::Val => &self.held_out,
            VideoSet::Train => &self.training_videos,
        }
    }

    /// Adds the next return and writes all of them.
    pub(super) fn push(&mut self, videos: VideoSet, episode_return: f64) -> Result<()> {
        match videos {
            VideoSet::Val => self.held_out.push(episode_return),
            VideoSet::Train => self.training_videos.push(episode_return),
        }
        write_json(&self.file, self)
    }
}

/// Removes what is there: the evaluation is saved.
pub(super) fn forget(run: &Path) -> Result<()> {
    let file = run.join(FILE);
    match std::fs::remove_file(&file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(io("remove", &file)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_lived_through_is_found_again_for_the_same_evaluation_only() {
        let folder = tempfile::tempdir().unwrap();
        let counters = Counters { update: 7, control_steps: 100, ..Counters::default() };
        let mut begun = Unfinished::open(folder.path(), counters, true);
        begun.push(VideoSet::Val, 12.5).unwrap();
        begun.push(VideoSet::Val, 0.1 + 0.2).unwrap();
        begun.push(VideoSet::Train, -3.0).unwrap();
        let found = Unfinished::open(folder.path(), counters, true);
        assert_eq!((found.of(VideoSet::Val), found.of(VideoSet::Train)), (&[12.5, 0.1 + 0.2][..], &[-3.0][..]));
        let others = [(Counters { update: 8, ..counters }, true), (counters, false)];
        for (counters, is_final) in others {
            assert!(Unfinished::open(folder.path(), counters, is_final).of(VideoSet::Val).is_empty());
        }
        forget(folder.path()).unwrap();
        forget(folder.path()).unwrap();
        assert!(Unfinished::open(folder.path(), counters, true).of(VideoSet::Val).is_empty());
    }

    #[test]
    fn a_damaged_file_is_as_none() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), b"{\"update\":").unwrap();
        assert!(Unfinished::open(folder.path(), Counters::default(), false).of(VideoSet::Val).is_empty());
    }
}
