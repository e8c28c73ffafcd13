//! The folder of a run without a world model. In: options, a learner. Out: everything that is needed to go on exactly where it stopped, and to use the agent.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use vibes_data::{FolderLock, Recording, RunFolder};

use super::State;
use crate::checkpoints;
use crate::error::{Result, TrainError, io, malformed};
use crate::json::write_json;
use crate::learners::model_free::{AgentOptions, ModelFreeLearner};
use crate::learners::sac::options::Size;
use crate::online::options::{OnlineOptions, difference, flag};
use crate::online::prepare::check_length;
use crate::summary::write_model_free_summary;
use crate::windows::{Purpose, update_rng};

/// The format's name in `model_free.json`.
pub const FORMAT: &str = vibes_data::MODEL_FREE_FORMAT;
const STATE: &str = "state.json";
/// Most updates for every agent step: far more than anybody has time for, and few enough to count.
const MOST_UPDATES_PER_STEP: f64 = 1e4;
/// Checkpoints that are kept.
const KEEP: usize = 3;

/// The resolved options of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelFreeOptions {
    /// Always `vibes-model-free-run/1`.
    pub format: String,
    /// The system whose options these began as.
    pub system: String,
    /// The size they began as; results are labelled by it.
    pub size: Size,
    /// Seed of everything.
    pub seed: u64,
    /// The agent.
    pub agent: AgentOptions,
    /// Updates that an agent step pays for.
    pub updates_per_step: f64,
    /// Episodes between checkpoints.
    pub save_every: u32,
    /// World, length and evaluation, as for agents with a world model; what concerns imagination and given recordings is not used.
    pub online: OnlineOptions,
}

impl ModelFreeOptions {
    /// A learner before its first update, for this world.
    ///
    /// # Errors
    /// There is no such task, or it is seen through vectors, or its pictures are too small.
    pub fn learner(&self, device: &Device) -> Result<ModelFreeLearner> {
        let mut rng = update_rng(self.seed, 0, Purpose::Calibration);
        self.agent.learner(&self.online.world.spec()?, &mut rng, device)
    }

    /// These for a run that was begun as the same system: a system's own numbers stay what they were then.
    fn going_on(self, found: &Self) -> Self {
        if (&self.system, self.size) != (&found.system, found.size) {
            return self;
        }
        Self { agent: self.agent.going_on(&found.agent), ..self }
    }

    /// The first option that these may not differ in from those of the run that is there; how long to go on may change from one call to the next.
    fn first_difference(&self, found: &Self) -> Option<(String, String, String)> {
        let is_published = found.online.protocol.is_some();
        let fixed = |options: &Self| {
            // These agents do not look at the noise of exploration, and older files say another number.
            let online = OnlineOptions { exploration: 0.0, ..options.online.clone() };
            let mut value = serde_json::to_value(Self { save_every: 0, ..options.clone() }).unwrap_or_default();
            value["online"] = online.fixed(is_published);
            value
        };
        let [found, asked] = [found, self].map(fixed);
        difference("", &found, &asked)
    }

    /// The same for a file of the run.
    fn stored(&self, run: &Path) -> Self {
        Self { online: self.online.stored(run), ..self.clone() }
    }
}

/// A run's folder on disk.
#[derive(Debug, Clone)]
pub struct Folder {
    folder: RunFolder,
    options: ModelFreeOptions,
    // Held while the run is written; a run that is only read has none.
    _lock: Option<Arc<FolderLock>>,
}

