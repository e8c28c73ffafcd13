//! The colour axis: every material's RGB walks at random around the model's own.
//!
//! In: the model's own colours, the ranges and random draws. Out: RGB per control step, `[materials, 3]`, as MuJoCo stores
//! it (float32). Alpha and geoms with a colour of their own are untouched. Source: `distracting_control/color.py`; its mixture
//! of float32 bounds and a float64 walk is kept, so that the numbers agree.

use rand::Rng;

use super::ColorRanges;
use crate::standard_normal;

/// The walk, between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorWalk {
    low: Vec<f32>,
    high: Vec<f32>,
    current: Vec<f64>,
    step_std: f64,
}

impl ColorWalk {
    /// Starts an episode. `original` is the model's own RGB, `uniform` one number in `0..1` per channel.
    pub fn reset(original: &[f32], ranges: &ColorRanges, uniform: &[f64]) -> Self {
        let low: Vec<f32> = original.iter().map(|rgb| (rgb - ranges.max_delta).clamp(0.0, 1.0)).collect();
        let high: Vec<f32> = original.iter().map(|rgb| (rgb + ranges.max_delta).clamp(0.0, 1.0)).collect();
        let current = uniform
            .iter()
            .zip(low.iter().zip(&high))
            .map(|(draw, (low, high))| f64::from(*low) + draw * f64::from(high - low))
            .collect();
        Self { low, high, current, step_std: ranges.step_std }
    }

    /// One control step; `normals` holds one standard normal per channel.
    pub fn advance(&mut self, normals: &[f64]) {
        for (i, (current, normal)) in self.current.iter_mut().zip(normals).enumerate() {
            let moved = *current + normal * self.step_std;
            *current = moved.max(f64::from(self.low[i])).min(f64::from(self.high[i]));
        }
    }

    /// Writes `[materials, 3]` into `colors`, as the model holds them.
    pub fn rgb(&self, colors: &mut Vec<f32>) {
        colors.clear();
        colors.extend(self.current.iter().map(|&channel| channel as f32));
    }
}

/// The draws of a reset: uniform in `0..1`, one per channel.
pub fn draw_reset(channels: usize, rng: &mut impl Rng) -> Vec<f64> {
    (0..channels).map(|_| rng.random()).collect()
}

/// The draws of a step: standard normals, one per channel, into `normals`.
pub fn draw_step(normals: &mut [f64], rng: &mut impl Rng) {
    normals.fill_with(|| standard_normal(rng));
}
