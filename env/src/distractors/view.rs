//! From a camera pose and a state of the physics to the camera MuJoCo draws with.
//!
//! In: a [`CameraPose`], which belongs to the distractors, and an [`Anchor`], which belongs to the state. Out: a [`CameraFrame`]:
//! position and orientation in the world. Source: `distracting_control/camera.py`.

use vibes_data::CameraPose;

use super::camera::{norm, spherical_to_cartesian};

/// What the state contributes to the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Origin of the spherical coordinates: the world's for a fixed camera, the tracked centre of mass for a tracking one. Metres.
    pub origin: [f64; 3],
    /// The point the camera looks at, metres.
    pub look_at: [f64; 3],
}

/// A camera in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFrame {
    /// Position, metres.
    pub position: [f64; 3],
    /// Orientation, a rotation matrix by rows: its columns point right, up and backwards.
    pub orientation: [f64; 9],
}

impl CameraFrame {
    /// The frame of `pose` around `anchor`. `keep_upright` looks without roll, as everywhere but in reacher.
    pub fn compose(pose: &CameraPose, anchor: &Anchor, keep_upright: bool) -> Self {
        let offset = spherical_to_cartesian([pose.r, pose.h, pose.v]);
        let position = std::array::from_fn(|i| offset[i] + anchor.origin[i]);
        let looking =
            if keep_upright { upright(anchor.look_at, position) } else { shortest_turn(anchor.look_at, position) };
        Self { position, orientation: multiply(&looking, &roll_matrix(pose.roll)) }
    }

    /// The point on the camera's own optical axis as far away as `target`.
    pub fn point_ahead(&self, target: [f64; 3]) -> [f64; 3] {
        let distance = norm(std::array::from_fn(|i| self.position[i] - target[i]));
        std::array::from_fn(|i| self.position[i] - distance * self.orientation[3 * i + 2])
    }
}

fn direction(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let delta = std::array::from_fn(|i| to[i] - from[i]);
    let length = norm(delta);
    delta.map(|x| x / length)
}

/// Looks at `target` without roll. Swings wildly near the poles, which the quadrant keeps away from.
fn upright(target: [f64; 3], position: [f64; 3]) -> [f64; 9] {
    let delta = direction(position, target);
    let yaw = delta[0].atan2(delta[1]);
    let across = (delta[0] * delta[0] + delta[1] * delta[1]).sqrt();
    // The camera starts out looking at -z.
    let pitch = delta[2].atan2(across) + std::f64::consts::FRAC_PI_2;
    euler_matrix(pitch, -yaw)
}

/// Rotation about x by `pitch`, then about z by `turn`.
fn euler_matrix(pitch: f64, turn: f64) -> [f64; 9] {
    let ((sin_x, cos_x), (sin_z, cos_z)) = (pitch.sin_cos(), turn.sin_cos());
    [cos_z, -sin_z * cos_x, sin_x * sin_z, sin_z, cos_x * cos_z, -sin_x * cos_z, 0.0, sin_x, cos_x]
}

/// Looks at `target` by the shortest turn from -z, with whatever roll that brings; steady at the pole.
fn shortest_turn(target: [f64; 3], position: [f64; 3]) -> [f64; 9] {
    let delta = direction(position, target);
    // Cross and dot product of (0, 0, -1) and delta.
    let cross = [delta[1], -delta[0], 0.0];
    let (sin, cos) = (norm(cross), -delta[2]);
    axis_angle_matrix(cos, sin, cross.map(|x| x / (sin + 1e-4)))
}

fn roll_matrix(roll: f64) -> [f64; 9] {
    axis_angle_matrix(roll.cos(), roll.sin(), [0.0, 0.0, 1.0])
}

fn axis_angle_matrix(cos: f64, sin: f64, [x, y, z]: [f64; 3]) -> [f64; 9] {
    let rest = 1.0 - cos;
    [
        cos + x * x * rest,
        x * y * rest - z * sin,
        x * z * rest + y * sin,
        y * x * rest + z * sin,
        cos + y * y * rest,
        y * z * rest - x * sin,
        z * x * rest - y * sin,
        z * y * rest + x * sin,
        cos + z * z * rest,
    ]
}

fn multiply(a: &[f64; 9], b: &[f64; 9]) -> [f64; 9] {
    std::array::from_fn(|i| (0..3).map(|k| a[i / 3 * 3 + k] * b[k * 3 + i % 3]).sum())
}
