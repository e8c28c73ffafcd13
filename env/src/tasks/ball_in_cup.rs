//! `ball_in_cup-catch`: swing a ball on a string into the cup. Reward 1 while the ball is inside (`dm_control/suite/ball_in_cup.py`).

use rand::{Rng, RngCore};
use vibes_data::{ObservationPart, Quantity};

use super::{Actuation, Loaded, PlannerSettings, Registered, Task, observed, part};
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, suite_xml};
use crate::{Error, Result};

const NAME: &str = "ball_in_cup-catch";
/// Physics steps of 2 ms in a control step of 20 ms.
const PHYSICS_STEPS: usize = 10;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 4;
/// Draws for a free start before giving up; about one in seven touches the cup.
const ATTEMPTS: usize = 1000;

const PLANNER: PlannerSettings = PlannerSettings { horizon: 12, samples: 64, fresh: 0.25, ..PlannerSettings::DEFAULT };

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
    let physics = Physics::from_xml(NAME, suite_xml("ball_in_cup.xml")?)?;
    let task = BallInCup {
        ball: physics.body("ball")?,
        ball_geom: physics.geom("ball")?,
        target: physics.site("target")?,
        ball_x: physics.joint_qpos("ball_x")?,
        ball_z: physics.joint_qpos("ball_z")?,
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
struct BallInCup {
    ball: usize,
    ball_geom: usize,
    target: usize,
    ball_x: usize,
    ball_z: usize,
}

impl Task for BallInCup {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        vec![part("position", physics.qpos().len()), part("velocity", physics.qvel().len())]
    }

    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed([
            "cup position, horizontal",
            "cup position, vertical",
            "ball position, horizontal",
            "ball position, vertical",
            "cup velocity, horizontal",
            "cup velocity, vertical",
            "ball velocity, horizontal",
            "ball velocity, vertical",
        ])
    }

    /// The ball anywhere in a box above the ground where it touches nothing.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        for _ in 0..ATTEMPTS {
            physics.qpos_mut()[self.ball_x] = rng.random_range(-0.2..0.2);
            physics.qpos_mut()[self.ball_z] = rng.random_range(0.2..0.5);
            physics.forward_without_actuation();
            if physics.contacts() == 0 {
                return Ok(ModelOverrides::default());
            }
        }
        Err(Error::NoFreeStart { task: NAME.to_owned(), attempts: ATTEMPTS })
    }

    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend_from_slice(physics.qpos());
        observation.extend_from_slice(physics.qvel());
    }

    /// 1 when the ball is wholly within the target box in x and z.
    fn reward(&self, physics: &Physics) -> f64 {
        let target = physics.data().site_xpos()[self.target];
        let ball = physics.data().xpos()[self.ball];
        let half = physics.model().site_size()[self.target];
        let radius = physics.model().geom_size()[self.ball_geom][0];
        let is_inside = [0, 2].iter().all(|&axis| (target[axis] - ball[axis]).abs() < half[axis] - radius);
        f64::from(u8::from(is_inside))
    }
}
