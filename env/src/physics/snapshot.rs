//! Saving and restoring a simulation in the middle of an episode, for planners that try things out: a restored simulation goes on bit for bit
//! as the saved one did.

use mujoco_rs::mujoco_c::mjtState;

use super::Physics;

/// Everything the next steps depend on (time, positions, velocities, activations, controls, the solver's warm start), and the sensor readings,
/// of which those of forces belong to the step before and could not be computed again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhysicsSnapshot {
    state: Vec<f64>,
    sensors: Vec<f64>,
}

impl Physics {
    /// Saves the state into `snapshot`, reusing its memory.
    pub fn save(&self, snapshot: &mut PhysicsSnapshot) {
        let integration = mjtState::mjSTATE_INTEGRATION as u32;
        snapshot.state.resize(self.model().state_size(integration), 0.0);
        self.data.read_state_into(integration, &mut snapshot.state);
        snapshot.sensors.clear();
        snapshot.sensors.extend_from_slice(self.data.sensordata());
    }

    /// Goes back to a state that [`Self::save`] of a simulation of the same model saved.
    ///
    /// `mj_step1` computes what a step begins with from the state, as it was when the snapshot was taken after [`Physics::step`].
    pub fn restore(&mut self, snapshot: &PhysicsSnapshot) {
        let integration = mjtState::mjSTATE_INTEGRATION as u32;
        let restored = self.data.set_state(&snapshot.state, integration);
        debug_assert!(restored.is_ok(), "a snapshot of another model");
        self.data.step1();
        let sensors = snapshot.sensors.len().min(self.data.sensordata().len());
        self.data.sensordata_mut()[..sensors].copy_from_slice(&snapshot.sensors[..sensors]);
    }
}
