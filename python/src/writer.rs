//! Recordings from Python: episodes that worlds play, or whole episodes as arrays, written as the collector writes them.
//!
//! In: a world, or the shape of somebody else's episodes; a seed. Out: a folder that the three programs read.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{Element, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use vibes_data::{
    CameraPose, Episode, EpisodeInfo, Grid, MOST_EPISODES, Manifest, RecordingWriter, Spec, followed_place,
};
use vibes_env::Heading;
use vibes_env::videos::VideoSource;

use crate::arrays::owned;
use crate::error::{refused, unlocked_here};
use crate::keeper::Keeper;
use crate::world::World;

/// A recording that grows.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Writer {
    path: PathBuf,
    spec: Spec,
    keeper: Mutex<Option<Keeper>>,
}

#[pymethods]
impl Writer {
    /// A recording of a world's episodes. It names the world's options as `vibes-collect` would, so that `verify` simulates and draws them again.
    #[staticmethod]
    #[pyo3(signature = (path, world, seed, mcap, grid=None))]
    fn of_world(
        py: Python<'_>,
        path: PathBuf,
        world: &World,
        seed: u64,
        mcap: bool,
        grid: Option<(u32, u32)>,
    ) -> PyResult<Self> {
        let manifest = world_manifest(world, seed, grid.map(cells).transpose()?, &path);
        Self::open(py, path, manifest, mcap)
    }

    /// A recording of somebody else's episodes, of the shape that `spec` says.
    #[staticmethod]
    #[pyo3(signature = (path, spec, seed, mcap, grid=None))]
    fn of_spec(
        py: Python<'_>,
        path: PathBuf,
        spec: &Bound<'_, PyDict>,
        seed: u64,
        mcap: bool,
        grid: Option<(u32, u32)>,
    ) -> PyResult<Self> {
        let spec: Spec = pythonize::depythonize(spec).map_err(refused)?;
        if let Some(fault) = spec.fault() {
            return Err(refused(format!("{fault}; a recording has smaller sizes, equal bounds and a clock")));
        }
        let options = json!({ "recorded_by": "python" });
        let heading = Heading { spec, options, seed, grid: grid.map(cells).transpose()?, videos: Vec::new() };
        Self::open(py, path, heading.manifest(), mcap)
    }

    /// Where it lies.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    /// How many episodes are there.
    fn __len__(&self) -> PyResult<usize> {
        Ok(self.shared()?.writer.len())
    }

    /// Writes one whole episode of T actions. Columns by their names in the format, `[T, …]` or `[T + 1, …]`. In a grid the cell `(state, distractor)`
    /// stands in place of the number.
    #[pyo3(signature = (place, columns, *, is_terminal, policy, seed))]
    fn write(
        &self,
        py: Python<'_>,
        place: (u32, u32),
        columns: &Bound<'_, PyDict>,
        is_terminal: bool,
        policy: String,
        seed: u64,
    ) -> PyResult<()> {
        let keeper = self.shared()?;
        let (index, cell) = keeper.place(place.0, place.1).map_err(refused)?;
        let writer = keeper.writer;
        if index > MOST_EPISODES || writer.has(index) {
            return Err(refused(format!(
                "episode {index} is there already, or past 999999; take the next free number"
            )));
        }
        let mut episode = Episode { index, cell, is_terminal, ..Episode::default() };
        let column = |name: &str| columns.get_item(name).map(|found| found.filter(|found| !found.is_none()));
        let spec = &self.spec;
        let picture = spec.pixels.map_or(vec![0], |size| vec![size.height as usize, size.width as usize, 3]);
        episode.actions = numbers("action", column("action")?, &[spec.action_len()])?;
        episode.rewards = numbers("reward", column("reward")?, &[])?;
        episode.discounts = match column("discount")? {
            Some(given) => numbers("discount", Some(given), &[])?,
            None => discounts(episode.rewards.len(), is_terminal),
        };
        episode.observations = numbers("observation", column("observation")?, &[spec.observation_len()])?;
        episode.qpos = numbers("qpos", column("qpos")?, &[spec.qpos])?;
        episode.qvel = numbers("qvel", column("qvel")?, &[spec.qvel])?;
        episode.pixels = numbers("pixels", column("pixels")?, &picture)?;
        episode.colors = numbers("colors", column("colors")?, &[spec.materials.len(), 3])?;
        episode.cameras = vec![CameraPose::default(); episode.rows()];
        episode.backgrounds = vec![None; episode.rows()];
        let info = EpisodeInfo { policy, seed, model_overrides: serde_json::Value::Null };
        unlocked_here(py, || writer.write(&episode, info))
    }

    /// Keeps every episode that the world plays to its end from now on.
    #[pyo3(signature = (world, acts_by_pictures=false))]
    fn keep(&self, py: Python<'_>, world: &World, acts_by_pictures: bool) -> PyResult<()> {
        world.keep(py, Some(Keeper { acts_by_pictures, ..self.shared()? }))
    }

