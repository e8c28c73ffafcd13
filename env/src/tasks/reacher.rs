//! `reacher-easy`: bring the tip of a two-link arm to a target. Reward 1 while they touch (`dm_control/suite/reacher.py`).

use std::f64::consts::TAU;

use rand::{Rng, RngCore};
use vibes_data::{About, Formula, ObservationPart, Quantity};

use super::random_joints::randomize_joints;
use super::{Actuation, Loaded, PlannerSettings, Registered, Task, Tolerance, part, quantity};
use crate::Result;
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, Start, suite_xml};

const NAME: &str = "reacher-easy";
/// One physics step of 20 ms is a control step.
const PHYSICS_STEPS: usize = 1;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 4;
/// The target's radius in metres.
const TARGET_RADIUS: f64 = 0.05;

const PLANNER: PlannerSettings = PlannerSettings { horizon: 15, samples: 32, fresh: 0.25, ..PlannerSettings::DEFAULT };
/// Seen from above, so that the camera may go all around, and without a floor.
const SCENERY: Scenery = Scenery { upper_quadrant: false, ground_alpha: 0.0 };

/// The registry's entry.
pub(super) const TASK: Registered = Registered {
    name: NAME,
    note: "",
    examples: &[NAME],
    action_repeat: ACTION_REPEAT,
    is_of_the_suite: true,
    is_symmetric: true,
    load: |name| (name == NAME).then(load),
};

/// Loads the model and the task.
fn load() -> Result<Loaded> {
    let physics = Physics::from_xml(NAME, suite_xml("reacher.xml")?)?;
    let task = Reacher {
        finger: physics.geom("finger")?,
        target: physics.geom("target")?,
        shoulder: physics.joint_qpos("shoulder")?,
    };
    Ok(Loaded {
        name: NAME.to_owned(),
        physics,
        task: Box::new(task),
        actuation: Actuation::Direct,
        physics_steps: PHYSICS_STEPS,
        planner: PLANNER,
        scenery: SCENERY,
    })
}

#[derive(Debug)]
struct Reacher {
    finger: usize,
    target: usize,
    shoulder: usize,
}

impl Reacher {
    /// The vector from the finger to the target in the plane.
    fn to_target(&self, physics: &Physics) -> [f64; 2] {
        let places = physics.data().geom_xpos();
        [0, 1].map(|axis| places[self.target][axis] - places[self.finger][axis])
    }
}

impl Task for Reacher {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        let velocity = part("velocity", physics.qvel().len());
        vec![part("position", physics.qpos().len()), part("to_target", 2), velocity]
    }

    /// Arm and target turned together about the shoulder are the same to physics and reward, so that the target is seen from the arm: from the fingertip,
    /// with the upper arm pointing ahead. Where the arm itself points is superfluous.
    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        let (shoulder, wrist, to_target) = (0, 1, [2, 3]);
        let seen = |axis| Formula::Turned { vector: to_target, by: shoulder, axis };
        let superfluous = |name: &str, formula| Quantity { about: About::Symmetry, ..quantity(name, formula) };
        vec![
            quantity("wrist cosine", Formula::Cosine(wrist)),
            quantity("wrist sine", Formula::Sine(wrist)),
            quantity("target in arm's frame, ahead", seen(0)),
            quantity("target in arm's frame, left", seen(1)),
            quantity("distance to the target", Formula::Length(to_target.to_vec())),
            quantity("shoulder velocity", Formula::Qvel(shoulder)),
            quantity("wrist velocity", Formula::Qvel(wrist)),
            superfluous("shoulder cosine", Formula::Cosine(shoulder)),
            superfluous("shoulder sine", Formula::Sine(shoulder)),
        ]
    }

    fn constants(&self) -> ModelOverrides {
        let mut constants = ModelOverrides::default();
        constants.set("geom_size", "target", &[TARGET_RADIUS, 0.0, 0.0]);
        constants
    }

    /// Any pose, and a target in the ring from 5 to 20 cm around the shoulder, uniform in radius and angle.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        randomize_joints(physics, rng);
        let angle = rng.random_range(0.0..TAU);
        let radius = rng.random_range(0.05..0.20);
        let height = physics.model().geom_pos()[self.target][2];
        let mut changed = ModelOverrides::default();
        changed.set("geom_pos", "target", &[radius * angle.sin(), radius * angle.cos(), height]);
        Ok(changed)
    }

    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend_from_slice(physics.qpos());
        observation.extend(self.to_target(physics));
        observation.extend_from_slice(physics.qvel());
    }

    fn reward(&self, physics: &Physics) -> f64 {
        let [x, y] = self.to_target(physics);
        let sizes = physics.model().geom_size();
        Tolerance::within(0.0, sizes[self.target][0] + sizes[self.finger][0]).value((x * x + y * y).sqrt())
    }

    /// The arena is level and the arm's first joint stands in its middle: arm and target turn together.
    fn rotate(&self, state: &mut Start, angle: f64) -> bool {
        let Some(&[x, y, height]) = state.model_overrides.get("geom_pos", "target") else { return false };
        let (sin, cos) = angle.sin_cos();
        state.model_overrides.set("geom_pos", "target", &[cos * x - sin * y, sin * x + cos * y, height]);
        state.qpos[self.shoulder] += angle;
        true
    }
}
