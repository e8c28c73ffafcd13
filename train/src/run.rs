//! A run folder. In: options, recordings and a learner. Out: everything that is needed to go on exactly where it stopped, and to use the model.
//!
//! ```text
//! run.json                          options, model, recordings, versions
//! config.toml                       the options alone; `--config` reads it
//! metrics.jsonl                     one line every few updates
//! evaluations.jsonl                 with `--eval`: one line every few updates
//! events.out.tfevents.*             the same numbers for TensorBoard
//! summary.md                        one page about all of it
//! checkpoints/000500/
//!     model.safetensors             weights, with the model's configuration in the metadata
//!     optimizer.safetensors         Adam's moments
//!     state.json                    updates made, Adam's steps, seconds trained
//! latents.arrow                     from `vibes-train encode`
//! ```
//!
//! A checkpoint is written beside its place and renamed, so it is there whole or not at all. The random numbers of an update follow from the seed and the update's
//! number, counted on from the run before, so the number is the whole random state.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use vibes_data::{FolderLock, Recording, RunFolder, is_same_place, write_atomically};
use vibes_model::checkpoint::{load_tensors, load_weights, save_tensors};
use vibes_model::parameters::{HostTensors, read_parameters};
use vibes_model::{HeadConfig, Model, ModelConfig};

use crate::checkpoints;
use crate::error::{Result, TrainError, io, malformed};
use crate::gate::Gate;
use crate::json::{is_zero, write_json};
use crate::learners::optimizer::counts;
use crate::learners::world::Learner;
use crate::options::Options;

mod chain;
mod differences;
mod fingerprint;
mod same;

use fingerprint::Fingerprint;

pub use chain::{Chain, Link, Seen};
pub(crate) use differences::differences;

/// What `run.json` holds, with this package's own options and model.
pub type RunInfo = vibes_data::RunInfo<Options, ModelConfig>;

/// What `state.json` holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Updates made.
    pub update: u64,
    /// Adam's steps of the world model.
    pub optimizer_steps: u64,
    /// Adam's steps of the adversary.
    pub adversary_optimizer_steps: u64,
    /// Seconds trained, over every time the run was continued.
    pub seconds: f64,
    /// Updates made by the run that this one went on from, which schedules count on from.
    #[serde(default)]
    pub carried: u64,
    /// The [drawn](Self::drawn) number from which on the weights are new ones, where an online run began them anew: schedules count from it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub anew_from: u64,
    /// Whether the dynamics term reaches the encoder yet.
    #[serde(default, alias = "hearing")]
    pub gate: Gate,
}

impl State {
    /// The number under which the next update's windows and noise are drawn: it goes on from that of the run before, so that none of its draws comes again.
    pub fn drawn(&self) -> u64 {
        self.carried + self.update
    }

    /// Updates that these weights have behind them, of the run before too: what schedules go by.
    pub fn scheduled(&self) -> u64 {
        self.drawn() - self.anew_from
    }

    /// The state in which new weights take the place of those that were there; updates and draws are counted on.
    #[must_use]
    pub fn anew(self) -> Self {
        Self {
            optimizer_steps: 0,
            adversary_optimizer_steps: 0,
            anew_from: self.drawn(),
            gate: Gate::default(),
            ..self
        }
    }
}

/// A run folder on disk.
#[derive(Debug, Clone)]
pub struct Run {
    folder: RunFolder,
    info: RunInfo,
    held_before: Option<(usize, u64)>,
    /// Of its recordings, in their order; none of a run that is only read.
    fingerprints: Vec<Fingerprint>,
    // Held while the run is written; a run that is only read has none.
    _lock: Option<Arc<FolderLock>>,
}

