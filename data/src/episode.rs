//! One episode in memory, and the one place that says how observations, actions and rewards line up.
//!
//! **The rule**: row t of an episode of T actions (t = 0..=T) holds the observation `o_t`, the action `a_t` taken there and
//! the reward `r_t = r(s_t, a_t)` it earned, summed over the action repeat. Row T has `is_last`, and no action, reward or
//! discount. [`EpisodeBuilder`] can build nothing else: frames and transitions come to it in the order they happen.

use serde::{Deserialize, Serialize};

use crate::{Cell, Error, Result, Spec};

/// A finished episode, column by column. T is the number of actions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// The episode's number.
    pub index: u32,
    /// Its place in the grid, if there is one.
    pub cell: Option<Cell>,
    /// The distractor trajectory under which the policy acted, of a policy that sees pictures; its state trajectory is then the same under every
    /// other distractor of its row.
    pub acting_distractor: Option<u32>,
    /// Whether the last state is terminal (value 0 from there), not only the last recorded.
    pub is_terminal: bool,
    /// `[T, action]`, in the task's own bounds.
    pub actions: Vec<f32>,
    /// `[T]`, summed over the action repeat.
    pub rewards: Vec<f32>,
    /// `[T]`, 0 where the task ended.
    pub discounts: Vec<f32>,
    /// `[T + 1, observation]`.
    pub observations: Vec<f32>,
    /// `[T + 1, qpos]`.
    pub qpos: Vec<f64>,
    /// `[T + 1, qvel]`.
    pub qvel: Vec<f64>,
    /// `[T + 1, height, width, 3]`, or empty.
    pub pixels: Vec<u8>,
    /// `[T + 1]`.
    pub cameras: Vec<CameraPose>,
    /// `[T + 1]`, none where the background is the model's own sky.
    pub backgrounds: Vec<Option<BackgroundFrame>>,
    /// `[T + 1, 3 · materials]`, RGB in `0..=1`.
    pub colors: Vec<f32>,
}

/// The camera's state in the Distracting Control Suite's spherical coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraPose {
    /// Distance from the origin (or from the tracked centre of mass), metres.
    pub r: f64,
    /// Azimuth, radians.
    pub h: f64,
    /// Inclination from the vertical, radians.
    pub v: f64,
    /// Roll about the optical axis, radians.
    pub roll: f64,
}

/// Which frame of which background video is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BackgroundFrame {
    /// Index into the manifest's videos.
    pub video: u32,
    /// Frame of that video.
    pub frame: u32,
}

/// Everything seen at one row: the state, the picture and the distractors' parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// `[observation]`.
    pub observation: Vec<f32>,
    /// `[qpos]`.
    pub qpos: Vec<f64>,
    /// `[qvel]`.
    pub qvel: Vec<f64>,
    /// `[height, width, 3]`, or empty.
    pub pixels: Vec<u8>,
    /// The camera.
    pub camera: CameraPose,
    /// The background.
    pub background: Option<BackgroundFrame>,
    /// `[3 · materials]`.
    pub colors: Vec<f32>,
}

/// Builds an [`Episode`] in the order in which things happen.
#[derive(Clone, Debug)]
pub struct EpisodeBuilder {
    episode: Episode,
}

impl EpisodeBuilder {
    /// Begins an episode with what is seen at row 0.
    pub fn first(index: u32, cell: Option<Cell>, frame: Frame) -> Self {
        let episode = Episode { index, cell, ..Episode::default() };
        let mut builder = Self { episode };
        builder.push(frame);
        builder
    }

    /// Says under which distractor trajectory the policy acts.
    #[must_use]
    pub fn acting_under(mut self, distractor: Option<u32>) -> Self {
        self.episode.acting_distractor = distractor;
        self
    }

    /// The action taken at the latest row, what it earned there, and what is seen next.
    pub fn step(&mut self, action: &[f32], reward: f32, discount: f32, next: Frame) {
        self.episode.actions.extend_from_slice(action);
        self.episode.rewards.push(reward);
        self.episode.discounts.push(discount);
        self.push(next);
    }

    /// Ends the episode at the latest row.
    pub fn finish(mut self, is_terminal: bool) -> Episode {
        self.episode.is_terminal = is_terminal;
        self.episode
    }

