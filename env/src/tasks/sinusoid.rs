//! The swimmer's action: four parameters of a travelling wave of torques instead of one torque per joint (VIBES paper, section 4.2):
//!
//! `τ_i(t) = A sin(c₁ i + c₂ t) + c₃` for joint i, with t in control steps since the episode began.
//!
//! An agent changes c₂ within an episode, and c₂ t taken at its word would let the wave jump to where it would be, had c₂ always been so: by 2.4 radians when c₂
//! changes by a twentieth of its range after 500 control steps. So the wave goes on from where it stands: its phase is the sum of the c₂ of all control steps so far, which is c₂ t where c₂ is
//! held. With normal noise of 0.1 on each of the four numbers, drawn anew for every agent step, a wave of eight links at 0.2 Hz moves the nose of 100 links by 0.9 to 1.1 m in 30 s so,
//! and by 0.4 to 0.6 m with the jumps (three starts each; 1.2 m without noise).
//!
//! The paper scales the agent's four outputs "to a reasonable range" without saying which. Here each is in `[−1, 1]` and is multiplied by
//! [`Sinusoid::scales`]; a torque is a share of the motor's range and is cut to `[−1, 1]`.

use std::f64::consts::TAU;

/// Full amplitude: the motors' whole range.
const AMPLITUDE: f64 = 1.0;
/// At most this much of a wave between one joint and the next, in radians: a wave of eight links, however long the body is. Of constant waves that were drawn at
/// random, one of 8.7 links at 0.2 Hz moved the nose of 100 links by 1.4 m in 30 s, and none of 30 links or more by over 0.7 m.
const PER_JOINT: f64 = 0.8;
/// At most this many waves a second. A motor is weak against the water: faster waves hardly bend the body.
const WAVES_PER_SECOND: f64 = 0.25;
/// The bias bends the body one way, so a little steers: this share of the motors' range at most.
const BIAS: f64 = 0.25;
/// Seconds of the swimmer's control step.
const CONTROL_TIMESTEP: f64 = 0.03;

/// What one unit of each of the four action numbers stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Sinusoid {
    /// The largest `A`, `c₁` (radians a joint), `c₂` (radians a control step) and `c₃`.
    pub scales: [f64; 4],
}

impl Sinusoid {
    /// The scales of every swimmer: what moves a body is how it bends from link to link, which does not depend on how long it is.
    pub fn of_swimmers() -> Self {
        Self { scales: [AMPLITUDE, PER_JOINT, TAU * WAVES_PER_SECOND * CONTROL_TIMESTEP, BIAS] }
    }

    /// The torques of the action `[A, c₁, c₂, c₃]`, each in `[−1, 1]`, for a control step that the wave enters at a phase in radians, 0 at an episode's beginning. Returns
    /// the phase of the next control step.
    pub fn torques(&self, action: &[f64], phase: f64, torques: &mut [f64]) -> f64 {
        let [amplitude, per_joint, per_step, bias] = std::array::from_fn(|i| action[i] * self.scales[i]);
        for (joint, torque) in torques.iter_mut().enumerate() {
            let wave = amplitude * (per_joint * joint as f64 + phase).sin();
            *torque = (wave + bias).clamp(-1.0, 1.0);
        }
        phase + per_step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The torques of six joints at every control step of these actions.
    fn waves(actions: &[[f64; 4]]) -> Vec<[f64; 6]> {
        let sinusoid = Sinusoid { scales: [1.0, 0.5, 0.25, 0.1] };
        let mut phase = 0.0;
        let mut torques = [0.0; 6];
        actions
            .iter()
            .map(|action| {
                phase = sinusoid.torques(action, phase, &mut torques);
                torques
            })
            .collect()
    }

    #[test]
    fn a_held_action_is_the_papers_formula() {
        for (step, torques) in waves(&[[0.8, 1.0, 1.0, 0.5]; 40]).iter().enumerate() {
            for (joint, torque) in torques.iter().enumerate() {
                let formula = 0.8 * (0.5 * joint as f64 + 0.25 * step as f64).sin() + 0.05;
                assert!((torque - formula).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_wave_that_becomes_slower_goes_on_from_where_it_stands() {
        let mut actions = vec![[1.0, 1.0, 1.0, 0.0]; 500];
        actions.push([1.0, 1.0, 0.9, 0.0]);
        let held = waves(&[[1.0, 1.0, 1.0, 0.0]; 501]);
        assert_eq!(waves(&actions)[500], held[500], "the phase is that of the control steps before");
    }

    #[test]
    fn torques_stay_within_the_motors_range() {
        let mut torques = [0.0; 99];
        Sinusoid::of_swimmers().torques(&[1.0, 1.0, -1.0, 1.0], 17.0, &mut torques);
        assert!(torques.iter().all(|torque| torque.abs() <= 1.0));
        assert!(torques.contains(&1.0), "the bias pushes some past the end");
    }
}
