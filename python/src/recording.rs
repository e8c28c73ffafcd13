//! Recordings: a folder opened, its episodes as arrays over the mapped files, its windows as the trainer draws them.
//!
//! In: a path. Out: a [`Recording`], [`Episode`]s whose columns are numpy arrays over the file's pages, and [`Windows`] of a seed and an update.

use std::path::PathBuf;

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::datatypes::{Float64Type, UInt32Type};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use vibes_data::{EpisodeEntry, EpisodeView, Purpose, Spec, WindowBatch, WindowSampler, update_rng};
use vibes_measure::episodes;

use crate::arrays::{shaped, shared};
use crate::error::{affordable, refused, unlocked_here};

/// A folder of episodes.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Recording(vibes_data::Recording);

#[pymethods]
impl Recording {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        unlocked_here(py, || vibes_data::Recording::open(&path)).map(Self)
    }

    /// Where it lies.
    #[getter]
    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    /// `manifest.json` as a dictionary, with the episodes that were finished since it was written.
    fn manifest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, self.0.manifest())?)
    }

    /// The numbers of its episodes, rising.
    fn indices(&self) -> Vec<u32> {
        self.0.episodes().iter().map(|entry| entry.index).collect()
    }

    /// Maps one episode.
    fn episode(&self, py: Python<'_>, index: u32) -> PyResult<Episode> {
        let view = unlocked_here(py, || self.0.episode(index))?;
        let entry = self.0.episodes().iter().find(|entry| entry.index == index).cloned();
        let entry = entry.ok_or_else(|| refused(format!("no episode {index}")))?;
        Ok(Episode { view, entry, spec: self.0.manifest().spec.clone() })
    }

    /// The state and the distractor trajectory of every episode, in the order of its numbers, -1 where it has none: those of its cell. Without cells,
    /// episodes that took the same actions are views of one state trajectory, under distractors of their own.
    fn trajectories<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let of = |entry: &EpisodeEntry| {
            let cell = entry.cell.map(|cell| (cell.state, cell.distractor));
            episodes::Episode { recording: 0, index: entry.index, cell }
        };
        let all: Vec<episodes::Episode> = self.0.episodes().iter().map(of).collect();
        let actions = |place: usize| self.0.episode(all[place].index).map(|view| view.actions());
        let chosen = unlocked_here(py, || episodes::chosen(&all, usize::MAX, actions))?;
        let number = |number: Option<u32>| number.map_or(-1, i64::from);
        let (states, distractors): (Vec<i64>, Vec<i64>) =
            chosen.iter().map(|one| (number(one.state), number(one.distractor))).unzip();
        let shape = [chosen.len()];
        Ok((shaped(py, states, &shape)?.into_any(), shaped(py, distractors, &shape)?.into_any()))
    }
}

/// One episode of T actions, T + 1 rows.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Episode {
    view: EpisodeView,
    entry: EpisodeEntry,
    spec: Spec,
}

#[pymethods]
impl Episode {
    /// What the manifest says of it.
    fn entry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, &self.entry)?)
    }

    /// Number of actions, T.
    #[getter]
    fn steps(&self) -> usize {
        self.view.steps()
    }

    /// Whether its last row is terminal.
    #[getter]
    fn is_terminal(&self) -> bool {
        self.view.is_terminal()
    }

    /// A column of numbers as a read-only array over the mapped file; none where the recording has no such column.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let (rows, steps, spec) = (self.view.rows(), self.view.steps(), &self.spec);
        let shape = match name {
            "action" => vec![steps, spec.action_len()],
            "reward" | "discount" => vec![steps],
            "observation" => vec![rows, spec.observation_len()],
            "qpos" => vec![rows, spec.qpos],
            "qvel" => vec![rows, spec.qvel],
            "colors" => vec![rows, spec.materials.len(), 3],
            "pixels" => {
                let Some(size) = spec.pixels else { return Ok(None) };
                vec![rows, size.height as usize, size.width as usize, 3]
            }
            _ => return Err(refused(format!("no column {name} is shared"))),
        };
        self.view.table().column_by_name(name).map_or(Ok(None), |column| shared(py, column, shape))
    }

    /// Which rows have a picture, `[T + 1]`.
    fn has_pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.view.rows();
        let there = |column: &ArrayRef| (0..rows).map(|row| column.is_valid(row)).collect();
        let valid = self.view.table().column_by_name("pixels").map_or_else(|| vec![false; rows], there);
        Ok(shaped(py, valid, &[rows])?.into_any())
    }

    /// The camera's r, h, v and roll, `[T + 1, 4]`.
    fn camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let camera = self.view.table()["camera"].as_struct();
        let parts: Vec<_> = (0..4).map(|part| camera.column(part).as_primitive::<Float64Type>().values()).collect();
        let values = (0..self.view.rows()).flat_map(|row| parts.iter().map(move |part| part[row])).collect();
        Ok(shaped(py, values, &[self.view.rows(), 4])?.into_any())
    }

    /// A nullable column of counts, -1 where there is none, `[T + 1]`.
    fn counts<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let column = self.view.table().column_by_name(name).and_then(|column| column.as_primitive_opt::<UInt32Type>());
        let column = column.ok_or_else(|| refused(format!("no column {name} of counts")))?;
        let values: Vec<i64> = column.iter().map(|value| value.map_or(-1, i64::from)).collect();
        Ok(shaped(py, values, &[self.view.rows()])?.into_any())
    }

    /// Gives the memory of the rows seen so far back until they are looked at again.
    fn release(&self) {
        self.view.release();
    }
}

