//! A Minari dataset, in its HDF5 or its Arrow storage. Aligned as ours: T + 1 observations, T actions and rewards, reward t earned by action t.
//!
//! In: the dataset's folder, or its `data` folder. `metadata.json` names the storage and the spaces. A dataset that was exported from a recording brings the
//! recording's own header back, and with it states, distractors, cells and videos; of any other, float observations become parts of the
//! vector observation, `uint8` of `[height, width, 3]` or `[3, height, width]` the picture, and what is in `infos` is left out.

mod spaces;
mod store;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::Deserialize;
use serde_json::Value;
use vibes_data::{
    ActionSpec, BackgroundFrame, CameraPose, Cell, Episode, EpisodeInfo, FORMAT, Grid, Manifest, ObservationPart,
    RecordingWriter, Spec, Video,
};

use self::spaces::{Leaf, LeafKind, Space};
use self::store::{EpisodeStore, Store};
use super::array::Array;
use super::{
    ImportFormat, ImportOptions, ImportReport, begin, bounds_of, check_observed, go_on, in_episode,
    without_distractors, write_checked,
};
use crate::error::{Error, Result};
use crate::paths::rebase;

/// What is read of a dataset's metadata.
#[derive(Debug, Deserialize)]
struct Metadata {
    total_episodes: u32,
    data_format: Option<String>,
    observation_space: Option<String>,
    action_space: Option<String>,
    dataset_id: Option<String>,
    algorithm_name: Option<String>,
    vibes: Option<Header>,
}

/// The header of the recording that was exported.
#[derive(Debug, Deserialize)]
struct Header {
    spec: Spec,
    options: Value,
    seed: u64,
    versions: std::collections::BTreeMap<String, String>,
    grid: Option<Grid>,
    videos: Vec<Video>,
}

/// What an exported episode says of itself.
#[derive(Debug, Deserialize)]
struct EpisodeHeader {
    index: u32,
    cell: Option<Cell>,
    #[serde(default)]
    acting_distractor: Option<u32>,
    policy: String,
    model_overrides: Value,
}

/// A dataset that was opened and understood.
struct Dataset {
    folder: PathBuf,
    metadata: Metadata,
    observations: Vec<Leaf>,
    action: Leaf,
    store: Store,
}

/// Reads a dataset into a recording at `out`.
pub(super) fn read(source: &Path, options: &ImportOptions, out: &Path, stop: &AtomicBool) -> Result<ImportReport> {
    let dataset = Dataset::open(source)?;
    let mut report = ImportReport { ignored: dataset.ignored(), ..ImportReport::default() };
    let (writer, spec) = dataset.begin(options, &report.ignored, out, stop)?;
    let policy = dataset.metadata.algorithm_name.clone().filter(|name| !name.is_empty());
    for place in 0..dataset.metadata.total_episodes {
        go_on(stop)?;
        let read = dataset.episode(place, policy.as_deref().unwrap_or("imported"));
        let (episode, info) = read.map_err(in_episode(place))?;
        match &dataset.metadata.vibes {
            // What a recording held is what it gets back.
            Some(_) => writer.write(&episode, info)?,
            None => write_checked(&writer, &spec, &episode, info, &dataset.store.path(place))?,
        }
        report.episodes += 1;
        report.rows += episode.rows() as u64;
    }
    writer.finish()?;
    Ok(report)
}

/// The episodes of a dataset, for tests and fuzzing.
///
/// # Errors
/// [`Error::Malformed`] for a damaged file, or columns that are not those of the spaces.
pub fn read_minari_folder(source: &Path) -> Result<Vec<Episode>> {
    let dataset = Dataset::open(source)?;
    (0..dataset.metadata.total_episodes).map(|place| Ok(dataset.episode(place, "imported")?.0)).collect()
}

impl Dataset {
    fn open(source: &Path) -> Result<Self> {
        let inner = source.join("data");
        let folder = if inner.join("metadata.json").is_file() { inner } else { source.to_owned() };
        let path = folder.join("metadata.json");
        let text = std::fs::read(&path).map_err(Error::io("read", &path))?;
        let broken = |fact: String| Error::malformed(&path, fact, "the metadata of a Minari dataset");
        let metadata: Metadata = serde_json::from_slice(&text).map_err(|error| broken(error.to_string()))?;
        let space = |name: &str, text: &Option<String>| -> Result<Space> {
            let text = text.as_deref().ok_or_else(|| {
                broken(format!(
                    "no {name}; load the dataset once with Minari 0.5 and save it again to have it written down"
                ))
            })?;
            Space::parse(text).map_err(|fact| broken(format!("{name}: {fact}")))
        };
        let mut observations = space("observation_space", &metadata.observation_space)?.leaves("observations");
        if let Some(header) = &metadata.vibes {
            // A Dict has its parts by name; the recording had an order of its own.
            let place = |leaf: &Leaf| header.spec.observation.iter().position(|part| part.name == leaf.name());
            observations.sort_by_key(|leaf| place(leaf).unwrap_or(usize::MAX));
        }
        let action = space("action_space", &metadata.action_space)?.leaves("actions");
        let [action] = action.try_into().map_err(|_e| broken("actions of several spaces".into()))?;
        if let LeafKind::Other(what) = &action.kind {
            return Err(broken(format!("actions are {what}; Box and Discrete are read")));
        }
        if matches!(action.kind, LeafKind::Picture { .. }) {
            return Err(broken("actions are pictures".into()));
        }
        let store = Store::open(&folder, metadata.data_format.as_deref().unwrap_or("hdf5"))?;
        Ok(Self { folder, metadata, observations, action, store })
    }

