//! What every episode of a recording shares: the task, the sizes of its columns, and the clock.

use serde::{Deserialize, Serialize};

use crate::Quantity;

/// The shape of a recording's episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// The task's name, as in `reacher-easy`.
    pub task: String,
    /// The bounds of the action.
    pub action: ActionSpec,
    /// The parts of the vector observation, in `dm_control`'s order.
    pub observation: Vec<ObservationPart>,
    /// Number of generalised positions.
    pub qpos: usize,
    /// Number of generalised velocities.
    pub qvel: usize,
    /// The picture's size; none for a recording without pictures.
    pub pixels: Option<ImageSize>,
    /// The names of the recoloured materials.
    pub materials: Vec<String>,
    /// Seconds a control step takes.
    pub control_timestep: f64,
    /// Control steps per agent step; a row of a recording is an agent step.
    pub action_repeat: u32,
    /// What the task's numbers are called, and numbers that follow from them; none where nobody said.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub quantities: Vec<Quantity>,
}

/// The task's own action bounds, one number per dimension.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionSpec {
    /// Lower bounds `[action]`.
    pub min: Vec<f64>,
    /// Upper bounds `[action]`.
    pub max: Vec<f64>,
}

/// One named part of the vector observation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObservationPart {
    /// The name in `dm_control`, as in `position`.
    pub name: String,
    /// How many numbers it has.
    pub len: usize,
}

/// The size of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageSize {
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
}

impl ImageSize {
    /// Bytes of one RGB picture.
    pub fn bytes(self) -> usize {
        self.height as usize * self.width as usize * 3
    }
}

/// Control steps an action may be held at most: the programs take no more, and a larger number in a file is a damaged or hostile one.
pub const MOST_ACTION_REPEAT: u32 = 1000;

/// Episodes that a recording may have at most: their files are numbered with six digits, from 0.
pub const MOST_EPISODES: u32 = 999_999;

/// Agent steps that an episode may have at most.
pub const MOST_STEPS: u32 = 1_000_000;

/// No size in a spec may pass this; a larger one is a damaged or hostile manifest.
const LARGEST: usize = 1 << 20;

impl Spec {
    /// Dimensions of an action.
    pub fn action_len(&self) -> usize {
        self.action.min.len()
    }

    /// Numbers in the vector observation.
    pub fn observation_len(&self) -> usize {
        self.observation.iter().map(|part| part.len).sum()
    }

    /// Bytes of one picture, 0 without pictures.
    pub fn pixels_len(&self) -> usize {
        self.pixels.map_or(0, ImageSize::bytes)
    }

    /// Seconds between two rows.
    pub fn agent_timestep(&self) -> f64 {
        self.control_timestep * f64::from(self.action_repeat)
    }

    /// The names of the observation's numbers: `position[0]`, or `height` for a part of one number.
    pub fn observation_names(&self) -> Vec<String> {
        let names = |part: &ObservationPart| -> Vec<String> {
            match part.len {
                1 => vec![part.name.clone()],
                n => (0..n).map(|i| format!("{}[{i}]", part.name)).collect(),
            }
        };
        self.observation.iter().flat_map(names).collect()
    }

    /// Says what is wrong with the sizes, if anything: no size of a real recording is as large as a damaged or hostile one may say.
    pub fn fault(&self) -> Option<String> {
        let side = self.pixels.map_or(0, |size| size.height.max(size.width)) as usize;
        let parts = self.observation.iter().map(|part| part.len);
        // Summed without overflow: parts that are small enough one by one may not be together.
        let whole = parts.clone().fold(0, usize::saturating_add);
        let largest = parts.chain([whole, self.qpos, self.qvel, self.materials.len()]).max().unwrap_or(0);
        if self.action.min.len() != self.action.max.len() {
            return Some("the action has bounds of different lengths".into());
        }
        if self.action.min.is_empty() {
            return Some("an action of no numbers".into());
        }
        let rises = |(low, high): (&f64, &f64)| low.is_finite() && high.is_finite() && low <= high;
        if let Some(at) = self.action.min.iter().zip(&self.action.max).position(|bounds| !rises(bounds)) {
            return Some(format!("bounds of action[{at}] from {} to {}", self.action.min[at], self.action.max[at]));
        }
        if self.pixels.is_some_and(|size| size.height == 0 || size.width == 0) || side > 8192 {
            return Some(format!("a picture side of {side} pixels"));
        }
        if largest.max(self.action_len()).max(self.observation.len()) > LARGEST {
            return Some(format!("a column of {largest} numbers a row"));
        }
        // Whoever simulates an episode again would be at it for as many control steps.
        if self.action_repeat > MOST_ACTION_REPEAT {
            return Some(format!("an action that is held for {} control steps", self.action_repeat));
        }
        let sizes = (whole, self.qpos, self.qvel);
        if let Some(quantity) = self.quantities.iter().find(|q| !q.formula.fits(sizes.0, sizes.1, sizes.2)) {
            return Some(format!("the quantity {:?} of a number that no column has", quantity.name));
        }
        let clock = self.agent_timestep();
        (!clock.is_finite() || clock <= 0.0).then(|| format!("a timestep of {clock} s"))
    }
}