/// Windows of one length from one or more recordings of the same spec.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Windows {
    updates: vibes_data::Windows,
    samplers: Vec<WindowSampler>,
    spec: Spec,
    length: usize,
    batch: usize,
}

#[pymethods]
impl Windows {
    #[new]
    fn new(py: Python<'_>, recordings: Vec<Py<Recording>>, length: usize, batch: usize) -> PyResult<Self> {
        let recordings: Vec<vibes_data::Recording> =
            recordings.iter().map(|recording| recording.get().0.clone()).collect();
        let [first, others @ ..] = recordings.as_slice() else { return Err(refused("windows of no recording")) };
        let spec = first.manifest().spec.clone();
        if let Some(other) = others.iter().find(|other| !same_columns(&other.manifest().spec, &spec)) {
            let (here, there) = (first.path().display(), other.path().display());
            return Err(refused(format!(
                "recordings of other columns; windows mix recordings of one spec: {here} and {there}"
            )));
        }
        if length == 0 || batch == 0 {
            return Err(refused(format!("windows of length {length} in batches of {batch}; both are at least 1")));
        }
        let row = spec.pixels_len() + 4 * (spec.observation_len() + 2 * spec.action_len() + 2);
        affordable("windows [batch, time, bytes]", &[batch, length, row])?;
        let open = || -> vibes_data::Result<_> {
            let samplers = recordings.iter().map(|recording| WindowSampler::new(recording, length));
            Ok((vibes_data::Windows::new(&recordings, length, batch)?, samplers.collect::<Result<Vec<_>, _>>()?))
        };
        let (updates, samplers) = unlocked_here(py, open)?;
        Ok(Self { updates, samplers, spec, length, batch })
    }

    /// How many different windows there are.
    #[getter]
    fn count(&self) -> u64 {
        self.samplers.iter().map(WindowSampler::windows).sum()
    }

    /// Rows a window.
    #[getter]
    fn length(&self) -> usize {
        self.length
    }

    /// Windows a batch.
    #[getter]
    fn batch(&self) -> usize {
        self.batch
    }

    /// The batch that update `update` of a run with this seed trains on.
    fn of_update<'py>(&self, py: Python<'py>, seed: u64, update: u64) -> PyResult<Bound<'py, PyDict>> {
        // Streams of numbers are counted in 64 bits, three an update.
        if update > u64::MAX / 8 {
            return Err(refused(format!("update {update}; the last is {}", u64::MAX / 8)));
        }
        let batch = unlocked_here(py, || {
            Ok::<_, vibes_data::Error>(self.updates.sample(&mut update_rng(seed, update, Purpose::Windows)))
        })?;
        self.arrays(py, batch)
    }

    /// One window by its number, below [`Self::count`]: `[time, …]` arrays.
    fn numbered<'py>(&self, py: Python<'py>, number: u64) -> PyResult<Bound<'py, PyDict>> {
        let mut rest = number;
        for sampler in &self.samplers {
            if rest < sampler.windows() {
                let batch = unlocked_here(py, || Ok::<_, vibes_data::Error>(sampler.numbered(&[rest])))?;
                return self.arrays(py, batch);
            }
            rest -= sampler.windows();
        }
        Err(refused(format!("no window {number}; there are {}", self.count())))
    }

    /// Gives the memory of the pages seen so far back until they are looked at again.
    fn release(&self) {
        self.updates.release();
        self.samplers.iter().for_each(WindowSampler::release);
    }
}

impl Windows {
    /// A batch as arrays `[time, batch, …]`.
    fn arrays<'py>(&self, py: Python<'py>, batch: WindowBatch) -> PyResult<Bound<'py, PyDict>> {
        let (length, windows) = (batch.length, batch.batch);
        let out = PyDict::new(py);
        if let Some(size) = self.spec.pixels {
            let shape = [length, windows, size.height as usize, size.width as usize, 3];
            out.set_item("pixels", shaped(py, batch.pixels, &shape)?)?;
        }
        let lists = [
            ("observation", batch.observations, self.spec.observation_len()),
            ("action", batch.actions, self.spec.action_len()),
            ("previous_action", batch.previous_actions, self.spec.action_len()),
        ];
        for (name, values, width) in lists {
            out.set_item(name, shaped(py, values, &[length, windows, width])?)?;
        }
        out.set_item("reward", shaped(py, batch.rewards, &[length, windows])?)?;
        out.set_item("is_first", shaped(py, batch.is_first, &[length, windows])?)?;
        let (episode, step): (Vec<i64>, Vec<i64>) =
            batch.starts.iter().map(|&(episode, step)| (i64::from(episode), i64::from(step))).unzip();
        out.set_item("episode", shaped(py, episode, &[windows])?)?;
        out.set_item("step", shaped(py, step, &[windows])?)?;
        Ok(out)
    }
}

/// Whether windows of both lie in one array.
fn same_columns(a: &Spec, b: &Spec) -> bool {
    (a.action_len(), a.observation_len(), a.pixels) == (b.action_len(), b.observation_len(), b.pixels)
}