    /// What a recording has no place for: `infos` but for those of an export, of which Minari has the same in every episode.
    fn ignored(&self) -> BTreeSet<String> {
        let other = self.observations.iter().filter_map(|leaf| match &leaf.kind {
            LeafKind::Other(what) => Some(format!("{} ({what})", leaf.path.join("/"))),
            _ => None,
        });
        let mut pictures = self.observations.iter().filter(|leaf| matches!(leaf.kind, LeafKind::Picture { .. }));
        let _ = pictures.next();
        let pictures = pictures.map(|leaf| format!("{} (a second picture)", leaf.path.join("/")));
        // An episode that cannot be opened is named when it is read.
        let first = (self.metadata.vibes.is_none() && self.metadata.total_episodes > 0).then(|| self.store.episode(0));
        let infos = first.and_then(Result::ok).map_or_else(Vec::new, |episode| episode.infos());
        other.chain(pictures).chain(infos).collect()
    }

    fn name(&self) -> String {
        let folder =
            || self.folder.file_name().map_or_else(|| "minari".into(), |name| name.to_string_lossy().into_owned());
        self.metadata.dataset_id.clone().unwrap_or_else(folder)
    }

    /// The pictures' leaf: the first of them.
    fn picture(&self) -> Option<&Leaf> {
        self.observations.iter().find(|leaf| matches!(leaf.kind, LeafKind::Picture { .. }))
    }

    /// The parts of the vector observation.
    fn vectors(&self) -> impl Iterator<Item = &Leaf> {
        self.observations.iter().filter(|leaf| matches!(leaf.kind, LeafKind::Numbers { .. } | LeafKind::OneHot { .. }))
    }

    fn begin(
        &self,
        options: &ImportOptions,
        ignored: &BTreeSet<String>,
        out: &Path,
        stop: &AtomicBool,
    ) -> Result<(RecordingWriter, Spec)> {
        let name = self.name();
        if self.metadata.vibes.is_some() {
            options.check_settled(&self.folder)?;
        }
        if let Some(Header { spec, options: asked, seed, versions, grid, videos }) = &self.metadata.vibes {
            let spec = self.checked(spec.clone())?;
            let manifest = Manifest {
                format: FORMAT.into(),
                spec: spec.clone(),
                options: self.options_at(asked, out),
                seed: *seed,
                versions: versions.clone(),
                grid: *grid,
                videos: videos.clone(),
                episodes: Vec::new(),
            };
            return Ok((RecordingWriter::create_or_resume(out, manifest, options.with_mcap)?, spec));
        }
        let bounds = self.bounds(stop)?;
        let spec = self.checked(Spec {
            pixels: self.picture().and_then(Leaf::size),
            observation: self.vectors().map(|leaf| ObservationPart { name: leaf.name(), len: leaf.len() }).collect(),
            ..options.spec(&name, bounds)
        })?;
        check_observed(&spec, ignored, &self.folder.join("metadata.json"))?;
        let writer = begin(spec.clone(), ImportFormat::Minari, &name, out, options.with_mcap)?;
        Ok((writer, spec))
    }

    /// The recording's options, whose paths were those of the dataset's folder.
    fn options_at(&self, asked: &Value, out: &Path) -> Value {
        let mut options = asked.clone();
        let data = self.folder.file_name().is_some_and(|name| name == "data");
        let dataset = if data { self.folder.parent().unwrap_or(&self.folder) } else { &self.folder };
        rebase(&mut options, Some(dataset), Some(out));
        options
    }

    fn checked(&self, spec: Spec) -> Result<Spec> {
        match spec.fault() {
            None => Ok(spec),
            Some(fault) => {
                let expected = "spaces, a timestep and bounds that a recording can have";
                Err(Error::malformed(self.folder.join("metadata.json"), fault, expected))
            }
        }
    }

    /// The space's own bounds, or those of the data where the space has none.
    fn bounds(&self, stop: &AtomicBool) -> Result<ActionSpec> {
        if let Some(bounds) = self.action.bounds() {
            return Ok(bounds);
        }
        let mut bounds = None;
        for place in 0..self.metadata.total_episodes {
            go_on(stop)?;
            let actions = self.store.episode(place).and_then(|episode| episode.array(&self.action.path));
            let actions = actions.map_err(in_episode(place))?;
            bounds_of(&actions.singles(0, actions.rows()), actions.width(), &mut bounds);
        }
        let len = self.action.len();
        Ok(bounds.unwrap_or_else(|| ActionSpec { min: vec![-1.0; len], max: vec![1.0; len] }))
    }

