//! Whether the run that is there is the one that is asked for. In: a run, and the options, model and recordings asked for. Out: nothing, or what differs.

use std::path::Path;

use vibes_data::Recording;
use vibes_model::ModelConfig;

use super::differences::differences;
use super::{Run, RunInfo, fingerprint};
use crate::error::{Result, TrainError};

impl Run {
    /// That this run was begun with the same options, on the same recordings, from the same run.
    ///
    /// # Errors
    /// [`TrainError::OtherRun`], or [`TrainError::OtherModel`] for a copy that lacks what training needs.
    pub(super) fn check_same(&self, asked: &RunInfo, recordings: &[Recording]) -> Result<()> {
        if let Some((key, found, asked)) = self.info.options.first_difference(&asked.options) {
            return Err(self.other(&key, found, asked));
        }
        self.check_model(&asked.model)?;
        self.check_recordings(asked, recordings)?;
        match &asked.from {
            Some(place) if !self.began_with(place) => {
                let from = self.info.from.clone().unwrap_or_else(|| "nothing".to_owned());
                Err(self.other("from", from, place.clone()))
            }
            _ => Ok(()),
        }
    }

    fn check_model(&self, asked: &ModelConfig) -> Result<()> {
        let found = &self.info.model;
        let mut asked = asked.clone();
        if self.checkpoints().is_empty() {
            // Nothing was learned in this unit of reward yet: a recording that was mended, or has grown, since may have another.
            (asked.reward_scale, asked.reward_floor) = (found.reward_scale, found.reward_floor);
        }
        if *found == asked {
            return Ok(());
        }
        if let Some(error) = self.lacks_adversary().filter(|_| asked.adversary) {
            return Err(error);
        }
        let named = [found, &asked].map(describe);
        let (found, asked) = if named[0] == named[1] { differences(found, &asked) } else { named.into() };
        Err(self.other("model", found, asked))
    }

    /// A recording may have moved, or grown, since; another name is another recording, and so is one that does not begin with the same episodes.
    fn check_recordings(&self, asked: &RunInfo, recordings: &[Recording]) -> Result<()> {
        let (before, names) = (self.info.recording_names(), asked.recording_names());
        if before != names {
            return Err(self.other("recordings", before.join(", "), names.join(", ")));
        }
        let known = fingerprint::read(&self.folder.info_path())?;
        let mut pairs = known.iter().zip(recordings).zip(names);
        match pairs.find(|((known, recording), _)| !known.is_of(recording)) {
            None => Ok(()),
            Some((_, name)) => {
                let there = format!("{name} as it was when the run was last trained");
                Err(self.other("recordings", there, format!("{name} with other episodes in their place")))
            }
        }
    }

    fn other(&self, key: &str, found: String, asked: String) -> TrainError {
        TrainError::OtherRun { key: key.to_owned(), found, asked, path: self.path().to_owned() }
    }

    /// Whether this run went on from the one at `asked`, as a file of this folder names it. It may have moved since; another name is another run, and so is one of the same
    /// name elsewhere while both are there.
    fn began_with(&self, asked: &str) -> bool {
        let Some(from) = &self.info.from else { return false };
        let places = [from.as_str(), asked].map(|place| self.folder.find_run(place)?.canonicalize().ok());
        match places {
            [Some(from), Some(asked)] => from == asked,
            _ => Path::new(from).file_name() == Path::new(asked).file_name(),
        }
    }

    /// What is said where this is to be trained and is a copy that was made with `--acting`: its objective has an adversary, and its model none.
    pub(crate) fn lacks_adversary(&self) -> Option<TrainError> {
        let (options, model) = (&self.info.options, &self.info.model);
        let is_acting_copy = options.objective.networks(options, model.actions()).adversary && !model.adversary;
        is_acting_copy.then(|| TrainError::OtherModel {
            found: "no adversary (the copy was made with --acting)".to_owned(),
            wanted: "one, to learn against".to_owned(),
            path: self.path().to_owned(),
        })
    }
}

fn describe(model: &ModelConfig) -> String {
    format!("{} with {} and {} actions", model.task, model.observation, model.actions())
}
