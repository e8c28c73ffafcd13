//! The episodes of an evaluation that is not over: kept beside the run after every one, so that a run that is killed or stopped in the middle of a hundred episodes goes on with the
//! next one. In: returns, one after another. Out: `evaluating.json` in the run folder, which is gone once the evaluation is saved with a checkpoint.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vibes_env::videos::VideoSet;

use crate::error::{Result, io};
use crate::json::write_json;

const FILE: &str = "evaluating.json";

/// Which evaluation of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Which {
    /// Updates that the agent has learned from.
    pub(super) update: u64,
    /// Control steps that were lived through.
    pub(super) control_steps: u64,
    /// Whether it is the last one.
    pub(super) is_final: bool,
}

/// The returns so far of one evaluation.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Unfinished {
    #[serde(flatten)]
    which: Which,
    held_out: Vec<f64>,
    training_videos: Vec<f64>,
    #[serde(skip)]
    file: PathBuf,
}

impl Unfinished {
    /// What is there of this evaluation; nothing of another one.
    pub(super) fn open(run: &Path, which: Which) -> Self {
        let file = run.join(FILE);
        let found = std::fs::read(&file).ok().and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        Self { which, file, ..found.filter(|found| found.which == which).unwrap_or_default() }
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
        let which = Which { update: 7, control_steps: 100, is_final: true };
        let mut begun = Unfinished::open(folder.path(), which);
        begun.push(VideoSet::Val, 12.5).unwrap();
        begun.push(VideoSet::Val, 0.1 + 0.2).unwrap();
        begun.push(VideoSet::Train, -3.0).unwrap();
        let found = Unfinished::open(folder.path(), which);
        assert_eq!((found.of(VideoSet::Val), found.of(VideoSet::Train)), (&[12.5, 0.1 + 0.2][..], &[-3.0][..]));
        for other in [Which { update: 8, ..which }, Which { is_final: false, ..which }] {
            assert!(Unfinished::open(folder.path(), other).of(VideoSet::Val).is_empty());
        }
        forget(folder.path()).unwrap();
        forget(folder.path()).unwrap();
        assert!(Unfinished::open(folder.path(), which).of(VideoSet::Val).is_empty());
    }

    #[test]
    fn a_damaged_file_is_as_none() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), b"{\"update\":").unwrap();
        assert!(Unfinished::open(folder.path(), Which::default()).of(VideoSet::Val).is_empty());
    }
}
