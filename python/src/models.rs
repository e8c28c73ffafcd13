//! Trained models: latents of observations, and actions.
//!
//! In: a run's folder, observations and actions as arrays. Out: latents `[rows, latent]`, actions `[action]`. The newest checkpoint is taken, on the
//! CPU. A model of a run without an actor encodes; only one that `vibes-train online` has trained acts.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::RunFolder;
use vibes_model::ObservationKind;
use vibes_model::actions::Choice;
use vibes_model::encode::RawFrames;
use vibes_model::trained::{Trained, TrainedAgent, actor_file, encoder_file};

use crate::arrays::{owned, shaped};
use crate::error::{refused, unlocked, unlocked_with};

/// Rows encoded at a time: memory follows them, not the episode.
const CHUNK: usize = 128;

/// The newest checkpoint of a run.
#[pyclass(frozen, module = "vibes._vibes")]
pub(crate) struct Model {
    checkpoint: PathBuf,
    facts: Facts,
    trained: Mutex<Trained>,
    actor: Option<Mutex<Acting>>,
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Model").field("checkpoint", &self.checkpoint).finish_non_exhaustive()
    }
}

/// What every kind of model has.
struct Facts {
    observation: ObservationKind,
    actions: usize,
    latent: usize,
}

/// What a model without a world model says of itself.
#[derive(Serialize)]
struct ModelFreeConfig<'a> {
    task: &'a str,
    observation: ObservationKind,
    latent: usize,
    latents: &'a str,
    action_min: &'a [f32],
    action_max: &'a [f32],
}

/// An agent in the middle of an episode.
struct Acting {
    agent: TrainedAgent,
    /// The action executed last, which the networks take in beside the next observation.
    executed: Vec<f32>,
    rng: ChaCha8Rng,
}

/// Observations on their way to the networks.
enum Seen {
    Pixels(Vec<u8>),
    Vectors(Vec<f32>),
}

impl Seen {
    /// Some rows of numbers or bytes, `[rows, width]`.
    fn rows(&self, rows: std::ops::Range<usize>, width: usize) -> RawFrames<'_> {
        let range = rows.start * width..rows.end * width;
        match self {
            Self::Pixels(bytes) => RawFrames::Pixels(&bytes[range]),
            Self::Vectors(numbers) => RawFrames::Vectors(&numbers[range]),
        }
    }
}

#[pymethods]
impl Model {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        unlocked(py, || Self::load(&path))
    }

    /// The checkpoint's folder.
    #[getter]
    fn checkpoint(&self) -> PathBuf {
        self.checkpoint.clone()
    }

    /// What the model is: its task, what it looks at, the bounds of its actions, its sizes.
    fn config<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &*lock(&self.trained) {
            Trained::World(model) => Ok(pythonize::pythonize(py, &model.config)?),
            Trained::ModelFree(agent) => {
                let [action_min, action_max] = agent.bounds();
                let (task, observation, latent) = (agent.task(), agent.observation(), agent.latent());
                let latents = agent.latents();
                let config = ModelFreeConfig { task, observation, latent, latents, action_min, action_max };
                Ok(pythonize::pythonize(py, &config)?)
            }
        }
    }

    /// Whether it has an actor.
    #[getter]
    fn acts(&self) -> bool {
        self.actor.is_some()
    }

    /// Latents of an episode's rows from its first on: observations `[rows, …]`, the actions before each row `[rows, action]` (the first is not used).
    fn encode<'py>(
        &self,
        py: Python<'py>,
        observations: &Bound<'py, PyAny>,
        previous_actions: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (seen, rows) = self.seen(observations)?;
        let width = self.facts.actions;
        if previous_actions.shape() != [rows, width] {
            let found = previous_actions.shape();
            return Err(refused(format!("previous actions of shape {found:?}; right is [{rows}, {width}]")));
        }
        let actions = owned(&previous_actions);
        finite("the actions", &actions)?;
        let latents = unlocked_with(py, &self.trained, |trained| {
            let mut encoder = trained.encoder().episode(&vibes_model::cpu());
            let mut latents = Vec::with_capacity(rows * self.facts.latent);
            for start in (0..rows).step_by(CHUNK) {
                let chunk = start..rows.min(start + CHUNK);
                let before = &actions[chunk.start * width..chunk.end * width];
                latents.extend(encoder.push(seen.rows(chunk, self.row_len()), before)?);
            }
            Ok::<_, vibes_model::ModelError>(latents)
        })?;
        Ok(shaped(py, latents, &[rows, self.facts.latent])?.into_any())
    }

    /// Forgets the episode before.
    fn begin(&self, py: Python<'_>, seed: u64) -> PyResult<()> {
        unlocked_with(py, self.actor()?, |acting| {
            acting.agent.begin();
            acting.executed.clear();
            acting.rng = ChaCha8Rng::seed_from_u64(seed);
            Ok::<_, vibes_model::ModelError>(())
        })
    }

    /// The action for one observation, `[1, …]`; `executed` is the action that was executed before it, if it was not the one chosen.
    fn act<'py>(
        &self,
        py: Python<'py>,
        observation: &Bound<'py, PyAny>,
        executed: Option<PyReadonlyArray1<'py, f32>>,
        sample: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let actor = self.actor()?;
        let (seen, rows) = self.seen(observation)?;
        if rows != 1 {
            return Err(refused(format!("{rows} observations; an agent acts on one at a time")));
        }
        let executed = executed.map(|action| owned(&action));
        if let Some(executed) = &executed {
            let width = self.facts.actions;
            if executed.len() != width {
                return Err(refused(format!("an executed action of {} numbers; right is {width}", executed.len())));
            }
            finite("the executed action", executed)?;
        }
        let choice = if sample { Choice::Sample } else { Choice::Mode };
        let action = unlocked_with(py, actor, |acting| {
            let Acting { agent, executed: last, rng } = acting;
            if let Some(executed) = executed {
                *last = executed;
            }
            *last = agent.act(seen.rows(0..1, self.row_len()), last, choice, rng)?;
            Ok::<_, vibes_model::ModelError>(last.clone())
        })?;
        let shape = [action.len()];
        Ok(shaped(py, action, &shape)?.into_any())
    }
}

