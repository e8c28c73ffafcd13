//! Environments with eyes, any number of them on any number of threads, behind one door.
//!
//! In: options, which episode each environment plays, actions `[environments, action]`. Out: rows: observations, pictures, rewards. Eyes stay on the
//! thread that made them, as an OpenGL context does, so every thread keeps its own environments and is sent orders; one environment is the same
//! with one thread. Python's threads may then call from wherever they like.

mod options;
mod rows;
mod slot;
mod worker;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use vibes_data::Spec;
use vibes_env::render::check_drawing;
use vibes_env::videos::VideoLibrary;

use crate::arrays::shaped;
use crate::error::{affordable, refused, unlocked};
use crate::keeper::Keeper;
use options::WorldOptions;
use rows::Rows;
use slot::EpisodeKey;
use worker::{Order, Worker};

/// Most environments of one world.
const MOST: usize = 1024;

/// `environments` environments of one task on `threads` threads.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct World {
    options: WorldOptions,
    spec: Spec,
    videos: Arc<VideoLibrary>,
    episode_steps: u32,
    environments: usize,
    process: u32,
    workers: Mutex<Vec<Worker>>,
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (options, environments=1, threads=None))]
    fn new(py: Python<'_>, options: &Bound<'_, PyDict>, environments: usize, threads: Option<usize>) -> PyResult<Self> {
        let options = WorldOptions::read(options)?;
        if !(1..=MOST).contains(&environments) {
            return Err(refused(format!("{environments} environments; 1 to {MOST} are possible")));
        }
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let threads = threads.unwrap_or_else(cores);
        if threads == 0 {
            return Err(refused("0 threads; at least one is needed"));
        }
        let threads = threads.min(environments);
        let bytes = options.size.map_or(0, |size| 3 * size as usize * size as usize);
        affordable("pictures [environments, bytes]", &[environments, bytes.max(1)])?;
        if options.size.is_some() {
            // With the interpreter's lock, and before there are threads: opening EGL sets a variable of the process's environment.
            check_drawing().map_err(refused)?;
        }
        unlocked(py, || -> Result<Self, String> {
            let videos = Arc::new(options.open_videos().map_err(|error| error.to_string())?);
            let environment = options.environment().map_err(|error| error.to_string())?;
            let spec = options.spec(&environment);
            let episode_steps = environment.episode_steps();
            // Shares differ by one at most.
            let share = |thread: usize| environments / threads + usize::from(thread < environments % threads);
            let workers = (0..threads).map(|thread| Worker::start(share(thread), &options, &videos));
            let workers = workers.collect::<Result<Vec<_>, _>>()?;
            let process = std::process::id();
            Ok(Self { options, spec, videos, episode_steps, environments, process, workers: Mutex::new(workers) })
        })
    }

    /// The shape of a row and of an action, as a recording's manifest says it.
    fn spec<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, &self.spec)?)
    }

    /// The background videos, as a recording's manifest lists them.
    fn videos<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, self.videos.videos())?)
    }

    /// Agent steps of a whole episode.
    #[getter]
    fn episode_steps(&self) -> u32 {
        self.episode_steps
    }

    /// Number of environments.
    #[getter]
    fn environments(&self) -> usize {
        self.environments
    }

    /// Number of threads.
    #[getter]
    fn threads(&self) -> usize {
        self.lock().len()
    }

    /// Begins episodes: for every environment none, or the recording's seed, the state trajectory and the distractor trajectory.
    fn reset<'py>(
        &self,
        py: Python<'py>,
        episodes: Vec<Option<(u64, u32, u32)>>,
        draw: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        if episodes.len() != self.environments {
            return Err(refused(format!("{} episodes for {} environments", episodes.len(), self.environments)));
        }
        let keys: Vec<Option<EpisodeKey>> = episodes
            .into_iter()
            .map(|key| key.map(|(seed, state, distractor)| EpisodeKey { seed, state, distractor }))
            .collect();
        let rows = self.ask(py, |place| Order::Reset { keys: keys[place].to_vec(), draw })?;
        self.arrays(py, rows, draw)
    }

    /// One agent step of every environment; of those whose key is given, its next episode begins instead and the action is not looked at.
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: PyReadonlyArray2<'py, f32>,
        episodes: Option<Vec<Option<(u64, u32, u32)>>>,
        draw: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let width = self.spec.action_len();
        if actions.shape() != [self.environments, width] {
            let found = actions.shape();
            return Err(refused(format!("actions of shape {found:?}; right is [{}, {width}]", self.environments)));
        }
        let actions: Vec<f32> = match actions.as_slice() {
            Ok(slice) => slice.to_vec(),
            Err(_) => actions.as_array().iter().copied().collect(),
        };
        let keys: Vec<Option<EpisodeKey>> = match episodes {
            None => vec![None; self.environments],
            Some(keys) if keys.len() == self.environments => keys
                .into_iter()
                .map(|key| key.map(|(seed, state, distractor)| EpisodeKey { seed, state, distractor }))
                .collect(),
            Some(keys) => {
                return Err(refused(format!("{} episodes for {} environments", keys.len(), self.environments)));
            }
        };
        let rows = self.ask(py, |place| Order::Step {
            actions: actions[place.start * width..place.end * width].to_vec(),
            keys: keys[place].to_vec(),
            draw,
        })?;
        self.arrays(py, rows, draw)
    }

    /// The present pictures, `[environments, size, size, 3]`; none of a world without pictures.
    fn pictures<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let rows = self.ask(py, |_| Order::Look)?;
        self.arrays(py, rows, true)?.get_item("pixels")
    }

    /// Keeps no more of the episodes that begin from now on.
    fn stop_keeping(&self, py: Python<'_>) -> PyResult<()> {
        self.keep(py, None)
    }

    /// Plays `steps` agent steps of uniform random actions in every environment without Python, pictures drawn and thrown away; returns the seconds
    /// it took. What a loop in Rust costs.
    fn roll(&self, py: Python<'_>, steps: u32, draw: bool) -> PyResult<f64> {
        let began = std::time::Instant::now();
        self.ask(py, |_| Order::Roll { steps, draw })?;
        Ok(began.elapsed().as_secs_f64())
    }

    /// Ends the threads; what is asked of it afterwards raises.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.lock().clear());
    }
}

