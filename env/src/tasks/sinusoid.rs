//! The swimmer's action: four parameters of a travelling wave of torques instead of one torque per joint (VIBES paper, section 4.2):
//!
//! `τ_i(t) = A sin(c₁ i + c₂ t) + c₃` for joint i, with t in control steps since the episode began.
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

    /// The torques of the action `[A, c₁, c₂, c₃]`, each in `[−1, 1]`, at a control step of the episode.
    pub fn torques(&self, action: &[f64], control_step: f64, torques: &mut [f64]) {
        let [amplitude, per_joint, per_step, bias] = std::array::from_fn(|i| action[i] * self.scales[i]);
        for (joint, torque) in torques.iter_mut().enumerate() {
            let wave = amplitude * (per_joint * joint as f64 + per_step * control_step).sin();
            *torque = (wave + bias).clamp(-1.0, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_travels_along_the_joints() {
        let sinusoid = Sinusoid { scales: [1.0, 0.5, 0.25, 0.1] };
        let mut now = [0.0; 6];
        let mut later = [0.0; 6];
        sinusoid.torques(&[0.8, 1.0, 1.0, 0.5], 3.0, &mut now);
        sinusoid.torques(&[0.8, 1.0, 1.0, 0.5], 5.0, &mut later);
        // Two steps of 0.25 rad bring what was at joint i + 1 to joint i.
        for joint in 0..5 {
            assert!((later[joint] - now[joint + 1]).abs() < 1e-12);
        }
        assert!((now[0] - (0.8 * 0.75_f64.sin() + 0.05)).abs() < 1e-12);
    }

    #[test]
    fn torques_stay_within_the_motors_range() {
        let mut torques = [0.0; 99];
        Sinusoid::of_swimmers().torques(&[1.0, 1.0, -1.0, 1.0], 17.0, &mut torques);
        assert!(torques.iter().all(|torque| torque.abs() <= 1.0));
        assert!(torques.contains(&1.0), "the bias pushes some past the end");
    }
}