    fn episode(&self, place: u32, policy: &str) -> Result<(Episode, EpisodeInfo)> {
        let path = self.store.path(place);
        let source = self.store.episode(place)?;
        let metadata = source.metadata()?;
        let header = metadata.get("vibes").filter(|_| self.metadata.vibes.is_some());
        let own: Option<EpisodeHeader> =
            header.map(|header| serde_json::from_value(header.clone())).transpose().map_err(|error| {
                Error::malformed(&path, format!("vibes: {error}"), "a header as `vibes-collect export` writes it")
            })?;
        let mut episode = self.columns(&source, &path)?;
        episode.index = place;
        match &self.metadata.vibes {
            Some(header) => self.add_infos(&mut episode, &source, &header.spec, &path)?,
            None => without_distractors(&mut episode),
        }
        let seed = metadata.get("seed").and_then(Value::as_u64).unwrap_or(0);
        let mut info = EpisodeInfo { policy: policy.to_owned(), seed, ..EpisodeInfo::default() };
        if let Some(own) = own {
            (episode.index, episode.cell, episode.acting_distractor) = (own.index, own.cell, own.acting_distractor);
            (info.policy, info.model_overrides) = (own.policy, own.model_overrides);
        }
        Ok((episode, info))
    }

    /// Actions, rewards, ends and observations.
    fn columns(&self, source: &EpisodeStore, path: &Path) -> Result<Episode> {
        let named = |name: &str| source.array(&[name.to_owned()]);
        let rewards = named("rewards")?;
        let steps = source.steps(&rewards);
        let terminations = named("terminations")?;
        let actions = self.action.numbers(&source.array(&self.action.path)?, steps);
        let ended = |row: usize| row < terminations.rows() && terminations.is_set(row);
        let mut episode = Episode {
            is_terminal: steps > 0 && ended(steps - 1),
            actions: actions.map_err(|fact| Error::malformed(path, fact, "the action space's shape"))?,
            rewards: rewards_of(&rewards, steps, path)?,
            discounts: (0..steps).map(|step| f32::from(!ended(step))).collect(),
            ..Episode::default()
        };
        let rows = steps + 1;
        let mut parts: Vec<(usize, Vec<f32>)> = Vec::new();
        for leaf in self.vectors() {
            let array = source.array(&leaf.path)?;
            let values = leaf
                .numbers(&array, rows)
                .map_err(|fact| Error::malformed(path, fact, "the observation space's shape"))?;
            parts.push((leaf.len(), values));
        }
        for row in 0..rows {
            for (len, values) in &parts {
                episode.observations.extend(&values[row * len..(row + 1) * len]);
            }
        }
        if let Some(leaf) = self.picture()
            && let LeafKind::Picture { size, channels_first } = leaf.kind
        {
            episode.pixels = source.pictures(&leaf.path, (size, channels_first), rows)?;
        }
        Ok(episode)
    }

    /// What the export put into `infos`.
    fn add_infos(&self, episode: &mut Episode, source: &EpisodeStore, spec: &Spec, path: &Path) -> Result<()> {
        let rows = episode.rows();
        let column = |name: &str, len: usize| -> Result<Vec<f64>> {
            let array = source.array(&["infos".to_owned(), name.to_owned()])?;
            if array.rows() < rows || array.width() != len {
                let fact = format!("infos/{name} of shape {:?}", array.shape);
                return Err(Error::malformed(path, fact, format!("{rows} rows of {len} numbers")));
            }
            Ok(array.doubles(0, rows))
        };
        let singles = |values: Vec<f64>| -> Vec<f32> { values.into_iter().map(|value| value as f32).collect() };
        let some = |name: &str, len: usize| if len > 0 { column(name, len) } else { Ok(Vec::new()) };
        episode.qpos = some("qpos", spec.qpos)?;
        episode.qvel = some("qvel", spec.qvel)?;
        episode.colors = singles(some("colors", 3 * spec.materials.len())?);
        episode.discounts = singles(column("discount", 1)?);
        episode.discounts.truncate(episode.steps());
        let pose = |c: &[f64]| CameraPose { r: c[0], h: c[1], v: c[2], roll: c[3] };
        episode.cameras = column("camera", 4)?.chunks_exact(4).map(pose).collect();
        let (videos, frames) = (column("video", 1)?, column("frame", 1)?);
        let shown = |(&video, &frame): (&f64, &f64)| {
            (video >= 0.0 && frame >= 0.0).then_some(BackgroundFrame { video: video as u32, frame: frame as u32 })
        };
        episode.backgrounds = videos.iter().zip(&frames).map(shown).collect();
        Ok(())
    }
}

fn rewards_of(rewards: &Array, steps: usize, path: &Path) -> Result<Vec<f32>> {
    if rewards.width() != 1 || rewards.shape.is_empty() {
        return Err(Error::malformed(path, format!("rewards of shape {:?}", rewards.shape), "one number a step"));
    }
    Ok(rewards.singles(0, steps))
}