impl World {
    /// Keeps every episode that begins from now on and is played to its end in a recording; none stops keeping.
    pub(crate) fn keep(&self, py: Python<'_>, keeper: Option<Keeper>) -> PyResult<()> {
        self.ask(py, |_| Order::Keep(keeper.clone())).map(drop)
    }

    pub(crate) fn options(&self) -> &WorldOptions {
        &self.options
    }

    pub(crate) fn recording_spec(&self) -> &Spec {
        &self.spec
    }

    pub(crate) fn video_library(&self) -> &VideoLibrary {
        &self.videos
    }

    pub(crate) fn steps_of_an_episode(&self) -> u32 {
        self.episode_steps
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Worker>> {
        self.workers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends every thread its order and waits for all of them; the rows of all environments in their order.
    fn ask(&self, py: Python<'_>, order: impl Fn(std::ops::Range<usize>) -> Order + Send + Sync) -> PyResult<Rows> {
        if std::process::id() != self.process {
            return Err(refused(
                "this environment was made in another process, whose threads a fork leaves behind; make it in this one \
                 (multiprocessing's spawn does), or use vibes.make_vec, which needs no processes",
            ));
        }
        unlocked(py, || -> Result<Rows, String> {
            let workers = self.lock();
            if workers.is_empty() {
                return Err("this environment is closed; make another".to_owned());
            }
            let mut start = 0;
            for worker in workers.iter() {
                let place = start..start + worker.environments();
                start = place.end;
                worker.send(order(place))?;
            }
            // All answers are taken, so that an error of one thread leaves none waiting in another's channel.
            let answers: Vec<Result<Rows, String>> = workers.iter().map(Worker::answer).collect();
            let mut all = Rows::default();
            for rows in answers {
                all.append(rows?);
            }
            Ok(all)
        })
    }

    fn arrays<'py>(&self, py: Python<'py>, rows: Rows, drawn: bool) -> PyResult<Bound<'py, PyDict>> {
        let count = self.environments;
        let out = PyDict::new(py);
        if let (Some(size), true) = (self.spec.pixels, drawn) {
            let shape = [count, size.height as usize, size.width as usize, 3];
            out.set_item("pixels", shaped(py, rows.pixels, &shape)?)?;
        }
        out.set_item("state", shaped(py, rows.observations, &[count, self.spec.observation_len()])?)?;
        out.set_item("reward", shaped(py, rows.rewards, &[count])?)?;
        out.set_item("is_last", shaped(py, rows.is_last, &[count])?)?;
        Ok(out)
    }
}