impl Run {
    /// Begins a run on these recordings, or opens the one that is there if it was begun with the same options; this process owns the folder until the run is dropped.
    ///
    /// # Errors
    /// Another run is there, another process writes into it, or the folder cannot be written.
    pub fn create_or_open(path: &Path, info: RunInfo, recordings: &[Recording]) -> Result<Self> {
        let folder = RunFolder::at(path);
        let fingerprints = recordings.iter().map(Fingerprint::of).collect();
        let lock = Some(Arc::new(FolderLock::acquire(path)?));
        if !folder.info_path().exists() && !folder.model_free_path().exists() {
            fs::create_dir_all(path.join("checkpoints")).map_err(io("create", path))?;
            let run = Self { folder, info, held_before: None, fingerprints, _lock: lock };
            run.write_info()?;
            return Ok(run);
        }
        checkpoints::recover(&folder)?;
        let found = Self::open(path)?;
        found.check_same(&info, recordings)?;
        let held = |info: &RunInfo| (info.episodes, info.steps);
        let held_before = Some(held(&found.info)).filter(|before| *before != held(&info));
        let info = RunInfo { from: found.info.from, began_with: found.info.began_with, ..info };
        let run = Self { folder, info, held_before, fingerprints, _lock: lock };
        run.write_info()?;
        Ok(run)
    }

    /// Opens a run to read it.
    ///
    /// # Errors
    /// There is none, or one without a world model, or its `run.json` is damaged.
    pub fn open(path: &Path) -> Result<Self> {
        let folder = RunFolder::at(path);
        if folder.model_free_path().exists() {
            return Err(TrainError::NoWorldModel { path: path.to_owned() });
        }
        let info = folder.info()?;
        Ok(Self { folder, info, held_before: None, fingerprints: Vec::new(), _lock: None })
    }

    /// What `run.json` says.
    pub fn info(&self) -> &RunInfo {
        &self.info
    }

    /// Episodes and steps that its recordings held when it was last trained, where they hold others now: what is drawn from here on is another than without that.
    pub fn held_before(&self) -> Option<(usize, u64)> {
        self.held_before
    }

