//! Whether a recording is of the world that a model has learned from. In: the task and the action repeat of both, as far as they are known. Out: nothing, or in what they differ.
//!
//! Pictures of the right size and as many actions are no world yet: under another task the rewards are others, and under another action repeat a step leads elsewhere and earns more
//! or less, so that numbers of rewards and dynamics mean nothing. Whether latents alone are wanted there is for whoever asks to say.

use vibes_data::Recording;

use crate::error::{Result, TrainError};

/// The world that a model has learned from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LearnedWorld {
    /// The task's name.
    pub task: String,
    /// For how many control steps every action is held; not known where the recordings are gone.
    pub action_repeat: Option<u32>,
    /// Whether other programs recorded it: its task may be called after a file.
    pub is_imported: bool,
}

impl LearnedWorld {
    /// That of a recording.
    pub fn of(recording: &Recording) -> Self {
        let spec = &recording.manifest().spec;
        let is_imported = recording.manifest().is_imported();
        Self { task: spec.task.clone(), action_repeat: Some(spec.action_repeat), is_imported }
    }

    /// In what another world differs: that one, and this one, in words.
    pub fn difference(&self, other: &Self) -> Option<(String, String)> {
        let is_of_task = self.is_imported || other.is_imported || self.task == other.task;
        let repeats = self.action_repeat.zip(other.action_repeat);
        let is_held_alike = repeats.is_none_or(|(own, others)| own == others);
        (!is_of_task || !is_held_alike).then(|| (other.in_words(), self.in_words()))
    }

    /// That a recording is of this world.
    ///
    /// # Errors
    /// [`TrainError::OtherWorld`].
    pub fn check(&self, recording: &Recording) -> Result<()> {
        match self.difference(&Self::of(recording)) {
            None => Ok(()),
            Some((found, learned)) => Err(TrainError::OtherWorld { found, learned, path: recording.path().to_owned() }),
        }
    }

    fn in_words(&self) -> String {
        match self.action_repeat {
            Some(repeat) => format!("{} with each action held for {repeat} control steps", self.task),
            None => self.task.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn world(task: &str, action_repeat: Option<u32>) -> LearnedWorld {
        LearnedWorld { task: task.to_owned(), action_repeat, is_imported: false }
    }

    #[test]
    fn another_task_or_another_action_repeat_is_another_world() {
        let own = world("coins", Some(2));
        assert_eq!(own.difference(&own), None);
        let (found, learned) = own.difference(&world("cups", Some(2))).unwrap();
        assert!(found.starts_with("cups ") && learned.starts_with("coins "), "{found}, {learned}");
        let (found, learned) = own.difference(&world("coins", Some(4))).unwrap();
        assert!(found.contains("held for 4") && learned.contains("held for 2"), "{found}, {learned}");
    }

    #[test]
    fn what_is_not_known_is_no_difference() {
        let gone = world("coins", None);
        assert_eq!(gone.difference(&world("coins", Some(4))), None);
        assert!(gone.difference(&world("cups", Some(4))).is_some());
        let imported = LearnedWorld { is_imported: true, ..world("coins_v3.hdf5", Some(4)) };
        assert_eq!(imported.difference(&world("coins", Some(4))), None);
        assert!(world("coins", Some(2)).difference(&imported).is_some(), "its actions are held all the same");
    }
}
