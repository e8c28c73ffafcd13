//! Environments with eyes, any number of them on any number of threads, behind one door.
//!
//! In: options, which episode each environment plays, actions `[environments, action]`. Out: rows: observations, pictures, rewards. One environment
//! is played on the thread that calls, so that nobody waits for another thread to wake up. Many are played by threads of their own, each of which
//! takes the next environment that nobody has taken yet, so that a slow picture holds up none but its own. Python's threads may call from wherever
//! they like: an OpenGL context is on a thread only while its environment is at work there.

mod options;
mod rows;
mod slot;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use vibes_data::Spec;
use vibes_env::render::{check_drawing, on_one_display, visiting, without_rasteriser_threads};
use vibes_env::videos::VideoLibrary;

use crate::arrays::{owned, shaped};
use crate::error::{affordable, guarded, refused, unlocked, unlocked_here};
use crate::keeper::Keeper;
use options::WorldOptions;
use rows::{Place, Rows};
use slot::{EpisodeKey, Slot};

/// Most environments of one world.
const MOST: usize = 1024;

/// `environments` environments of one task.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct World {
    options: WorldOptions,
    spec: Spec,
    videos: Arc<VideoLibrary>,
    episode_steps: u32,
    environments: usize,
    process: u32,
    /// One call at a time; none after the end.
    slots: Mutex<Vec<Slot>>,
    /// The threads; none where the caller's own does the work.
    pool: Option<ThreadPool>,
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (options, environments=1, threads=None))]
    fn new(py: Python<'_>, options: &Bound<'_, PyDict>, environments: i64, threads: Option<i64>) -> PyResult<Self> {
        let options = WorldOptions::read(options)?;
        let environments = match usize::try_from(environments) {
            Ok(count) if (1..=MOST).contains(&count) => count,
            _ => return Err(refused(format!("{environments} environments; 1 to {MOST} are possible"))),
        };
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let threads = match threads {
            Some(threads) if threads < 1 => {
                return Err(refused(format!("{threads} threads; at least one is needed")));
            }
            threads => threads.and_then(|threads| usize::try_from(threads).ok()),
        };
        let threads = threads.or((environments > 1).then_some(cores)).map(|threads| threads.min(environments));
        let bytes = options.size.map_or(0, |size| 3 * size as usize * size as usize);
        affordable("pictures [environments, bytes]", &[environments, bytes.max(1)])?;
        if options.size.is_some() {
            // With the interpreter's lock, under which Python changes the process's environment too, and before there are threads of ours.
            without_rasteriser_threads();
            unlocked_here(py, || visiting(check_drawing))?;
        }
        let videos = Arc::new(unlocked(py, || options.open_videos())?);
        unlocked_here(py, || -> Result<Self, String> {
            let environment = options.environment().map_err(|error| error.to_string())?;
            let spec = environment.spec(options.size);
            let episode_steps = environment.episode_steps();
            let pool = threads
                .map(|threads| ThreadPoolBuilder::new().num_threads(threads).thread_name(|_| "vibes".into()).build());
            let pool = pool.transpose().map_err(|error| format!("no threads for the environments: {error}"))?;
            let open = || open_slots(&options, &videos, environments, threads.unwrap_or(1));
            let slots = Mutex::new(visiting(open).map_err(|error| error.to_string())?);
            Ok(Self { options, spec, videos, episode_steps, environments, process: std::process::id(), slots, pool })
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

    /// Number of threads of its own; 0 where the thread that calls does the work.
    #[getter]
    fn threads(&self) -> usize {
        self.pool.as_ref().map_or(0, ThreadPool::current_num_threads)
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
        let ready = |i: usize, slot: &Slot| keys[i].map_or(Ok(()), |key| slot.can_begin(key));
        let rows =
            self.rows(py, draw, ready, |i, slot| keys[i].map_or(Ok(0.0), |key| slot.begin(key).map(|()| 0.0)))?;
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
        let actions = owned(&actions);
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
        let action = |i: usize| &actions[i * width..(i + 1) * width];
        let ready = |i: usize, slot: &Slot| match keys[i] {
            Some(key) => slot.can_begin(key),
            None => slot.can_step(action(i)),
        };
        let rows = self.rows(py, draw, ready, |i, slot| match keys[i] {
            Some(key) => slot.begin(key).map(|()| 0.0),
            None => slot.step(action(i)),
        })?;
        self.arrays(py, rows, draw)
    }

    /// The present pictures, `[environments, size, size, 3]`; none of a world without pictures.
    fn pictures<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let rows = self.rows(py, true, |_, _| Ok(()), |_, _| Ok(0.0))?;
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
        self.each(py, &mut Rows::of(self.environments, 0, 0), |_, _| Ok(()), |_, slot, _| slot.roll(steps, draw))?;
        Ok(began.elapsed().as_secs_f64())
    }

    /// Ends the environments; what is asked of it afterwards raises.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.end());
    }
}