    /// The folder's own name.
    pub fn name(&self) -> String {
        self.folder.name()
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Where its files lie.
    pub fn places(&self) -> &RunFolder {
        &self.folder
    }

    /// The metrics.
    pub fn metrics_path(&self) -> PathBuf {
        self.folder.metrics_path()
    }

    /// The evaluations made while training.
    pub fn evaluations_path(&self) -> PathBuf {
        self.folder.evaluations_path()
    }

    /// The recordings it learned from.
    ///
    /// # Errors
    /// One of them is neither where it was nor anywhere near the run.
    pub fn open_recordings(&self) -> Result<Vec<Recording>> {
        self.info.recordings.iter().map(|place| self.open_recording(place)).collect()
    }

    /// Those of them that are still there.
    pub fn recordings_left(&self) -> Vec<Recording> {
        self.info.recordings.iter().filter_map(|place| self.open_recording(place).ok()).collect()
    }

    /// What its weights have learned from, those of the runs that it goes on from included, and what it lived through itself.
    pub fn seen(&self) -> Seen {
        self.chain().seen()
    }

    /// The runs that it goes on from, the last one first, as far back as they are there; and whether that is to the first.
    pub fn before(&self) -> (Vec<Self>, bool) {
        let (mut runs, mut from) = (Vec::<Self>::new(), self.open_from());
        while let Ok(Some(run)) = from {
            // A copy names the run before it by its name alone: where that leads back, it is another one that is gone.
            if std::iter::once(self).chain(&runs).any(|known| is_same_place(known.path(), run.path())) {
                return (runs, false);
            }
            from = run.open_from();
            runs.push(run);
        }
        (runs, from.is_ok())
    }

    fn open_recording(&self, place: &str) -> Result<Recording> {
        let path = self.folder.find_recording(place).unwrap_or_else(|| self.path().join(place));
        Ok(Recording::open(&path)?)
    }

    /// The run this one goes on from, if it did not begin anew.
    ///
    /// # Errors
    /// The other run is neither where it was nor anywhere near this one.
    pub fn open_from(&self) -> Result<Option<Self>> {
        let Some(place) = &self.info.from else { return Ok(None) };
        let path = self.folder.find_run(place).unwrap_or_else(|| self.path().join(place));
        Ok(Some(Self::open(&path)?))
    }

    /// Every checkpoint's number of updates, ascending.
    pub fn checkpoints(&self) -> Vec<u64> {
        self.folder.checkpoints()
    }

    /// The folder of a checkpoint.
    pub fn checkpoint_path(&self, update: u64) -> PathBuf {
        self.folder.checkpoint_path(update)
    }

    /// The model file of the newest checkpoint.
    ///
    /// # Errors
    /// There is none yet.
    pub fn newest_model(&self) -> Result<PathBuf> {
        Ok(self.folder.newest_model()?)
    }

    /// Saves a checkpoint, with whatever `more` writes into its folder, whole or not at all, and lets go of the oldest beyond those to keep.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn save(&self, learner: &Learner, state: State, more: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        checkpoints::put(&self.folder, state.update, self.info.options.keep, |folder| {
            learner.model.save(&folder.join("model.safetensors"))?;
            let mut moments = learner.optimizer.to_tensors("world");
            moments.extend(learner.adversary_optimizer.to_tensors("adversary"));
            save_tensors(&folder.join("optimizer.safetensors"), &moments, HashMap::new())?;
            write_json(&folder.join("state.json"), &state)?;
            more(folder)
        })
    }

    /// The learner of the newest checkpoint and where it stood; none if nothing was saved yet. A [kept](crate::keep) checkpoint has no moments: Adam begins anew.
    ///
    /// # Errors
    /// A file is missing or damaged, the moments of another checkpoint than a kept one among them.
    pub fn resume(&self, device: &Device) -> Result<Option<(Learner, State)>> {
        checkpoints::newest(&self.folder, |folder| {
            let model = Model::load(&folder.join("model.safetensors"), device)?;
            let state = read_state(&folder.join("state.json"))?;
            let mut learner = Learner::new(model, &self.info.options, device);
            restore_moments(&mut learner, folder, state, device)?;
            Ok((learner, state))
        })
    }

    /// What another run begins with that goes on from this one's newest checkpoint under `options`: weights, moments of both optimisers, gate (closed where this run did not wait and the other does), and how far its
    /// schedules have come. A checkpoint of weights alone counts as one whose gate is open; where moments are missing, Adam begins anew. Heads that `wanted` has and this run
    /// lacks begin anew, heads that it no longer has are left behind.
    ///
    /// # Errors
    /// Nothing was saved yet, or a file is damaged.
    pub fn carry_over(
        &self,
        options: &Options,
        wanted: &ModelConfig,
        rewards: Option<&[f32]>,
        device: &Device,
    ) -> Result<(Learner, State)> {
        let heads = Heads { before: &self.info.model.heads, after: &wanted.heads };
        let made = self.checkpoints().last().copied().unwrap_or(0);
        let carried = checkpoints::newest(&self.folder, |folder| {
            let (weights, _) = load_weights(&folder.join("model.safetensors"))?;
            let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
            let mut model = heads.carry(wanted.clone(), weights, &mut rng, device)?;
            if let Some(rewards) = rewards {
                // Before the learner is made, which makes all weights ready to be learned.
                model.world = options.objective.calibrated(model.world, rewards);
            }
            let mut learner = Learner::new(model, options, device);
            if !folder.join("state.json").exists() {
                let gate = Gate { gain: 0.0, opened: Some(0) };
                return Ok((learner, State { carried: made, gate, ..State::default() }));
            }
            let before = read_state(&folder.join("state.json"))?;
            let file = folder.join("optimizer.safetensors");
            if file.exists() {
                let (moments, _) = load_tensors(&file)?;
                restore(&mut learner, &heads.renamed(moments), before, &file, device)?;
            }
            // An objective that did not wait says nothing of what one that waits asks for.
            let waited = |options: &Options| options.objective.gate(options).is_some();
            let begins_to_wait = waited(options) && !waited(&self.info.options);
            let gate = if begins_to_wait { Gate::default() } else { before.gate };
            Ok((learner, State { update: 0, seconds: 0.0, carried: before.drawn(), gate, ..before }))
        })?;
        carried.ok_or_else(|| vibes_data::Error::NoCheckpoint { path: self.path().to_owned() }.into())
    }

    /// A number that is none, said with the update it was met in and where to go on; other errors as they are.
    pub fn diverged(&self, error: TrainError, update: u64) -> TrainError {
        match error {
            TrainError::NotFinite { what, value } => {
                let is_kept = !self.checkpoints().is_empty();
                let remedy = match is_kept {
                    _ if self.path().join("online.json").exists() => {
                        "from the beginning, with another -o and lower step sizes (--lr, --actor-lr, --critic-lr)"
                    }
                    true => "to go on from here with --from, another -o and a lower --lr",
                    false => "from the beginning, with another -o and a lower --lr",
                };
                TrainError::Diverged { update: update + 1, what, value, is_kept, remedy, run: self.path().to_owned() }
            }
            other => other,
        }
    }

    fn write_info(&self) -> Result<()> {
        fingerprint::write(&self.folder.info_path(), &self.info, &self.fingerprints)?;
        let file = self.path().join("config.toml");
        let text = toml::to_string(&self.info.options)
            .map_err(|error| malformed(&file, error, "options that TOML can hold"))?;
        Ok(write_atomically(&file, text.as_bytes())?)
    }
}

