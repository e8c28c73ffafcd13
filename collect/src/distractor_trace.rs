//! Traces of the suite's own distractors, to compare ours with.
//!
//! In: a `vibes-distractor-trace/1` file: for every control step of an episode the positions, the random draws, and what the suite made of them
//! (camera pose and frame, material colours, video frame, for some steps pictures). Out: a [`TraceComparison`], and a
//! [`PictureComparison`] for every picture. The recorded draws go through the very walks that make recordings.

mod compare;
mod format;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use vibes_data::CameraPose;

pub use compare::{PictureComparison, TraceComparison};

use crate::error::{Error, Result};
use vibes_env::distractors::Difficulty;
use vibes_env::distractors::camera::{CameraReset, CameraStep};

/// What a trace file's `format` says.
pub const FORMAT: &str = "vibes-distractor-trace/1";

/// An episode under the suite's distractors.
#[derive(Clone, Debug)]
pub struct DistractorTrace {
    /// Where it was read from.
    pub path: PathBuf,
    /// As in "walker-walk".
    pub task: String,
    /// How far the distractors go.
    pub difficulty: Difficulty,
    /// Whether they change during the episode.
    pub dynamic: bool,
    /// Opacity of the ground.
    pub ground_alpha: f32,
    /// Name of the video shown.
    pub video: String,
    /// Its number of frames.
    pub frame_count: usize,
    /// Names of the materials.
    pub materials: Vec<String>,
    /// Model overrides by object name, to be applied to the task's model.
    pub model_overrides: serde_json::Value,
    /// The box of the camera's walk: r, h, v, roll.
    pub camera_bounds: [(f64, f64); 4],
    /// A quarter of the start radius.
    pub velocity_scaling: f64,
    /// The camera's draws at the reset.
    pub camera_reset: CameraReset,
    /// The colours' draws at the reset, `[materials, 3]`.
    pub color_reset: Vec<f64>,
    /// One for every control step; the first is the reset.
    pub steps: Vec<TraceStep>,
}

/// One control step.
#[derive(Clone, Debug)]
pub struct TraceStep {
    /// Positions.
    pub qpos: Vec<f64>,
    /// The camera's draws.
    pub camera_draws: CameraStep,
    /// The colours' draws, `[materials, 3]`; empty at the reset.
    pub color_draws: Vec<f64>,
    /// What the suite's camera became.
    pub camera: TracedCamera,
    /// The suite's material colours, `[materials, 3]`.
    pub rgb: Vec<f64>,
    /// The frame shown, and whether the video runs forwards.
    pub background: (usize, bool),
    /// Pictures by size: file names beside the trace.
    pub pictures: BTreeMap<usize, String>,
}

/// The suite's camera at one step.
#[derive(Clone, Copy, Debug)]
pub struct TracedCamera {
    /// Spherical coordinates and roll.
    pub pose: CameraPose,
    /// Metres and radians of roll per step.
    pub velocity: ([f64; 3], f64),
    /// Position in the world.
    pub position: [f64; 3],
    /// Rotation matrix by rows.
    pub orientation: [f64; 9],
}

impl DistractorTrace {
    /// Reads a trace.
    ///
    /// # Errors
    /// When the file cannot be read or is not such a trace.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read the trace", path))?;
        format::parse(&text)
            .map_err(|fact| Error::malformed(path, fact, format!("a trace is JSON of the format {FORMAT}")))
            .map(|trace| Self { path: path.to_owned(), ..trace })
    }

    /// The file of a picture.
    pub fn picture_path(&self, name: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new(".")).join(name)
    }
}