impl Folder {
    /// Begins a run, or opens the one that is there if it was begun with the same options; this process owns the folder until the run is dropped.
    ///
    /// # Errors
    /// Another run is there, another process writes into it, an option makes no sense, or the folder cannot be written.
    pub fn create_or_open(path: &Path, options: ModelFreeOptions) -> Result<Self> {
        options.online.check()?;
        options.agent.check_pictures(&options.online.world.spec()?)?;
        let [length, batch] = options.agent.windows();
        check_length(&options.online, length)?;
        if batch == 0 {
            return Err(TrainError::Options("--transitions is 0; it must be above 0".to_owned()));
        }
        if !(options.updates_per_step > 0.0 && options.updates_per_step <= MOST_UPDATES_PER_STEP) {
            let (given, most) = (options.updates_per_step, MOST_UPDATES_PER_STEP);
            let text = format!("--updates-per-step is {given}; it must be above 0 and at most {most}");
            return Err(TrainError::Options(text));
        }
        let folder = RunFolder::at(path);
        let lock = Some(Arc::new(FolderLock::acquire(path)?));
        if folder.info_path().exists() {
            return Err(other(path, "agent", "dreamer", &options.system));
        }
        checkpoints::recover(&folder)?;
        let found = Self::open(path)?.map(|found| found.options);
        let options = match &found {
            Some(found) => options.going_on(found),
            None => options,
        };
        match &found {
            None => options.online.check_new(false)?,
            Some(found) => {
                if let Some((key, found, asked)) = options.stored(path).first_difference(&found.stored(path)) {
                    return Err(other(path, &flag(&key), &found, &asked));
                }
                options.online.check_held_out(&found.online, path)?;
            }
        }
        fs::create_dir_all(path.join("checkpoints")).map_err(io("create", path))?;
        write_json(&folder.model_free_path(), &options.stored(path))?;
        Ok(Self { folder, options, _lock: lock })
    }

    /// Opens a run to read it; none if there is none of this kind.
    ///
    /// # Errors
    /// Its file is damaged.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let folder = RunFolder::at(path);
        let file = folder.model_free_path();
        let text = match fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io("read", &file)(error)),
        };
        let options: ModelFreeOptions = serde_json::from_str(&text)
            .map_err(|error| malformed(&file, error, "a model_free.json as `vibes-train online --agent` writes it"))?;
        if options.format != FORMAT {
            return Err(malformed(&file, format!("format {}", options.format), "this program reads it of version 1"));
        }
        let online = OnlineOptions { world: options.online.world.found(path), ..options.online };
        Ok(Some(Self { folder, options: ModelFreeOptions { online, ..options }, _lock: None }))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Where its files lie.
    pub fn places(&self) -> &RunFolder {
        &self.folder
    }

    /// Its options.
    pub fn options(&self) -> &ModelFreeOptions {
        &self.options
    }

    /// What it learned from: its replay, if anything was lived through yet.
    ///
    /// # Errors
    /// The recording is damaged.
    pub fn open_recordings(&self) -> Result<Vec<Recording>> {
        let replay = self.path().join("replay");
        if replay.exists() { Ok(vec![Recording::open(&replay)?]) } else { Ok(Vec::new()) }
    }

    /// Saves a checkpoint, whole or not at all, and lets go of the oldest.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&self, learner: &ModelFreeLearner, state: State) -> Result<()> {
        checkpoints::put(&self.folder, state.update, KEEP, |folder| {
            learner.save(folder).map_err(|error| self.diverged(error, state.update.saturating_sub(1)))?;
            write_json(&folder.join(STATE), &state)
        })?;
        write_model_free_summary(self.places())
    }

    /// The learner of the newest checkpoint and where it stood; none if nothing was saved yet.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn resume(&self, device: &Device) -> Result<Option<(ModelFreeLearner, State)>> {
        checkpoints::newest(&self.folder, |folder| {
            let file = folder.join(STATE);
            let text = fs::read_to_string(&file).map_err(io("read", &file))?;
            let state = serde_json::from_str(&text)
                .map_err(|error| malformed(&file, error, "a state.json as `vibes-train` writes it"))?;
            Ok((ModelFreeLearner::load(folder, device)?, state))
        })
    }

    /// A number that is none, said with the update it was met in and where to go on; other errors as they are.
    pub fn diverged(&self, error: TrainError, update: u64) -> TrainError {
        match error {
            TrainError::NotFinite { what, value } => {
                // The step sizes are the system's own.
                let remedy = "another --seed or --system";
                let is_kept = !self.folder.checkpoints().is_empty();
                TrainError::Diverged { update: update + 1, what, value, is_kept, remedy, run: self.path().to_owned() }
            }
            other => other,
        }
    }
}

fn other(path: &Path, key: &str, found: &str, asked: &str) -> TrainError {
    TrainError::OtherRun {
        key: key.to_owned(),
        found: found.to_owned(),
        asked: asked.to_owned(),
        path: path.to_owned(),
    }
}
