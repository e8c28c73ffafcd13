//! The Control Suite's random start: limited joints anywhere within their limits, free hinges at any angle, free slides where they are
//! (`dm_control/suite/utils/randomizers.py`; no task here has ball or free joints).

use std::f64::consts::PI;

use mujoco_rs::prelude::MjtJoint;
use rand::{Rng, RngCore};

use crate::physics::Physics;

/// Draws every joint's position, in the model's order.
pub(super) fn randomize_joints(physics: &mut Physics, rng: &mut dyn RngCore) {
    for joint in 0..physics.model().jnt_type().len() {
        let model = physics.model();
        let is_hinge = model.jnt_type()[joint] == MjtJoint::mjJNT_HINGE;
        let is_limited = model.jnt_limited()[joint];
        let [low, high] = model.jnt_range()[joint];
        let Ok(place) = usize::try_from(model.jnt_qposadr()[joint]) else { continue };
        if is_limited {
            physics.qpos_mut()[place] = rng.random_range(low..=high);
        } else if is_hinge {
            physics.qpos_mut()[place] = rng.random_range(-PI..PI);
        }
    }
}