    /// The shape of its episodes.
    fn spec<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, &self.spec)?)
    }

    /// Whether the episode of this number, or of this cell `(state, distractor)` of a grid, is there.
    #[pyo3(signature = (state, distractor=None))]
    fn has(&self, state: u32, distractor: Option<u32>) -> PyResult<bool> {
        let keeper = self.shared()?;
        let (index, _) = keeper.place(state, distractor.unwrap_or(state)).map_err(refused)?;
        Ok(keeper.writer.has(index))
    }

    /// Completes the manifest. Nothing can be written afterwards.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let Some(Keeper { writer, seed, grid, acts_by_pictures }) = self.lock().take() else { return Ok(()) };
        match Arc::try_unwrap(writer) {
            Ok(writer) => unlocked_here(py, || writer.finish()).map(drop),
            Err(writer) => {
                *self.lock() = Some(Keeper { writer, seed, grid, acts_by_pictures });
                Err(refused("an environment still keeps its episodes here; close it or stop keeping first"))
            }
        }
    }
}

impl Writer {
    fn open(py: Python<'_>, path: PathBuf, manifest: Manifest, mcap: bool) -> PyResult<Self> {
        let (spec, seed, grid) = (manifest.spec.clone(), manifest.seed, manifest.grid);
        let writer = unlocked_here(py, || RecordingWriter::create_or_resume(&path, manifest, mcap))?;
        let keeper = Keeper { writer: Arc::new(writer), seed, grid, acts_by_pictures: false };
        Ok(Self { path, spec, keeper: Mutex::new(Some(keeper)) })
    }

    fn lock(&self) -> MutexGuard<'_, Option<Keeper>> {
        self.keeper.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The open recording.
    fn shared(&self) -> PyResult<Keeper> {
        let closed = || refused(format!("this writer is closed; open another: {}", self.path.display()));
        self.lock().clone().ok_or_else(closed)
    }
}

/// Discounts of so many steps where none are given: what comes after the end of the task is worth nothing.
fn discounts(steps: usize, is_terminal: bool) -> Vec<f32> {
    let mut discounts = vec![1.0; steps];
    if let (true, Some(last)) = (is_terminal, discounts.last_mut()) {
        *last = 0.0;
    }
    discounts
}

/// The numbers of an array `[rows, …]` whose rows have this shape; none without an array. A row of one number may be a number.
fn numbers<T: Element + Copy>(name: &str, array: Option<Bound<'_, PyAny>>, row: &[usize]) -> PyResult<Vec<T>> {
    let Some(array) = array else { return Ok(Vec::new()) };
    let array: PyReadonlyArrayDyn<'_, T> = array.extract()?;
    let found = array.shape();
    let plain = |shape: &[usize]| if *shape == [1] { Vec::new() } else { shape.to_vec() };
    if found.split_first().is_none_or(|(_, rest)| plain(rest) != plain(row)) {
        if row.contains(&0) {
            return Err(refused(unnamed(name)));
        }
        let row: String = row.iter().map(|size| format!(", {size}")).collect();
        return Err(refused(format!("{name} of shape {found:?}; right is [rows{row}]")));
    }
    Ok(owned(&array))
}

/// What is wrong with a column of which the spec says nothing.
fn unnamed(column: &str) -> String {
    let right = match column {
        "pixels" => "name their size there, or leave them out",
        "colors" => "leave them out",
        _ => "name it there, or leave it out",
    };
    format!("{column}, of which this recording's spec says nothing; {right}")
}

/// A grid of at least one cell, whose cells can be numbered.
fn cells((states, distractors): (u32, u32)) -> PyResult<Grid> {
    match states.checked_mul(distractors) {
        Some(1..=MOST_EPISODES) => Ok(Grid { states, distractors }),
        _ => Err(refused(format!("a grid of {states} x {distractors}; it has 1 to {MOST_EPISODES} cells"))),
    }
}

/// The manifest that `vibes-collect` would write for the same task, distractors and videos into a recording in `folder`; without a grid `episodes` is
/// not known beforehand. A folder of videos is named from the recording, so that both can be moved together and are found from any other folder.
fn world_manifest(world: &World, seed: u64, grid: Option<Grid>, folder: &Path) -> Manifest {
    let options = world.options();
    let stored = match &options.videos {
        VideoSource::Folder(videos) => VideoSource::Folder(followed_place(videos, folder).into()),
        VideoSource::Procedural => VideoSource::Procedural,
    };
    let mut asked = json!({
        "task": options.task,
        "policy": "python",
        "grid": grid,
        "episodes": grid.map_or(0, |grid| grid.states * grid.distractors),
        "steps": world.steps_of_an_episode(),
        "action_repeat": world.recording_spec().action_repeat,
        "raw_torques": options.environment.raw_torques,
        "distractors": options.distractors,
        "videos": stored,
        "video_set": options.video_set,
        "video_count": options.video_count,
        "size": options.size,
        "look": options.look,
    });
    if !options.axis_seeds.is_empty() {
        asked["axis_seeds"] = json!(options.axis_seeds);
    }
    let (spec, videos) = (world.recording_spec().clone(), world.video_library().videos().to_vec());
    Heading { spec, options: asked, seed, grid, videos }.manifest()
}
