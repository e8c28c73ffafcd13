//! `walker-walk`: stand up and walk forwards at 1 m/s (`dm_control/suite/walker.py`).

use rand::RngCore;
use vibes_data::{ObservationPart, Quantity};

use super::random_joints::randomize_joints;
use super::{Actuation, Loaded, PlannerSettings, Registered, Sigmoid, Task, Tolerance, observed, part};
use crate::Result;
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, suite_xml};

const NAME: &str = "walker-walk";
/// Physics steps of 2.5 ms in a control step of 25 ms.
const PHYSICS_STEPS: usize = 10;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 2;

/// The torso at least 1.2 m above the ground.
const STANDING: Tolerance = Tolerance::at_least(1.2).margin(0.6);
/// Forwards at least at 1 m/s.
const WALKING: Tolerance = Tolerance::at_least(1.0).margin(0.5).falling(Sigmoid::Linear, 0.5);

const SCENERY: Scenery = Scenery { ground_alpha: 1.0, ..Scenery::DEFAULT };

/// The registry's entry.
pub(super) const TASK: Registered = Registered {
    name: NAME,
    note: "",
    examples: &[NAME],
    action_repeat: ACTION_REPEAT,
    is_of_the_suite: true,
    is_symmetric: false,
    load: |name| (name == NAME).then(load),
};

/// Loads the model and the task.
fn load() -> Result<Loaded> {
    let physics = Physics::from_xml(NAME, suite_xml("walker.xml")?)?;
    let task = Walker { torso: physics.body("torso")?, torso_velocity: physics.sensor("torso_subtreelinvel")? };
    Ok(Loaded {
        name: NAME.to_owned(),
        physics,
        task: Box::new(task),
        actuation: Actuation::Direct,
        physics_steps: PHYSICS_STEPS,
        planner: PlannerSettings::DEFAULT,
        scenery: SCENERY,
    })
}

#[derive(Debug)]
struct Walker {
    torso: usize,
    torso_velocity: usize,
}

impl Task for Walker {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        let bodies = physics.data().xmat().len() - 1;
        let velocity = part("velocity", physics.qvel().len());
        vec![part("orientations", 2 * bodies), part("height", 1), velocity]
    }

    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed([
            "torso angle cosine",
            "torso angle sine",
            "right thigh angle cosine",
            "right thigh angle sine",
            "right leg angle cosine",
            "right leg angle sine",
            "right foot angle cosine",
            "right foot angle sine",
            "left thigh angle cosine",
            "left thigh angle sine",
            "left leg angle cosine",
            "left leg angle sine",
            "left foot angle cosine",
            "left foot angle sine",
            "torso height",
            "vertical velocity",
            "forward velocity",
            "torso angular velocity",
            "right hip angular velocity",
            "right knee angular velocity",
            "right ankle angular velocity",
            "left hip angular velocity",
            "left knee angular velocity",
            "left ankle angular velocity",
        ])
    }

    /// Any angles, a little above the ground, upside down as well.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        randomize_joints(physics, rng);
        Ok(ModelOverrides::default())
    }

    /// Every body's orientation in the plane (`xx` and `xz`, the world excepted), the torso's height, and the velocities.
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend(physics.data().xmat()[1..].iter().flat_map(|xmat| [xmat[0], xmat[2]]));
        observation.push(physics.data().xpos()[self.torso][2]);
        observation.extend_from_slice(physics.qvel());
    }

    fn reward(&self, physics: &Physics) -> f64 {
        let standing = STANDING.value(physics.data().xpos()[self.torso][2]);
        let upright = (1.0 + physics.data().xmat()[self.torso][8]) / 2.0;
        let walking = WALKING.value(physics.data().sensordata()[self.torso_velocity]);
        (3.0 * standing + upright) / 4.0 * (5.0 * walking + 1.0) / 6.0
    }
}
