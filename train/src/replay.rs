//! What online training has lived through: a recording in the run folder, `RUN/replay/`, that grows by one episode at a time, and beside it the recordings the run was
//! given. In: finished episodes. Out: the windows of every update, a stated share of each batch from the recordings.
//!
//! An episode is *written* as soon as it is finished, and *admitted* to what windows are drawn from at a fixed number of updates; so a run that was stopped
//! draws the same windows as one that was not.

use std::path::Path;
use std::sync::Arc;

use rand::Rng;
use vibes_data::{Episode, EpisodeInfo, Manifest, Recording, RecordingWriter, WindowBatch, WindowSampler};

use crate::error::{Result, TrainError};
use crate::windows::{Source, Windows};

/// The recording of an online run and the windows drawn from it.
#[derive(Debug)]
pub struct Replay {
    writer: Arc<RecordingWriter>,
    own: WindowSampler,
    admitted: u32,
    given: Option<Windows>,
    /// Share of a batch from the given recordings, once there are own ones too.
    given_share: f64,
    batch: usize,
}

/// Sizes of the windows, and how many of a batch come from the given recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayOptions {
    /// Rows of a window.
    pub length: usize,
    /// Windows of a batch.
    pub batch: usize,
    /// Share of a batch from the given recordings.
    pub given_share: f64,
}

impl Replay {
    /// Begins the recording at `path`, or goes on with it after its first `admitted` episodes; later ones are removed, to be lived through again, but for the first `kept` of
    /// all, which depend on nothing that was learned.
    ///
    /// # Errors
    /// Another recording is there, or an episode is missing or damaged, or a given recording has no episode as long as a window.
    pub fn open(
        path: &Path,
        manifest: Manifest,
        (admitted, kept): (u32, u32),
        given: &[Recording],
        options: ReplayOptions,
    ) -> Result<Self> {
        let ReplayOptions { length, batch, given_share } = options;
        let own = WindowSampler::growing(&manifest.spec, length);
        let writer = RecordingWriter::create_or_resume(path, manifest, false)?;
        writer.remove_from(admitted.max(kept))?;
        let given = (!given.is_empty()).then(|| Windows::new(given, length, batch)).transpose()?;
        let mut replay = Self { writer: Arc::new(writer), own, admitted: 0, given, given_share, batch };
        while replay.admitted < admitted {
            replay.admit()?;
        }
        Ok(replay)
    }

    /// What writes finished episodes, for the thread that lives through them.
    pub fn writer(&self) -> Arc<RecordingWriter> {
        Arc::clone(&self.writer)
    }

    /// Episodes admitted so far; the next one has this number.
    pub fn admitted(&self) -> u32 {
        self.admitted
    }

    /// Agent steps and return of the episode that would be admitted next, where it is written already.
    ///
    /// # Errors
    /// It is damaged.
    pub fn next_written(&self) -> Result<Option<(u32, f64)>> {
        if !self.writer.has(self.admitted) {
            return Ok(None);
        }
        let episode = self.writer.episode(self.admitted)?;
        let rewards = (0..episode.steps()).map(|step| f64::from(episode.reward(step)));
        Ok(Some((episode.steps() as u32, rewards.sum())))
    }

    /// Admits the next episode, which has been written.
    ///
    /// # Errors
    /// It is missing or damaged, or holds numbers that are none.
    pub fn admit(&mut self) -> Result<()> {
        self.own.admit(self.writer.episode(self.admitted)?)?;
        self.admitted += 1;
        Ok(())
    }

    /// Brings the recording's manifest up to its episodes.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn complete(&self) -> Result<()> {
        Ok(self.writer.complete()?)
    }

    /// Whether there is anything to draw from.
    pub fn is_empty(&self) -> bool {
        self.own.windows() == 0 && self.given.is_none()
    }
}

impl Replay {
    /// So many windows: the stated share from the given recordings, on average where it is no whole number of windows, the rest from the own one.
    ///
    /// # Panics
    /// There is nothing to draw from, see [`Replay::is_empty`].
    pub fn draw(&self, batch: usize, rng: &mut impl Rng) -> WindowBatch {
        let Some(given) = &self.given else { return self.own.sample(batch, rng) };
        let share = windows_of(batch as f64 * self.given_share, rng);
        let from_given = if self.own.windows() == 0 { batch } else { share.min(batch) };
        let mut parts = Vec::new();
        if from_given < batch {
            parts.push(self.own.sample(batch - from_given, rng));
        }
        if from_given > 0 {
            parts.push(given.draw(from_given, rng));
        }
        WindowBatch::side_by_side(parts)
    }
}

/// So many windows; on average, where that is no whole number.
fn windows_of(share: f64, rng: &mut impl Rng) -> usize {
    let part = share.fract();
    // Nothing is drawn where there is nothing to decide.
    share as usize + usize::from(part > 0.0 && rng.random::<f64>() < part)
}

impl Source for Replay {
    fn sample(&self, rng: &mut impl Rng) -> WindowBatch {
        self.draw(self.batch, rng)
    }

    fn release(&self) {
        self.own.release();
        if let Some(given) = &self.given {
            given.release();
        }
    }
}

/// Writes a finished episode: there whole afterwards, or not at all.
///
/// # Errors
/// The disk is full, or the episode does not fit the recording.
pub fn write(writer: &RecordingWriter, episode: &Episode, info: EpisodeInfo) -> Result<()> {
    writer.write(episode, info).map_err(TrainError::from)
}

#[cfg(test)]
mod tests {
    use rand::{RngCore, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_share_of_a_batch_is_what_was_asked_for_on_average() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for (share, batch) in [(0.7, 8), (0.05, 8), (0.33, 3)] {
            let drawn: usize = (0..4000).map(|_| windows_of(share * f64::from(batch), &mut rng)).sum();
            let found = drawn as f64 / f64::from(4000 * batch);
            assert!((found - share).abs() < 0.01, "{found} instead of {share} of {batch}");
        }
        let (mut untouched, mut whole) = (ChaCha8Rng::seed_from_u64(1), ChaCha8Rng::seed_from_u64(1));
        assert_eq!(windows_of(4.0, &mut whole), 4);
        assert_eq!(whole.next_u64(), untouched.next_u64(), "half of 8 needs no chance");
    }
}