impl World {
    /// Keeps every episode that begins from now on and is played to its end in a recording; none stops keeping.
    pub(crate) fn keep(&self, py: Python<'_>, keeper: Option<Keeper>) -> PyResult<()> {
        self.each(
            py,
            &mut Rows::of(self.environments, 0, 0),
            |_, _| Ok(()),
            |_, slot, _| {
                slot.keep(keeper.clone());
                Ok(())
            },
        )
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

    fn lock(&self) -> MutexGuard<'_, Vec<Slot>> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// In the child of a fork there is nothing to end: the environments belong to its parent, and a lock may be held by a thread that is not there.
    fn end(&self) {
        if std::process::id() == self.process {
            visiting(|| self.lock().clear());
        }
    }

    /// Lets every environment do `work`, which returns its reward, and show its row; none if one is not `ready`.
    fn rows(
        &self,
        py: Python<'_>,
        draw: bool,
        ready: impl Fn(usize, &Slot) -> Result<(), String> + Send + Sync,
        work: impl Fn(usize, &mut Slot) -> Result<f64, String> + Send + Sync,
    ) -> PyResult<Rows> {
        let pixels = if draw { self.spec.pixels_len() } else { 0 };
        let mut rows = Rows::of(self.environments, pixels, self.spec.observation_len());
        self.each(py, &mut rows, ready, |i, slot, place| work(i, slot).and_then(|reward| slot.show(reward, place)))?;
        Ok(rows)
    }

    /// Lets every environment work, each with its place in `rows`, once all of them are `ready`: what can be refused beforehand moves none. Then the others
    /// finish, whatever happens to one, and the first error is the answer.
    fn each(
        &self,
        py: Python<'_>,
        rows: &mut Rows,
        ready: impl Fn(usize, &Slot) -> Result<(), String> + Send + Sync,
        work: impl Fn(usize, &mut Slot, Place<'_>) -> Result<(), String> + Send + Sync,
    ) -> PyResult<()> {
        if std::process::id() != self.process {
            return Err(refused(
                "this environment was made in another process, whose threads a fork leaves behind; start processes with spawn or forkserver \
                 and make it there, or use vibes.make_vec, which needs no processes",
            ));
        }
        let one = |(i, (slot, place)): (usize, (&mut Slot, Place<'_>))| visiting(|| guarded(|| work(i, slot, place)));
        let of_which = |i: usize, fact: String| match self.environments {
            1 => fact,
            _ => format!("environment {i}: {fact}"),
        };
        unlocked_here(py, || -> Result<(), String> {
            let mut slots = self.lock();
            if slots.is_empty() {
                return Err("this environment is closed; make another".to_owned());
            }
            slots.iter().enumerate().try_for_each(|(i, slot)| ready(i, slot).map_err(|fact| of_which(i, fact)))?;
            let shares: Vec<_> = slots.iter_mut().zip(rows.places()).enumerate().collect();
            let Some(pool) = &self.pool else { return shares.into_iter().try_for_each(one) };
            let done: Vec<_> = pool.install(|| shares.into_par_iter().with_max_len(1).map(one).collect());
            done.into_iter().collect()
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

/// The environments of each thread draw on a display of their own: the threads share the environments out in halves, and halves of halves, so that
/// neighbours are mostly one thread's.
fn open_slots(
    options: &WorldOptions,
    videos: &Arc<VideoLibrary>,
    environments: usize,
    threads: usize,
) -> vibes_env::Result<Vec<Slot>> {
    let mut slots = Vec::with_capacity(environments);
    for thread in 1..=threads {
        let end = environments * thread / threads;
        let open = || (slots.len()..end).map(|_| Slot::open(options, videos)).collect::<vibes_env::Result<Vec<_>>>();
        slots.extend(on_one_display(open)?);
    }
    Ok(slots)
}

impl Drop for World {
    fn drop(&mut self) {
        self.end();
        if std::process::id() != self.process {
            std::mem::forget(std::mem::take(&mut self.slots));
            std::mem::forget(self.pool.take());
        }
    }
}
