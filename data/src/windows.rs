//! Random windows for training, gathered from memory-mapped episodes. In: a recording, a window length, a generator. Out:
//! batches in the order of Algorithm 1, `[length, batch, …]`.
//!
//! A window never crosses an episode, and each of its rows has an action and a reward, so the last row of an episode is in
//! none. All windows of all episodes are equally likely. The action before the window is known even in mid-episode.

use rand::Rng;

use crate::{EpisodeView, Error, Recording, Result, Spec};

/// Draws windows of one length from one or more recordings of the same spec.
#[derive(Clone, Debug)]
pub struct WindowSampler {
    episodes: Vec<EpisodeView>,
    /// Running count of windows, so that a window's number finds its episode by bisection.
    ends: Vec<u64>,
    length: usize,
    sizes: Sizes,
}

#[derive(Clone, Copy, Debug)]
struct Sizes {
    action: usize,
    observation: usize,
    pixels: usize,
}

/// A batch of windows, time first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowBatch {
    /// Rows a window.
    pub length: usize,
    /// Windows.
    pub batch: usize,
    /// `[length, batch, height, width, 3]`, empty without pictures.
    pub pixels: Vec<u8>,
    /// `[length, batch, observation]`.
    pub observations: Vec<f32>,
    /// `[length, batch, action]`, the action taken at each row.
    pub actions: Vec<f32>,
    /// `[length, batch, action]`, the action taken before each row, zeros where `is_first`.
    pub previous_actions: Vec<f32>,
    /// `[length, batch]`, the reward of each row's action.
    pub rewards: Vec<f32>,
    /// `[length, batch]`, whether the row begins its episode.
    pub is_first: Vec<bool>,
    /// `[batch]`, episode number and step of each window's first row.
    pub starts: Vec<(u32, u32)>,
}

impl WindowSampler {
    /// Maps every episode of a recording that is long enough.
    ///
    /// # Errors
    /// [`Error::WindowTooLong`] when none is, [`Error::Malformed`] for a damaged episode, or one with an action, a reward or an observation that is no finite number.
    pub fn new(recording: &Recording, length: usize) -> Result<Self> {
        Self::check_length(recording, length)?;
        let mut sampler = Self::growing(&recording.manifest().spec, length);
        for entry in recording.episodes().iter().filter(|entry| entry.steps as usize >= length) {
            sampler.admit(recording.episode(entry.index)?)?;
        }
        Ok(sampler)
    }

    /// That some episode of a recording has a window of `length` rows, by its manifest alone.
    ///
    /// # Errors
    /// [`Error::WindowTooLong`].
    pub fn check_length(recording: &Recording, length: usize) -> Result<()> {
        let longest = recording.episodes().iter().map(|entry| entry.steps as usize).max().unwrap_or(0);
        if longest < length.max(1) {
            return Err(Error::WindowTooLong { length, longest, path: recording.path().into() });
        }
        Ok(())
    }

    /// A sampler of a recording that is still to grow: there are no windows before an episode is [admitted](Self::admit).
    pub fn growing(spec: &Spec, length: usize) -> Self {
        let sizes = Sizes { action: spec.action_len(), observation: spec.observation_len(), pixels: spec.pixels_len() };
        Self { episodes: Vec::new(), ends: Vec::new(), length: length.max(1), sizes }
    }

    /// Takes in another episode of the same spec; one that is shorter than a window has none.
    ///
    /// # Errors
    /// [`Error::Malformed`] when an action, a reward or an observation of it is no finite number: nothing can be learned from it.
    pub fn admit(&mut self, episode: EpisodeView) -> Result<()> {
        episode.check_numbers()?;
        if let Some(more) = (episode.steps() + 1).checked_sub(self.length).filter(|&windows| windows > 0) {
            self.ends.push(self.windows() + more as u64);
            self.episodes.push(episode);
        }
        Ok(())
    }

    /// How many different windows there are.
    pub fn windows(&self) -> u64 {
        self.ends.last().copied().unwrap_or(0)
    }

    /// Draws a batch of windows.
    pub fn sample(&self, batch: usize, rng: &mut impl Rng) -> WindowBatch {
        let starts: Vec<(usize, usize)> =
            (0..batch).map(|_| self.locate(rng.random_range(0..self.windows()))).collect();
        self.gather(&starts)
    }

    /// The windows of these numbers, each below [`Self::windows`] (taken modulo that); they count episode by episode, start by start.
    pub fn numbered(&self, numbers: &[u64]) -> WindowBatch {
        let starts: Vec<(usize, usize)> = numbers.iter().map(|number| self.locate(number % self.windows())).collect();
        self.gather(&starts)
    }

    /// Gives the memory of the episodes' pages back until they are looked at again (see [`EpisodeView::release`]).
    pub fn release(&self) {
        self.episodes.iter().for_each(EpisodeView::release);
    }

    fn locate(&self, window: u64) -> (usize, usize) {
        let episode = self.ends.partition_point(|&end| end <= window);
        let before = if episode == 0 { 0 } else { self.ends[episode - 1] };
        (episode, (window - before) as usize)
    }

    fn gather(&self, starts: &[(usize, usize)]) -> WindowBatch {
        let rows = self.length * starts.len();
        let mut out = WindowBatch { length: self.length, batch: starts.len(), ..WindowBatch::default() };
        out.pixels.reserve_exact(rows * self.sizes.pixels);
        out.observations.reserve_exact(rows * self.sizes.observation);
        out.starts = starts.iter().map(|&(episode, step)| (self.episodes[episode].index(), step as u32)).collect();
        for t in 0..self.length {
            for &(episode, start) in starts {
                self.push_row(&mut out, &self.episodes[episode], start + t);
            }
        }
        out
    }

    fn push_row(&self, out: &mut WindowBatch, episode: &EpisodeView, row: usize) {
        let pixels = episode.pixels(row);
        out.pixels.extend_from_slice(pixels);
        // A row whose picture is missing shows black.
        out.pixels.extend(std::iter::repeat_n(0, self.sizes.pixels - pixels.len()));
        out.observations.extend_from_slice(episode.observation(row));
        out.actions.extend_from_slice(episode.action(row));
        match row {
            0 => out.previous_actions.extend(std::iter::repeat_n(0.0, self.sizes.action)),
            _ => out.previous_actions.extend_from_slice(episode.action(row - 1)),
        }
        out.rewards.push(episode.reward(row));
        out.is_first.push(row == 0);
    }
}