    fn push(&mut self, frame: Frame) {
        let episode = &mut self.episode;
        episode.observations.extend(frame.observation);
        episode.qpos.extend(frame.qpos);
        episode.qvel.extend(frame.qvel);
        episode.pixels.extend(frame.pixels);
        episode.cameras.push(frame.camera);
        episode.backgrounds.push(frame.background);
        episode.colors.extend(frame.colors);
    }
}

impl Episode {
    /// Number of actions T.
    pub fn steps(&self) -> usize {
        self.rewards.len()
    }

    /// Number of rows, T + 1.
    pub fn rows(&self) -> usize {
        self.steps() + 1
    }

    /// Sum of the rewards; 0 without any, where `sum` would give −0.
    pub fn episode_return(&self) -> f64 {
        self.rewards.iter().fold(0.0, |sum, &reward| sum + f64::from(reward))
    }

    /// Checks every column's length against the spec, and that actions, rewards and discounts are finite: one that is not would make every sum over
    /// it none, and JSON cannot hold such a return.
    ///
    /// # Errors
    /// [`Error::Episode`] naming the first column that does not fit.
    pub fn check(&self, spec: &Spec) -> Result<()> {
        let (steps, rows) = (self.steps(), self.rows());
        let columns = [
            ("action", self.actions.len(), steps * spec.action_len()),
            ("discount", self.discounts.len(), steps),
            ("observation", self.observations.len(), rows * spec.observation_len()),
            ("qpos", self.qpos.len(), rows * spec.qpos),
            ("qvel", self.qvel.len(), rows * spec.qvel),
            ("pixels", self.pixels.len(), rows * spec.pixels_len()),
            ("camera", self.cameras.len(), rows),
            ("video and frame", self.backgrounds.len(), rows),
            ("colors", self.colors.len(), rows * 3 * spec.materials.len()),
        ];
        let fault = |fact: String, expected: String| Error::Episode { index: self.index, fact, expected };
        if let Some((column, found, expected)) = columns.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(fault(format!("{column} holds {found} numbers"), format!("{expected} for {steps} actions")));
        }
        let columns = [
            ("action", &self.actions, spec.action_len()),
            ("reward", &self.rewards, 1),
            ("discount", &self.discounts, 1),
        ];
        match columns.into_iter().find_map(|(name, values, len)| first_not_finite(name, values, len)) {
            Some(fact) => Err(fault(fact, "a finite number".into())),
            None => Ok(()),
        }
    }

    /// Says where an observation is no finite number, if one is. Such an episode can be recorded, since a simulator that went astray is worth
    /// looking at, but nothing can be learned from it.
    pub fn observation_fault(&self, spec: &Spec) -> Option<String> {
        first_not_finite("observation", &self.observations, spec.observation_len())
    }

    /// Whether two episodes are the same to the bit, so that a number that is none equals itself.
    pub(crate) fn same_bits(&self, other: &Self) -> bool {
        fn singles(a: &[f32], b: &[f32]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        fn doubles(a: &[f64], b: &[f64]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        let cameras = |episode: &Self| -> Vec<f64> {
            episode.cameras.iter().flat_map(|camera| [camera.r, camera.h, camera.v, camera.roll]).collect()
        };
        let head = |episode: &Self| (episode.index, episode.cell, episode.acting_distractor, episode.is_terminal);
        head(self) == head(other)
            && self.pixels == other.pixels
            && self.backgrounds == other.backgrounds
            && singles(&self.actions, &other.actions)
            && singles(&self.rewards, &other.rewards)
            && singles(&self.discounts, &other.discounts)
            && singles(&self.observations, &other.observations)
            && singles(&self.colors, &other.colors)
            && doubles(&self.qpos, &other.qpos)
            && doubles(&self.qvel, &other.qvel)
            && doubles(&cameras(self), &cameras(other))
    }
}

/// The first number of a column `[rows, len]` that is none, in words.
pub(crate) fn first_not_finite(name: &str, values: &[f32], len: usize) -> Option<String> {
    let place = values.iter().position(|value| !value.is_finite())?;
    Some(format!("the {name} of step {} is {}", place / len.max(1), values[place]))
}
