//! The windows of every update, gathered ahead of time by a thread of their own, so that the trainer never waits for data. Which windows an update sees, and
//! its noise, follow from the seed and the update's number alone; so a run that is stopped and continued sees the same.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, Scope};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Recording, WindowBatch, WindowSampler};

use crate::error::{Result, TrainError};

/// Batches that wait to be used.
const AHEAD: usize = 3;
/// Bytes gathered before the recordings' pages are given back, so that memory does not grow to the size of the recordings.
const RELEASE_AFTER: usize = 1 << 29;

/// What a generator is for; each has its own stream of numbers at every update.
#[derive(Debug, Clone, Copy)]
pub enum Purpose {
    /// Choosing windows.
    Windows,
    /// Sampling latents.
    Noise,
    /// Choosing the windows that set the first scales.
    Calibration,
    /// Imagined actions and latents.
    Imagination,
    /// Latents imagined along recorded actions.
    Foresight,
}

impl Purpose {
    const COUNT: u64 = 3;

    /// Its stream at an update; stream 0 is the first weights'. What came later has streams of its own, so that the older ones stay as they were.
    fn stream(self, update: u64) -> u64 {
        match self {
            Self::Windows | Self::Noise | Self::Calibration => 1 + Self::COUNT * update + self as u64,
            Self::Imagination => (1 << 60) + update,
            Self::Foresight => (1 << 61) + update,
        }
    }
}

/// The generator of one update.
pub fn update_rng(seed: u64, update: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(purpose.stream(update));
    rng
}

/// What the windows of updates are drawn from.
pub trait Source: Sync {
    /// The windows of one update.
    fn sample(&self, rng: &mut impl Rng) -> WindowBatch;

    /// Gives the memory of the recordings' pages back until they are looked at again.
    fn release(&self);
}

/// Draws windows from one or more recordings; every window of every recording is equally likely.
#[derive(Debug)]
pub struct Windows {
    samplers: Vec<WindowSampler>,
    batch: usize,
}

impl Windows {
    /// # Errors
    /// No episode of a recording is as long as a window.
    pub fn new(recordings: &[Recording], length: usize, batch: usize) -> Result<Self> {
        let samplers = recordings
            .iter()
            .map(|recording| WindowSampler::new(recording, length))
            .collect::<std::result::Result<_, _>>()?;
        Ok(Self { samplers, batch })
    }

    /// So many windows.
    pub fn draw(&self, batch: usize, rng: &mut impl Rng) -> WindowBatch {
        let total: u64 = self.samplers.iter().map(WindowSampler::windows).sum();
        let mut counts = vec![0; self.samplers.len()];
        for _ in 0..batch {
            let mut window = rng.random_range(0..total);
            for (count, sampler) in counts.iter_mut().zip(&self.samplers) {
                if window < sampler.windows() {
                    *count += 1;
                    break;
                }
                window -= sampler.windows();
            }
        }
        let drawn = self.samplers.iter().zip(counts).filter(|(_, count)| *count > 0);
        side_by_side(drawn.map(|(sampler, count)| sampler.sample(count, rng)).collect())
    }
}

impl Source for Windows {
    fn sample(&self, rng: &mut impl Rng) -> WindowBatch {
        self.draw(self.batch, rng)
    }

    fn release(&self) {
        self.samplers.iter().for_each(WindowSampler::release);
    }
}

/// Joins batches of the same length along their batch axis.
pub(crate) fn side_by_side(mut parts: Vec<WindowBatch>) -> WindowBatch {
    if parts.len() == 1 {
        return parts.remove(0);
    }
    let length = parts.first().map_or(0, |part| part.length);
    let mut all = WindowBatch { length, batch: parts.iter().map(|part| part.batch).sum(), ..WindowBatch::default() };
    for step in 0..length {
        for part in &parts {
            all.pixels.extend_from_slice(step_of(&part.pixels, step, length));
            all.observations.extend_from_slice(step_of(&part.observations, step, length));
            all.actions.extend_from_slice(step_of(&part.actions, step, length));
            all.previous_actions.extend_from_slice(step_of(&part.previous_actions, step, length));
            all.rewards.extend_from_slice(step_of(&part.rewards, step, length));
            all.is_first.extend_from_slice(step_of(&part.is_first, step, length));
        }
    }
    all.starts = parts.into_iter().flat_map(|part| part.starts).collect();
    all
}

fn step_of<T>(values: &[T], step: usize, length: usize) -> &[T] {
    let width = values.len() / length;
    &values[step * width..(step + 1) * width]
}

/// The batches of consecutive updates, gathered by a thread of `scope` that ends when this is dropped or the last update is reached.
#[derive(Debug)]
pub struct Prefetch {
    batches: Receiver<WindowBatch>,
}

impl Prefetch {
    /// Begins to gather.
    pub fn start<'scope>(
        scope: &'scope Scope<'scope, '_>,
        windows: &'scope impl Source,
        seed: u64,
        updates: std::ops::Range<u64>,
    ) -> Self {
        let (sender, batches) = sync_channel(AHEAD);
        let gather = move || {
            let mut gathered = 0;
            for update in updates {
                let batch = windows.sample(&mut update_rng(seed, update, Purpose::Windows));
                gathered += batch.pixels.len();
                if gathered > RELEASE_AFTER {
                    windows.release();
                    gathered = 0;
                }
                if sender.send(batch).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("windows".to_owned()).spawn_scoped(scope, gather).ok();
        Self { batches }
    }

    /// The next update's windows.
    ///
    /// # Errors
    /// The thread has stopped.
    #[allow(clippy::should_implement_trait, reason = "an iterator would hide that the thread can fail")]
    pub fn next(&self) -> Result<WindowBatch> {
        self.batches.recv().map_err(|_gone| TrainError::NoWindows)
    }
}