fn read_state(file: &Path) -> Result<State> {
    let text = fs::read_to_string(file).map_err(io("read", file))?;
    serde_json::from_str(&text).map_err(|error| malformed(file, error, "a state.json as `vibes-train` writes it"))
}

fn restore_moments(learner: &mut Learner, folder: &Path, state: State, device: &Device) -> Result<()> {
    let file = folder.join("optimizer.safetensors");
    let is_without = || state.optimizer_steps == 0 || is_in_half(&folder.join("model.safetensors"));
    if !file.exists() && is_without() {
        return Ok(());
    }
    let (moments, _) = load_tensors(&file)?;
    restore(learner, &moments, state, &file, device)
}

/// Whether weights are in half precision, as those of a kept copy are, which has no moments. The file opens with the length of its header, a list of its tensors in JSON.
fn is_in_half(file: &Path) -> bool {
    let Ok(bytes) = fs::read(file) else { return false };
    let Some((length, rest)) = bytes.split_first_chunk() else { return false };
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    let header: Option<serde_json::Value> = rest.get(..length).and_then(|text| serde_json::from_slice(text).ok());
    let tensors = header.as_ref().and_then(|header| header.as_object());
    tensors.is_some_and(|tensors| tensors.values().any(|tensor| tensor["dtype"] == "F16"))
}

fn restore(learner: &mut Learner, moments: &HostTensors, state: State, file: &Path, device: &Device) -> Result<()> {
    let (from, Model { world, adversary, .. }) = ((moments, file), &learner.model);
    learner.optimizer.restore("world", &counts(world), from, state.optimizer_steps, device)?;
    // Moments may be there of an adversary that a run before had and this one has not.
    let Some(adversary) = adversary else { return Ok(()) };
    let steps = state.adversary_optimizer_steps;
    learner.adversary_optimizer.restore("adversary", &counts(adversary), from, steps, device)
}

/// The heads of a model and of the one that goes on from it; they go by their names, their tensors by their places.
struct Heads<'a> {
    before: &'a [HeadConfig],
    after: &'a [HeadConfig],
}

impl Heads<'_> {
    /// The model `wanted` with these weights, its further heads as drawn from `rng`.
    fn carry(&self, wanted: ModelConfig, weights: HostTensors, rng: &mut ChaCha8Rng, device: &Device) -> Result<Model> {
        let model = Model::init(wanted, rng, device)?;
        let drawn = read_parameters(&model.world, "world");
        let mut tensors = self.renamed(weights);
        for (name, tensor) in drawn.into_iter().filter(|(name, _)| name.starts_with("world.heads.")) {
            tensors.entry(name).or_insert(tensor);
        }
        Ok(model.with_parameters(&tensors)?)
    }

    /// Tensors by the names that they have in the model that goes on.
    fn renamed(&self, tensors: HostTensors) -> HostTensors {
        tensors.into_iter().filter_map(|(name, tensor)| Some((self.rename(&name)?, tensor))).collect()
    }

    /// `….heads.3.mlp…` with the place of the head of that name and size, nothing if there is none.
    fn rename(&self, name: &str) -> Option<String> {
        let Some((front, rest)) = name.split_once("heads.") else { return Some(name.to_owned()) };
        let (place, tail) = rest.split_once('.')?;
        let head = self.before.get(place.parse::<usize>().ok()?)?;
        let place = self.after.iter().position(|other| other == head)?;
        Some(format!("{front}heads.{place}.{tail}"))
    }
}

/// Versions of what the numbers depend on.
pub fn versions() -> BTreeMap<String, String> {
    let versions = [("vibes-train", env!("CARGO_PKG_VERSION")), ("burn", env!("VIBES_BURN_VERSION"))];
    versions.into_iter().map(|(name, version)| (name.to_owned(), version.to_owned())).collect()
}
