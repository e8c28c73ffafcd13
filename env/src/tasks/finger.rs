//! `finger-spin`: keep a free body spinning by flicking it; reward 1 while it turns fast enough (`dm_control/suite/finger.py`).

use rand::RngCore;
use vibes_data::{ObservationPart, Quantity};

use super::random_joints::randomize_joints;
use super::{Actuation, Loaded, PlannerSettings, Registered, Task, observed, part};
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, suite_xml};
use crate::{Error, Result};

const NAME: &str = "finger-spin";
/// Physics steps of 10 ms in a control step of 20 ms.
const PHYSICS_STEPS: usize = 2;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 2;
/// The hinge turns backwards at least this fast, in rad/s.
const SPIN_VELOCITY: f64 = 15.0;
/// Draws for a free start before giving up, as in `dm_control`.
const ATTEMPTS: usize = 1000;

/// A body is spun by short hard flicks: plans that are rough and end soon.
const PLANNER: PlannerSettings =
    PlannerSettings { horizon: 6, knots: 6, samples: 400, kept: 4, fresh: 0.5, widest: 4.0 };

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
    let physics = Physics::from_xml(NAME, suite_xml("finger.xml")?)?;
    let task = Finger {
        angles: [physics.sensor("proximal")?, physics.sensor("distal")?],
        velocities: [
            physics.sensor("proximal_velocity")?,
            physics.sensor("distal_velocity")?,
            physics.sensor("hinge_velocity")?,
        ],
        tip: physics.sensor("tip")?,
        spinner: physics.sensor("spinner")?,
        touch: [physics.sensor("touchtop")?, physics.sensor("touchbottom")?],
        constants: constants(&physics)?,
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

/// The marks of the other finger tasks are invisible, and the hinge turns freely.
fn constants(physics: &Physics) -> Result<ModelOverrides> {
    let mut constants = ModelOverrides::default();
    for mark in ["target", "tip"] {
        let [red, green, blue, _] = physics.model().site_rgba()[physics.site(mark)?].map(f64::from);
        constants.set("site_rgba", mark, &[red, green, blue, 0.0]);
    }
    constants.set("dof_damping", "hinge", &[0.03]);
    Ok(constants)
}

/// Where the readings are in the sensor data.
#[derive(Debug)]
struct Finger {
    angles: [usize; 2],
    velocities: [usize; 3],
    tip: usize,
    spinner: usize,
    touch: [usize; 2],
    constants: ModelOverrides,
}

impl Task for Finger {
    fn observation(&self, _: &Physics) -> Vec<ObservationPart> {
        vec![part("position", 4), part("velocity", 3), part("touch", 2)]
    }

    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed([
            "upper finger joint's angle",
            "lower finger joint's angle",
            "spinner tip from the hinge, horizontal",
            "spinner tip from the hinge, vertical",
            "upper finger joint's angular velocity",
            "lower finger joint's angular velocity",
            "spinner's angular velocity",
            "touch at the fingertip's top, log force",
            "touch at the fingertip's bottom, log force",
        ])
    }

    fn constants(&self) -> ModelOverrides {
        self.constants.clone()
    }

    /// Any angles without a collision.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        for _ in 0..ATTEMPTS {
            randomize_joints(physics, rng);
            physics.forward_without_actuation();
            if physics.contacts() == 0 {
                return Ok(ModelOverrides::default());
            }
        }
        Err(Error::NoFreeStart { task: NAME.to_owned(), attempts: ATTEMPTS })
    }

    /// Finger angles and the place of the spinner's tip relative to its hinge, the velocities, and the logarithm of the touch forces plus one.
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        let sensors = physics.data().sensordata();
        observation.extend(self.angles.map(|place| sensors[place]));
        observation.extend([0, 2].map(|axis| sensors[self.tip + axis] - sensors[self.spinner + axis]));
        observation.extend(self.velocities.map(|place| sensors[place]));
        observation.extend(self.touch.map(|place| sensors[place].ln_1p()));
    }

    fn reward(&self, physics: &Physics) -> f64 {
        let hinge_velocity = physics.data().sensordata()[self.velocities[2]];
        f64::from(u8::from(hinge_velocity <= -SPIN_VELOCITY))
    }
}
