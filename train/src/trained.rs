//! A run folder of either kind, opened to be read. In: a folder. Out: the weights of its newest checkpoint, what it learned from, where its files lie. The one place that
//! tells the two kinds of folders apart.

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use vibes_data::{Recording, RunFolder};
use vibes_model::trained::{Trained, encoder_file};

use crate::error::Result;
use crate::online::model_free::folder::Folder;
use crate::online::options::OnlineOptions;
use crate::run::{Run, Seen};
use crate::same_world::LearnedWorld;

/// A run, opened to be read.
#[derive(Debug, Clone)]
pub enum TrainedRun {
    /// A world model, with or without an actor.
    World(Box<Run>),
    /// An agent without a world model.
    ModelFree(Box<Folder>),
}

impl TrainedRun {
    /// Opens a run.
    ///
    /// # Errors
    /// There is none, or its `run.json` or `model_free.json` is damaged.
    pub fn open(path: &Path) -> Result<Self> {
        Ok(match Folder::open(path)? {
            Some(folder) => Self::ModelFree(Box::new(folder)),
            None => Self::World(Box::new(Run::open(path)?)),
        })
    }

    /// Where its files lie.
    pub fn places(&self) -> &RunFolder {
        match self {
            Self::World(run) => run.places(),
            Self::ModelFree(folder) => folder.places(),
        }
    }

    /// The recordings it learned from; of an agent that was given none, what it lived through.
    ///
    /// # Errors
    /// One of them is gone or damaged.
    pub fn open_recordings(&self) -> Result<Vec<Recording>> {
        match self {
            Self::World(run) if run.info().recordings.is_empty() => {
                Ok(vec![Recording::open(&run.path().join("replay"))?])
            }
            Self::World(run) => run.open_recordings(),
            Self::ModelFree(folder) => folder.open_recordings(),
        }
    }

    /// What its weights have learned from.
    pub fn seen(&self) -> Seen {
        match self {
            Self::World(run) => run.seen(),
            Self::ModelFree(folder) => match folder.open_recordings() {
                // A copy may lack the replay, without which nobody knows what the weights have learned from.
                Ok(recordings) => Seen { is_whole: !recordings.is_empty(), recordings },
                Err(_gone) => Seen { recordings: Vec::new(), is_whole: false },
            },
        }
    }

    /// The world that it has learned from.
    ///
    /// # Errors
    /// The `online.json` of an online run is damaged.
    pub fn world(&self) -> Result<LearnedWorld> {
        let run = match self {
            Self::World(run) => run,
            Self::ModelFree(folder) => {
                let world = &folder.options().online.world;
                let action_repeat = Some(world.action_repeat);
                return Ok(LearnedWorld { task: world.task.clone(), action_repeat, is_imported: false });
            }
        };
        let lived = OnlineOptions::read(run.path())?.map(|options| options.world.action_repeat);
        let recorded = run.recordings_left().first().map(LearnedWorld::of);
        let action_repeat = lived.or(recorded.as_ref().and_then(|world| world.action_repeat));
        let is_imported = recorded.is_some_and(|world| world.is_imported);
        Ok(LearnedWorld { task: run.info().model.task.clone(), action_repeat, is_imported })
    }

    /// The weights of the newest checkpoint, and the file they are in.
    ///
    /// # Errors
    /// There is no checkpoint, or a file is damaged.
    pub fn load(&self, device: &Device) -> Result<(Trained, PathBuf)> {
        let checkpoint = self.places().newest_checkpoint()?;
        let trained = Trained::load(&checkpoint, device)?;
        let file = encoder_file(&checkpoint).unwrap_or_default();
        Ok((trained, checkpoint.join(file)))
    }
}
