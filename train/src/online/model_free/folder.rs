//! The folder of a run without a world model. In: options, a learner. Out: everything that is needed to go on exactly where it stopped, and to use the agent.

use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use vibes_model::sac::SacConfig;

use super::State;
use crate::error::{Result, TrainError, io, malformed};
use crate::json::write_json;
use crate::learners::sac::checkpoint::NETWORKS;
use crate::learners::sac::options::{SacOptions, Size};
use crate::learners::sac::update::SacLearner;
use crate::online::options::OnlineOptions;

/// The format's name in `model_free.json`.
pub const FORMAT: &str = "vibes-model-free-run/1";
const FILE: &str = "model_free.json";
const STATE: &str = "state.json";
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
    pub agent: SacOptions,
    /// Updates that an agent step pays for.
    pub updates_per_step: f64,
    /// Episodes between checkpoints.
    pub save_every: u32,
    /// World, length and evaluation, as for agents with a world model; what concerns imagination and given recordings is not used.
    pub online: OnlineOptions,
}

impl ModelFreeOptions {
    /// The networks for this world.
    ///
    /// # Errors
    /// There is no such task, or it is seen through vectors.
    pub fn networks(&self) -> Result<SacConfig> {
        let spec = self.online.world.spec()?;
        let Some(size) = spec.pixels else {
            return Err(TrainError::Options("these agents see pictures; leave out --no-pixels".to_owned()));
        };
        let bound = |bounds: &[f64]| bounds.iter().map(|&bound| bound as f32).collect();
        let bounds = (bound(&spec.action.min), bound(&spec.action.max));
        Ok(self.agent.networks(&spec.task, [size.height as usize, size.width as usize], bounds))
    }

    /// How long to go on may change from one call to the next; nothing else.
    fn may_follow(&self, found: &Self) -> bool {
        let fixed = |options: &Self| Self {
            online: OnlineOptions {
                control_steps: 0,
                evaluate_every: 0,
                evaluation_episodes: 0,
                final_episodes: 0,
                ..options.online.clone()
            },
            save_every: 0,
            ..options.clone()
        };
        fixed(self) == fixed(found)
    }
}

/// A run's folder on disk.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
    options: ModelFreeOptions,
}

impl Folder {
    /// Begins a run, or opens the one that is there if it was begun with the same options.
    ///
    /// # Errors
    /// Another run is there, an option makes no sense, or the folder cannot be written.
    pub fn create_or_open(path: &Path, options: ModelFreeOptions) -> Result<Self> {
        options.online.check()?;
        options.networks()?;
        if !(options.updates_per_step.is_finite() && options.updates_per_step > 0.0) {
            let text = format!("--updates-per-step is {}; it must be above 0", options.updates_per_step);
            return Err(TrainError::Options(text));
        }
        if path.join("run.json").exists() {
            return Err(other(path, "agent", "dreamer", &options.system));
        }
        if let Some(found) = Self::open(path)?
            && !options.may_follow(&found.options)
        {
            return Err(other(path, "options", &found.options.system, &options.system));
        }
        fs::create_dir_all(path.join("checkpoints")).map_err(io("create", path))?;
        write_json(&path.join(FILE), &options)?;
        Ok(Self { path: path.to_owned(), options })
    }

    /// Opens a run; none if there is none of this kind.
    ///
    /// # Errors
    /// Its file is damaged.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let file = path.join(FILE);
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
        Ok(Some(Self { path: path.to_owned(), options }))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its options.
    pub fn options(&self) -> &ModelFreeOptions {
        &self.options
    }

    /// The numbers over time.
    pub fn metrics_path(&self) -> PathBuf {
        self.path.join("metrics.jsonl")
    }

    /// The evaluations.
    pub fn evaluations_path(&self) -> PathBuf {
        self.path.join("evaluations.jsonl")
    }

    /// The folder of the newest checkpoint; none before the first.
    pub fn newest(&self) -> Option<PathBuf> {
        self.checkpoints().pop()
    }

    /// The networks' file of the newest checkpoint.
    ///
    /// # Errors
    /// There is none yet.
    pub fn newest_networks(&self) -> Result<PathBuf> {
        let newest = self.newest().ok_or_else(|| vibes_data::Error::NoCheckpoint { path: self.path.clone() })?;
        Ok(newest.join(NETWORKS))
    }

    fn checkpoints(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path.join("checkpoints")).into_iter().flatten().flatten();
        let is_number = |path: &PathBuf| {
            path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.parse::<u64>().is_ok())
        };
        let mut found: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_number).collect();
        found.sort();
        found
    }

    /// Saves a checkpoint, whole or not at all, and lets go of the oldest.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&self, learner: &SacLearner, state: State) -> Result<()> {
        let checkpoints = self.path.join("checkpoints");
        let (place, partial) = (checkpoints.join(format!("{:08}", state.update)), checkpoints.join(".partial"));
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(io("remove", &partial))?;
        }
        fs::create_dir_all(&partial).map_err(io("create", &partial))?;
        learner.save(&partial).map_err(|error| self.diverged(error, state.update))?;
        write_json(&partial.join(STATE), &state)?;
        if place.exists() {
            fs::remove_dir_all(&place).map_err(io("remove", &place))?;
        }
        fs::rename(&partial, &place).map_err(io("rename", &place))?;
        let found = self.checkpoints();
        for old in &found[..found.len().saturating_sub(KEEP)] {
            fs::remove_dir_all(old).map_err(io("remove", old))?;
        }
        Ok(())
    }

    /// The learner of the newest checkpoint and where it stood; none if nothing was saved yet.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn resume(&self, device: &Device) -> Result<Option<(SacLearner, State)>> {
        let Some(newest) = self.newest() else { return Ok(None) };
        let file = newest.join(STATE);
        let text = fs::read_to_string(&file).map_err(io("read", &file))?;
        let state = serde_json::from_str(&text)
            .map_err(|error| malformed(&file, error, "a state.json as `vibes-train` writes it"))?;
        Ok(Some((SacLearner::load(&newest, device)?, state)))
    }

    /// A number that is none, said with the update it was met in and where to go on; other errors as they are.
    pub fn diverged(&self, error: TrainError, update: u64) -> TrainError {
        match error {
            TrainError::NotFinite { what, value } => {
                TrainError::Diverged { update: update + 1, what, value, run: self.path.clone() }
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
