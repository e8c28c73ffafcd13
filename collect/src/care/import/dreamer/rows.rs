//! Rows of an episode as a Dreamer file has them, and the one place that says how they become ours.

use vibes_data::Episode;

use super::super::without_distractors;

/// Which action stands in row t.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Convention {
    /// The one that led to observation t; row 0 has zeros. Dreamer, DreamerV2, V-D4RL.
    ActionBefore,
    /// The one that was chosen after observation t, as here; the last row's is never executed. `DreamerV3`.
    ActionAfter,
}

/// Rows that follow each other in one episode.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// `[rows, action]`.
    pub(super) actions: Vec<f32>,
    /// `[rows]`; row t's came with observation t.
    pub(super) rewards: Vec<f32>,
    /// `[rows]`, 0 at a terminal state.
    pub(super) discounts: Vec<f32>,
    /// Whether the last row is terminal.
    pub(super) is_terminal: bool,
    /// `[rows, observation]`.
    pub(super) observations: Vec<f32>,
    /// `[rows, height, width, 3]`, or empty.
    pub(super) pixels: Vec<u8>,
}

impl Rows {
    /// Goes on with rows of the next file.
    pub(super) fn append(&mut self, next: Self) {
        self.actions.extend(next.actions);
        self.rewards.extend(next.rewards);
        self.discounts.extend(next.discounts);
        self.observations.extend(next.observations);
        self.pixels.extend(next.pixels);
        self.is_terminal = next.is_terminal;
    }

    /// The episode of these rows, whose actions have `width` numbers.
    pub(super) fn episode(mut self, index: u32, width: usize, convention: Convention) -> Episode {
        let steps = self.rewards.len().saturating_sub(1);
        match convention {
            Convention::ActionBefore => drop(self.actions.drain(..width)),
            Convention::ActionAfter => self.actions.truncate(steps * width),
        }
        let mut episode = Episode {
            index,
            is_terminal: steps > 0 && self.is_terminal,
            actions: self.actions,
            rewards: self.rewards.split_off(1),
            discounts: self.discounts.split_off(1),
            observations: self.observations,
            pixels: self.pixels,
            ..Episode::default()
        };
        without_distractors(&mut episode);
        episode
    }
}
