//! The distractors: what changes in the picture without changing the task.
//!
//! In: how strong they are ([`DistractorSettings`]), where the camera starts, the model's colours, the videos' lengths and a seed per axis. Out: a
//! [`DistractorTrajectory`] of *parameters* per agent step, or a [`DistractorWalk`] that gives one step at a time. It knows nothing of the physics, so one trajectory can be laid over any
//! state trajectory of the task; the renderer composes the two.

pub mod background;
pub mod camera;
pub mod color;
mod preset;
pub mod view;
mod walk;

use std::fmt;
use std::str::FromStr;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use vibes_data::{BackgroundFrame, CameraPose};

pub use preset::{CameraRanges, ColorRanges, Difficulty};

pub use walk::DistractorWalk;

use crate::error::Error;
use camera::CameraStart;

/// Which axes are distracted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Axes {
    /// Videos instead of the sky.
    pub background: bool,
    /// A moving camera.
    pub camera: bool,
    /// Changing material colours.
    pub color: bool,
}

impl Axes {
    /// All three.
    pub const ALL: Self = Self { background: true, camera: true, color: true };
    /// None: the task as it is.
    pub const NONE: Self = Self { background: false, camera: false, color: false };

    /// The names of the axes that are on.
    pub fn names(self) -> Vec<&'static str> {
        [("background", self.background), ("camera", self.camera), ("color", self.color)]
            .into_iter()
            .filter_map(|(name, on)| on.then_some(name))
            .collect()
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.names().as_slice() {
            [] => f.write_str("none"),
            names => f.write_str(&names.join(",")),
        }
    }
}

impl FromStr for Axes {
    type Err = Error;

    /// `all`, `none`, or a list such as `camera,color`.
    fn from_str(text: &str) -> Result<Self, Error> {
        let mut axes = Self::NONE;
        for name in text.split(',').map(str::trim) {
            match name {
                "all" => axes = Self::ALL,
                "none" => {}
                "background" => axes.background = true,
                "camera" => axes.camera = true,
                "color" => axes.color = true,
                _ => {
                    let known = "background, camera, color, all, none".to_owned();
                    return Err(Error::UnknownName { what: "distractor", name: name.to_owned(), known });
                }
            }
        }
        Ok(axes)
    }
}

/// What is distracted, and how strongly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DistractorSettings {
    /// Which axes.
    pub axes: Axes,
    /// How far they go.
    pub difficulty: Difficulty,
    /// They change during an episode; otherwise they keep what was drawn at its reset.
    pub dynamic: bool,
}

impl Default for DistractorSettings {
    fn default() -> Self {
        Self { axes: Axes::ALL, difficulty: Difficulty::Easy, dynamic: true }
    }
}

/// A seed per axis, so that one axis can change while the others stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisSeeds {
    /// Choice of video, start and direction.
    pub background: u64,
    /// The camera's walk.
    pub camera: u64,
    /// The colours' walk.
    pub color: u64,
}

impl From<u64> for AxisSeeds {
    /// The same seed for all; each axis draws from a stream of its own.
    fn from(seed: u64) -> Self {
        Self { background: seed, camera: seed, color: seed }
    }
}

impl AxisSeeds {
    fn generators(self) -> [ChaCha8Rng; 3] {
        let stream = |seed, stream| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(stream);
            rng
        };
        [stream(self.background, 1), stream(self.camera, 2), stream(self.color, 3)]
    }
}

/// What the distractors have to know of a task's scene. Source: `distracting_control/suite_utils.py` and `camera.py`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenery {
    /// The camera must stay above the ground and on its own side: everywhere but where the scene is seen from above.
    pub upper_quadrant: bool,
    /// Opacity of the ground (the material "grid") in front of a video, `0..=1`.
    pub ground_alpha: f32,
}

impl Scenery {
    /// As most tasks of the suite have it.
    pub const DEFAULT: Self = Self { upper_quadrant: true, ground_alpha: 0.3 };
}

/// What the distractors start from: the task's own picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Undistracted {
    /// The model's own camera.
    pub camera: CameraStart,
    /// The model's own material colours, `[materials, 3]`.
    pub colors: Vec<f32>,
    /// Number of frames of each video; empty shows the model's own sky.
    pub video_frames: Vec<usize>,
}

/// The distractors at one row, as a picture shows them.
#[derive(Clone, Copy, Debug, Default)]
pub struct View<'a> {
    /// Where the camera is; none for the model's own.
    pub camera: Option<CameraPose>,
    /// The video frame in the sky; none for the model's own sky, and an opaque ground.
    pub background: Option<BackgroundFrame>,
    /// RGB of every material, `[materials, 3]`; none for the model's own.
    pub colors: Option<&'a [f32]>,
}

/// The distractors' parameters at every row of an episode of T agent steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DistractorTrajectory {
    /// `[T + 1]`; the rest pose where the camera axis is off.
    pub cameras: Vec<CameraPose>,
    /// `[T + 1]`; none where the background axis is off.
    pub backgrounds: Vec<Option<BackgroundFrame>>,
    /// `[T + 1, 3 · materials]`; the model's own where the colour axis is off.
    pub colors: Vec<f32>,
}

impl DistractorTrajectory {
    /// Walks all axes for `steps` agent steps of `action_repeat` control steps each. Row 0 is what the reset shows.
    pub fn generate(
        settings: &DistractorSettings,
        from: &Undistracted,
        steps: usize,
        action_repeat: usize,
        seeds: AxisSeeds,
    ) -> Self {
        let mut walk = DistractorWalk::reset(settings, from, seeds);
        let mut trajectory = Self::default();
        trajectory.push(&walk);
        for _ in 0..steps {
            (0..action_repeat).for_each(|_| walk.advance());
            trajectory.push(&walk);
        }
        trajectory
    }

    fn push(&mut self, walk: &DistractorWalk) {
        self.cameras.push(walk.camera());
        self.backgrounds.push(walk.background());
        self.colors.extend_from_slice(walk.colors());
    }

    /// Number of rows, T + 1.
    pub fn rows(&self) -> usize {
        self.cameras.len()
    }

    /// A row, as the renderer takes it.
    pub fn view(&self, row: usize) -> View<'_> {
        View { camera: Some(self.cameras[row]), background: self.backgrounds[row], colors: Some(self.colors(row)) }
    }

    /// The material colours at a row, `[materials, 3]`.
    pub fn colors(&self, row: usize) -> &[f32] {
        let channels = self.colors.len() / self.rows().max(1);
        &self.colors[row * channels..(row + 1) * channels]
    }
}

#[cfg(test)]
mod tests;
