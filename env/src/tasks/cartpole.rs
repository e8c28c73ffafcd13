//! `cartpole-swingup`: swing a pole up from hanging and balance it in the middle of the rail (`dm_control/suite/cartpole.py`).

use std::f64::consts::PI;

use rand::RngCore;
use vibes_data::{ObservationPart, Quantity};

use super::{Actuation, Loaded, PlannerSettings, Registered, Sigmoid, Task, Tolerance, observed, part};
use crate::Result;
use crate::distractors::Scenery;
use crate::gaussian::standard_normal;
use crate::physics::{ModelOverrides, Physics, suite_xml};

const NAME: &str = "cartpole-swingup";
/// One physics step of 10 ms is a control step.
const PHYSICS_STEPS: usize = 1;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 8;

const CENTERED: Tolerance = Tolerance::within(0.0, 0.0).margin(2.0);
const SMALL_CONTROL: Tolerance = Tolerance::within(0.0, 0.0).margin(1.0).falling(Sigmoid::Quadratic, 0.0);
const SMALL_VELOCITY: Tolerance = Tolerance::within(0.0, 0.0).margin(5.0);

const PLANNER: PlannerSettings = PlannerSettings { samples: 48, fresh: 0.25, ..PlannerSettings::DEFAULT };

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
    let physics = Physics::from_xml(NAME, suite_xml("cartpole.xml")?)?;
    let task = Cartpole {
        slider: physics.joint_qpos("slider")?,
        hinge: physics.joint_qpos("hinge_1")?,
        pole: physics.body("pole_1")?,
    };
    Ok(Loaded {
        name: NAME.to_owned(),
        physics,
        task: Box::new(task),
        actuation: Actuation::Direct,
        physics_steps: PHYSICS_STEPS,
        planner: PLANNER,
        scenery: Scenery::DEFAULT,
    })
}

#[derive(Debug)]
struct Cartpole {
    slider: usize,
    hinge: usize,
    pole: usize,
}

impl Task for Cartpole {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        vec![part("position", 3), part("velocity", physics.qvel().len())]
    }

    /// The pole's angle is 0 upright. Mirrored states need mirrored actions, so that a latent must know the side: no symmetry.
    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed([
            "cart position",
            "cosine of the pole's angle",
            "sine of the pole's angle",
            "cart velocity",
            "pole's angular velocity",
        ])
    }

    /// Almost at rest, the pole hanging: standard deviations of 0.01 in every position and velocity.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        physics.qpos_mut()[self.slider] = 0.01 * standard_normal(rng);
        physics.qpos_mut()[self.hinge] = PI + 0.01 * standard_normal(rng);
        for velocity in physics.qvel_mut() {
            *velocity = 0.01 * standard_normal(rng);
        }
        Ok(ModelOverrides::default())
    }

    /// The cart's position, the pole's angle as cosine and sine (`zz` and `xz` of its orientation), and the velocities.
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        let pole = physics.data().xmat()[self.pole];
        observation.extend([physics.qpos()[self.slider], pole[8], pole[2]]);
        observation.extend_from_slice(physics.qvel());
    }

    fn reward(&self, physics: &Physics) -> f64 {
        let upright = (physics.data().xmat()[self.pole][8] + 1.0) / 2.0;
        let centered = (1.0 + CENTERED.value(physics.qpos()[self.slider])) / 2.0;
        let small_control = (4.0 + SMALL_CONTROL.value(physics.control()[0])) / 5.0;
        let small_velocity = (1.0 + SMALL_VELOCITY.value(physics.qvel()[1])) / 2.0;
        upright * small_control * small_velocity * centered
    }
}
