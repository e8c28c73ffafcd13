//! The camera axis: a random walk of the camera's position, in spherical coordinates, and of its roll.
//!
//! In: where the model's own camera stands ([`CameraStart`]), how far it may go ([`CameraRanges`]) and random draws. Out: one
//! [`CameraPose`] per control step. The pose does not depend on the physics; [`view`](crate::distractors::view) puts it together with a state.
//! Source: `distracting_control/camera.py`, step by step, including the round trip through Cartesian coordinates that brings
//! reacher's camera, which starts at the pole, to one side.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::Rng;
use vibes_data::CameraPose;

use super::CameraRanges;
use crate::standard_normal;

/// Where the model's own camera stands, and what the walk must respect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraStart {
    /// The model's own pose; its roll is 0.
    pub pose: CameraPose,
    /// Keep the inclination in `0..=π/2` and the azimuth in `-π..=0`.
    pub upper_quadrant: bool,
}

/// The box in which the walk stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraBounds {
    /// Radius, metres.
    pub r: (f64, f64),
    /// Azimuth, radians.
    pub h: (f64, f64),
    /// Inclination, radians.
    pub v: (f64, f64),
    /// Roll, radians.
    pub roll: (f64, f64),
    /// A quarter of the start radius: speeds are set for a camera at 4 m.
    pub velocity_scaling: f64,
}

impl CameraBounds {
    /// The ranges around the start.
    pub fn new(start: &CameraStart, ranges: &CameraRanges) -> Self {
        let CameraPose { r, h, v, .. } = start.pose;
        let mut h_bounds = (h - ranges.angle, h + ranges.angle);
        let mut v_bounds = (v - ranges.angle, v + ranges.angle);
        if start.upper_quadrant {
            h_bounds = (h_bounds.0.max(-PI), h_bounds.1.min(0.0));
            v_bounds = (v_bounds.0.max(0.0), v_bounds.1.min(FRAC_PI_2));
        }
        Self {
            r: ((r - r * ranges.zoom_in).max(0.0), r + r * ranges.zoom_out),
            h: h_bounds,
            v: v_bounds,
            roll: (-ranges.angle, ranges.angle),
            velocity_scaling: r / 4.0,
        }
    }

    /// The position `[r, h, v]` inside the box that is nearest in each coordinate.
    fn clip(&self, [r, h, v]: [f64; 3]) -> [f64; 3] {
        [clip(r, self.r), clip(h, self.h), clip(v, self.v)]
    }
}

/// The random draws of a reset, in the order in which they are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraReset {
    /// Azimuth, uniform in its bounds.
    pub h: f64,
    /// Inclination, uniform in its bounds.
    pub v: f64,
    /// Radius, uniform in its bounds.
    pub r: f64,
    /// Roll, uniform in its bounds.
    pub roll: f64,
    /// Direction of the velocity: three standard normals, not yet normalised.
    pub direction: [f64; 3],
    /// Speed, uniform in `0..max_velocity` (not scaled by the radius).
    pub speed: f64,
    /// Roll velocity, uniform in `±max_roll_velocity`.
    pub roll_velocity: f64,
}

impl CameraReset {
    /// Draws a reset.
    pub fn draw(bounds: &CameraBounds, ranges: &CameraRanges, rng: &mut impl Rng) -> Self {
        Self {
            h: uniform(bounds.h, rng),
            v: uniform(bounds.v, rng),
            r: uniform(bounds.r, rng),
            roll: uniform(bounds.roll, rng),
            direction: std::array::from_fn(|_| standard_normal(rng)),
            speed: uniform((0.0, ranges.max_velocity), rng),
            roll_velocity: uniform((-ranges.max_roll_velocity, ranges.max_roll_velocity), rng),
        }
    }
}

/// The random draws of one step: standard normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraStep {
    /// For the velocity.
    pub velocity: [f64; 3],
    /// For the roll velocity.
    pub roll: f64,
}

impl CameraStep {
    /// Draws a step.
    pub fn draw(rng: &mut impl Rng) -> Self {
        Self { velocity: std::array::from_fn(|_| standard_normal(rng)), roll: standard_normal(rng) }
    }
}

/// The walk, between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraWalk {
    bounds: CameraBounds,
    ranges: CameraRanges,
    position: [f64; 3],
    roll: f64,
    velocity: [f64; 3],
    roll_velocity: f64,
}

impl CameraWalk {
    /// Starts an episode. The suite moves the camera once inside the reset, so [`advance`](Self::advance) once before the first picture.
    pub fn reset(bounds: CameraBounds, ranges: CameraRanges, draws: &CameraReset) -> Self {
        let length = norm(draws.direction);
        Self {
            bounds,
            ranges,
            position: [draws.r, draws.h, draws.v],
            roll: draws.roll,
            velocity: draws.direction.map(|x| x / length * draws.speed),
            roll_velocity: draws.roll_velocity,
        }
    }

    /// One control step.
    pub fn advance(&mut self, draws: &CameraStep) {
        self.accelerate(draws);
        let before = spherical_to_cartesian(self.position);
        let wanted = cartesian_to_spherical(std::array::from_fn(|i| before[i] + self.velocity[i]));
        self.position = self.bounds.clip(wanted);
        // The velocity becomes the movement that really happened, so it dies at a wall.
        let after = spherical_to_cartesian(self.position);
        self.velocity = std::array::from_fn(|i| after[i] - before[i]);

        let roll = clip(self.roll + self.roll_velocity, self.bounds.roll);
        self.roll_velocity = roll - self.roll;
        self.roll = roll;
    }

    fn accelerate(&mut self, draws: &CameraStep) {
        let scaling = self.bounds.velocity_scaling;
        for (velocity, normal) in self.velocity.iter_mut().zip(draws.velocity) {
            *velocity += normal * self.ranges.velocity_std * scaling;
        }
        self.roll_velocity += draws.roll * self.ranges.roll_std;
        let (speed, limit) = (norm(self.velocity), self.ranges.max_velocity * scaling);
        if speed > limit {
            self.velocity = self.velocity.map(|velocity| velocity * (limit / speed));
        }
        let limit = self.ranges.max_roll_velocity;
        self.roll_velocity = clip(self.roll_velocity, (-limit, limit));
    }

    /// Where the camera is.
    pub fn pose(&self) -> CameraPose {
        let [r, h, v] = self.position;
        CameraPose { r, h, v, roll: self.roll }
    }

    /// Metres per control step, and radians of roll per control step.
    pub fn velocity(&self) -> ([f64; 3], f64) {
        (self.velocity, self.roll_velocity)
    }
}

/// `[r, h, v]` of a point: radius, azimuth, inclination from the vertical.
pub fn cartesian_to_spherical(point: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = point;
    let across = (x * x + y * y).sqrt();
    [norm(point), y.atan2(x), across.atan2(z)]
}

/// The point at `[r, h, v]`.
pub fn spherical_to_cartesian([r, h, v]: [f64; 3]) -> [f64; 3] {
    [r * v.sin() * h.cos(), r * v.sin() * h.sin(), r * v.cos()]
}

pub(super) fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Like NumPy's clip: the upper bound wins where the two cross.
fn clip(value: f64, (low, high): (f64, f64)) -> f64 {
    value.max(low).min(high)
}

fn uniform((low, high): (f64, f64), rng: &mut impl Rng) -> f64 {
    low + (high - low) * rng.random::<f64>()
}
