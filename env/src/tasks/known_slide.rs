//! `known-slide`: a task for tests of the alignment of `o_t`, `a_t` and `r_t`, whose reward is a formula in the observation and the action of
//! the same row ([`known_reward`]). A weight on a frictionless rail, pushed by a motor; everything MuJoCo does with it fits into two lines.

use rand::{Rng, RngCore};
use vibes_data::{ObservationPart, Quantity};

use super::{Actuation, Loaded, PlannerSettings, Registered, Task, observed, part};
use crate::Result;
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics};

/// A task for tests of the alignment of `o_t`, `a_t`, `r_t`: its reward is a formula in state and action. Not in the listing, since it is not
/// for research.
pub const KNOWN_SLIDE: &str = "known-slide";
/// Seconds of a physics step, which is a control step.
const TIMESTEP: f64 = 0.02;
/// Control steps an action is held.
const ACTION_REPEAT: u32 = 2;
/// Newtons at an action of 1 on the weight of 1 kg.
const FORCE: f64 = 4.0;

const XML: &str = r#"
<mujoco model="known slide">
  <include file="./common/skybox.xml"/>
  <include file="./common/visual.xml"/>
  <include file="./common/materials.xml"/>
  <option timestep="0.02"><flag contact="disable" gravity="disable"/></option>
  <worldbody>
    <light name="light" pos="0 0 3"/>
    <camera name="fixed" pos="0 -4 1" zaxis="0 -1 0"/>
    <geom name="floor" pos="0 0 0" size="4 4 .2" type="plane" material="grid"/>
    <body name="weight" pos="0 0 .5">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom name="weight" type="box" size=".2 .2 .2" mass="1" material="self"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="slide" gear="4" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>"#;

/// The registry's entry.
pub(super) const TASK: Registered = Registered {
    name: KNOWN_SLIDE,
    note: "",
    examples: &[KNOWN_SLIDE],
    action_repeat: ACTION_REPEAT,
    is_of_the_suite: false,
    is_symmetric: false,
    load: |name| (name == KNOWN_SLIDE).then(load),
};

/// Loads the model and the task.
fn load() -> Result<Loaded> {
    Ok(Loaded {
        name: KNOWN_SLIDE.to_owned(),
        physics: Physics::from_xml(KNOWN_SLIDE, XML)?,
        task: Box::new(KnownSlide),
        actuation: Actuation::Direct,
        physics_steps: 1,
        planner: PlannerSettings::DEFAULT,
        scenery: Scenery::DEFAULT,
    })
}

/// The reward of a row of a recording of this task, from the observation `[position, velocity]` and the action of the same row: the reward of
/// every control step, `r = 1 / (2 + 2 x²) + (1 + a) / 4`, summed over the action repeat, where velocity and position follow Euler's method.
pub fn known_reward(observation: [f64; 2], action: f64, action_repeat: u32) -> f64 {
    let [mut position, mut velocity] = observation;
    let mut sum = 0.0;
    for _ in 0..action_repeat {
        velocity += TIMESTEP * FORCE * action;
        position += TIMESTEP * velocity;
        sum += reward(position, action);
    }
    sum
}

fn reward(position: f64, action: f64) -> f64 {
    0.5 / (1.0 + position * position) + 0.25 * (1.0 + action)
}

#[derive(Debug)]
struct KnownSlide;

impl Task for KnownSlide {
    fn observation(&self, _: &Physics) -> Vec<ObservationPart> {
        vec![part("position", 1), part("velocity", 1)]
    }

    fn quantities(&self, _: &Physics) -> Vec<Quantity> {
        observed(["position", "velocity"])
    }

    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        physics.qpos_mut()[0] = rng.random_range(-1.0..1.0);
        physics.qvel_mut()[0] = rng.random_range(-1.0..1.0);
        Ok(ModelOverrides::default())
    }

    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend([physics.qpos()[0], physics.qvel()[0]]);
    }

    fn reward(&self, physics: &Physics) -> f64 {
        reward(physics.qpos()[0], physics.control()[0])
    }
}
