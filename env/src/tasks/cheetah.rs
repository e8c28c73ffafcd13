//! `cheetah-run`: run forwards; the reward grows with speed up to 10 m/s (`dm_control/suite/cheetah.py`).

use rand::{Rng, RngCore};
use vibes_data::{ObservationPart, Quantity};

use super::{Actuation, Loaded, PlannerSettings, Registered, Sigmoid, Task, Tolerance, observed, part};
use crate::Result;
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, suite_xml};

const NAME: &str = "cheetah-run";
/// One physics step of 10 ms is a control step.
const PHYSICS_STEPS: usize = 1;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 4;
/// Physics steps without control in which a random pose falls to the ground before the episode.
const STABILIZING_STEPS: usize = 200;

const FAST: Tolerance = Tolerance::at_least(10.0).margin(10.0).falling(Sigmoid::Linear, 0.0);

const PLANNER: PlannerSettings = PlannerSettings { horizon: 15, samples: 40, ..PlannerSettings::DEFAULT };
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
    let physics = Physics::from_xml(NAME, suite_xml("cheetah.xml")?)?;
    let task = Cheetah { torso_velocity: physics.sensor("torso_subtreelinvel")? };
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
struct Cheetah {
    torso_velocity: usize,
}

impl Task for Cheetah {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        vec![part("position", physics.qpos().len() - 1), part("velocity", physics.qvel().len())]
    }

    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed([
            "torso height",
            "torso angle",
            "back thigh angle",
            "back shin angle",
            "back foot angle",
            "front thigh angle",
            "front shin angle",
            "front foot angle",
            "forward velocity",
            "vertical velocity",
            "torso angular velocity",
            "back thigh angular velocity",
            "back shin angular velocity",
            "back foot angular velocity",
            "front thigh angular velocity",
            "front shin angular velocity",
            "front foot angular velocity",
        ])
    }

    /// Limited joints anywhere within their limits, then 2 s of falling to the ground; the velocities that are left then stay.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        for joint in 0..physics.model().jnt_limited().len() {
            if physics.model().jnt_limited()[joint] {
                let [low, high] = physics.model().jnt_range()[joint];
                // Every joint of this model has one position, so joints and positions share their indices.
                physics.qpos_mut()[joint] = rng.random_range(low..=high);
            }
        }
        let no_control = vec![0.0; physics.control().len()];
        physics.step(&no_control, STABILIZING_STEPS);
        physics.set_time(0.0);
        Ok(ModelOverrides::default())
    }

    /// Every position but the horizontal one, so that the observation does not depend on the place, and the velocities.
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend_from_slice(&physics.qpos()[1..]);
        observation.extend_from_slice(physics.qvel());
    }

    fn reward(&self, physics: &Physics) -> f64 {
        FAST.value(physics.data().sensordata()[self.torso_velocity])
    }
}
