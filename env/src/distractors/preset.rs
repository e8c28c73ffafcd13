//! How strong the distractors are: the suite's difficulty levels as the numbers each axis uses.
//!
//! In: a [`Difficulty`], dynamic or static. Out: [`CameraRanges`], [`ColorRanges`] and a number of videos. Source: `distracting_control/suite_utils.py`. Angles in radians, lengths as fractions of the camera's
//! start radius, speeds per control step.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The suite's difficulty levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Difficulty {
    /// Scale 0.1, four videos.
    #[default]
    Easy,
    /// Scale 0.2, eight videos.
    Medium,
    /// Scale 0.3, all videos.
    Hard,
}

impl Difficulty {
    /// Every level, mildest first.
    pub const ALL: [Self; 3] = [Self::Easy, Self::Medium, Self::Hard];

    /// β, to which every range is proportional.
    pub fn scale(self) -> f64 {
        match self {
            Self::Easy => 0.1,
            Self::Medium => 0.2,
            Self::Hard => 0.3,
        }
    }

    /// How many videos of the list are used, from its head; `None` for all of them.
    pub fn videos(self) -> Option<usize> {
        match self {
            Self::Easy => Some(4),
            Self::Medium => Some(8),
            Self::Hard => None,
        }
    }

    /// The level's name as typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
        }
    }
}

impl fmt::Display for Difficulty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Difficulty {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|level| level.name() == text).ok_or_else(|| Error::UnknownName {
            what: "difficulty",
            name: text.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// What the camera may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRanges {
    /// Largest change of azimuth, inclination and roll from the start, radians.
    pub angle: f64,
    /// Largest fraction of the radius by which the camera comes closer.
    pub zoom_in: f64,
    /// Largest fraction of the radius by which it goes farther.
    pub zoom_out: f64,
    /// Standard deviation of the velocity's change; times [`velocity_scaling`](super::camera::CameraBounds::velocity_scaling), metres per step.
    pub velocity_std: f64,
    /// Largest speed, scaled alike.
    pub max_velocity: f64,
    /// Standard deviation of the roll velocity's change, radians per step.
    pub roll_std: f64,
    /// Largest roll velocity, radians per step.
    pub max_roll_velocity: f64,
}

impl CameraRanges {
    /// The suite's ranges; a static camera keeps the pose drawn at the reset.
    pub fn new(difficulty: Difficulty, dynamic: bool) -> Self {
        let scale = difficulty.scale();
        let moving = |value: f64| if dynamic { value } else { 0.0 };
        Self {
            angle: FRAC_PI_2 * scale,
            zoom_in: 0.5 * scale,
            zoom_out: 1.5 * scale,
            velocity_std: moving(0.1 * scale),
            max_velocity: moving(0.4 * scale),
            roll_std: moving(PI / 300.0 * scale),
            max_roll_velocity: moving(PI / 50.0 * scale),
        }
    }
}

/// What the colours may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorRanges {
    /// Largest distance of a channel from the model's own, in `0..=1`.
    pub max_delta: f32,
    /// Standard deviation of a channel's change per step.
    pub step_std: f64,
}

impl ColorRanges {
    /// The suite's ranges; static colours keep what was drawn at the reset.
    pub fn new(difficulty: Difficulty, dynamic: bool) -> Self {
        let scale = difficulty.scale();
        Self { max_delta: scale as f32, step_std: if dynamic { 0.03 * scale } else { 0.0 } }
    }
}