impl Model {
    /// The newest checkpoint of a run's folder, or a checkpoint's folder itself.
    fn load(path: &Path) -> Result<Self, String> {
        let holds = |folder: &Path| encoder_file(folder).is_some();
        let newest = || RunFolder::at(path).newest_checkpoint().ok().filter(|at| holds(at));
        let checkpoint = if holds(path) { Some(path.to_owned()) } else { newest() };
        let checkpoint = checkpoint.ok_or_else(|| {
            format!(
                "no checkpoint here; right is the folder of a run that `vibes-train` has trained: {}",
                path.display()
            )
        })?;
        let device = vibes_model::cpu();
        let words = |error: vibes_model::ModelError| error.to_string();
        let trained = Trained::load(&checkpoint, &device).map_err(words)?;
        let has_actor = actor_file(&checkpoint).is_some();
        let agent = has_actor.then(|| TrainedAgent::load(&checkpoint, &device)).transpose().map_err(words)?;
        let acting = |agent| Mutex::new(Acting { agent, executed: Vec::new(), rng: ChaCha8Rng::seed_from_u64(0) });
        let encoder = trained.encoder();
        let facts = Facts { observation: encoder.observation(), actions: encoder.actions(), latent: encoder.latent() };
        Ok(Self { checkpoint, facts, trained: Mutex::new(trained), actor: agent.map(acting) })
    }

    fn actor(&self) -> PyResult<&Mutex<Acting>> {
        let none = || {
            let at = self.checkpoint.display();
            refused(format!("this model has no actor; a run that `vibes-train online` has trained has one: {at}"))
        };
        self.actor.as_ref().ok_or_else(none)
    }

    /// Numbers or bytes of one observation.
    fn row_len(&self) -> usize {
        match self.facts.observation {
            ObservationKind::Pixels { height, width } => 3 * height * width,
            ObservationKind::Vector { len } => len,
        }
    }

    /// Observations of the kind and shape that the model looks at, and how many they are.
    fn seen(&self, observations: &Bound<'_, PyAny>) -> PyResult<(Seen, usize)> {
        let wrong = |right: String| {
            let shape = observations.getattr("shape").map_or_else(|_| "none".to_owned(), |shape| shape.to_string());
            refused(format!("observations of shape {shape}; this model looks at {right}"))
        };
        match self.facts.observation {
            ObservationKind::Pixels { height, width } => {
                let right = || wrong(format!("uint8 [rows, {height}, {width}, 3]"));
                let array: PyReadonlyArrayDyn<'_, u8> = observations.extract().map_err(|_other| right())?;
                let fits = array.ndim() == 4 && array.shape()[1..] == [height, width, 3] && array.shape()[0] > 0;
                let rows = if fits { array.shape()[0] } else { return Err(right()) };
                Ok((Seen::Pixels(owned(&array)), rows))
            }
            ObservationKind::Vector { len } => {
                let right = || wrong(format!("float32 [rows, {len}]"));
                let array: PyReadonlyArrayDyn<'_, f32> = observations.extract().map_err(|_other| right())?;
                let fits = array.ndim() == 2 && array.shape()[1] == len && array.shape()[0] > 0;
                let rows = if fits { array.shape()[0] } else { return Err(right()) };
                let numbers = owned(&array);
                finite("the observations", &numbers)?;
                Ok((Seen::Vectors(numbers), rows))
            }
        }
    }
}

/// Refuses numbers that are not finite: the networks would silently answer with NaN, and go on doing so until the episode's end.
fn finite(what: &str, numbers: &[f32]) -> PyResult<()> {
    match numbers.iter().find(|number| !number.is_finite()) {
        None => Ok(()),
        Some(number) => Err(refused(format!("{number} in {what}; right is finite numbers"))),
    }
}

/// A thread that panicked while it held the lock leaves a model whole, which is only read, and an agent whose next episode begins anew.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
