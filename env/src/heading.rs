//! What a recording says of the world it was made in: the shape of its episodes, and the versions of what simulated them. One definition for everyone who records.
//!
//! In: an environment, or the shape of somebody else's episodes. Out: a [`Spec`], and a [`Manifest`] that lists no episode yet.

use serde_json::Value;
use vibes_data::{FORMAT, Grid, ImageSize, Manifest, Spec, Video};

use crate::Environment;
use crate::render::material_names;

/// The versions of the simulator and of the models in this build: the first is the library's own answer, the second that of the wheel that set-up fetched.
fn versions() -> [(&'static str, &'static str); 2] {
    [("mujoco", mujoco_rs::mujoco_version()), ("dm_control models", env!("VIBES_SUITE_VERSION"))]
}

impl Environment {
    /// The shape of a recording's episodes, with pictures of `side` pixels a side if there is one.
    pub fn spec(&self, side: Option<u32>) -> Spec {
        let physics = self.physics();
        Spec {
            task: self.name().to_owned(),
            action: self.action_spec(),
            observation: self.observation_spec(),
            qpos: physics.qpos().len(),
            qvel: physics.qvel().len(),
            pixels: side.map(|side| ImageSize { height: side, width: side }),
            materials: material_names(physics.model()),
            control_timestep: self.control_timestep(),
            action_repeat: self.action_repeat(),
            quantities: self.quantities(),
        }
    }
}

/// What a recording is made from.
#[derive(Clone, Debug)]
pub struct Heading {
    /// The shape of its episodes.
    pub spec: Spec,
    /// The options of the program that records, by which another knows what was asked for.
    pub options: Value,
    /// The seed from which every other one is derived.
    pub seed: u64,
    /// The grid's size, where the recording is one.
    pub grid: Option<Grid>,
    /// Its background videos.
    pub videos: Vec<Video>,
}

impl Heading {
    /// The manifest, without episodes.
    pub fn manifest(self) -> Manifest {
        let Self { spec, options, seed, grid, videos } = self;
        let versions = [("vibes", env!("CARGO_PKG_VERSION"))].into_iter().chain(versions());
        Manifest {
            format: FORMAT.into(),
            spec,
            options,
            seed,
            versions: versions.map(|(name, version)| (name.to_owned(), version.to_owned())).collect(),
            grid,
            videos,
            episodes: Vec::new(),
        }
    }
}
