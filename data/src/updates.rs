//! The windows of an update, from one or more recordings: which they are follows from a seed and the update's number alone.
//!
//! In: recordings, a window length, a batch size, a seed. Out: a [`WindowBatch`] per update. The trainer and the Python package both draw here, so that
//! they see the same windows.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{Recording, Result, WindowBatch, WindowSampler};

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

/// Draws windows from one or more recordings; every window of every recording is equally likely.
#[derive(Debug)]
pub struct Windows {
    samplers: Vec<WindowSampler>,
    batch: usize,
}

impl Windows {
    /// Opens every recording for windows of `length` rows, `batch` of them at a time.
    ///
    /// # Errors
    /// No episode of a recording is as long as a window.
    pub fn new(recordings: &[Recording], length: usize, batch: usize) -> Result<Self> {
        let samplers =
            recordings.iter().map(|recording| WindowSampler::new(recording, length)).collect::<Result<_>>()?;
        Ok(Self { samplers, batch })
    }

    /// Gives the memory of the recordings' pages back until they are looked at again.
    pub fn release(&self) {
        self.samplers.iter().for_each(WindowSampler::release);
    }

    /// The windows of one update.
    pub fn sample(&self, rng: &mut impl Rng) -> WindowBatch {
        self.draw(self.batch, rng)
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
        WindowBatch::side_by_side(drawn.map(|(sampler, count)| sampler.sample(count, rng)).collect())
    }
}

impl WindowBatch {
    /// Joins batches of the same length along their batch axis.
    pub fn side_by_side(mut parts: Vec<Self>) -> Self {
        if parts.len() == 1 {
            return parts.remove(0);
        }
        let length = parts.first().map_or(0, |part| part.length);
        let mut all = Self { length, batch: parts.iter().map(|part| part.batch).sum(), ..Self::default() };
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
}

fn step_of<T>(values: &[T], step: usize, length: usize) -> &[T] {
    let width = values.len() / length;
    &values[step * width..(step + 1) * width]
}
