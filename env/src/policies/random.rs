//! The random policy: every number of the action uniform in its bounds, anew at every agent step.

use rand::{Rng, RngCore};
use vibes_data::ActionSpec;

use super::{Policy, Sight};
use crate::{Result, Start};

/// Uniform actions, drawn in double precision.
#[derive(Clone, Copy, Debug)]
pub struct Random;

/// Uniform actions, drawn in single precision: of the same generator these are other numbers. The first episodes of online training are made so, and
/// the bytes of a seed do not change.
#[derive(Clone, Copy, Debug)]
pub struct SingleRandom;

impl Policy for Random {
    fn begin(&mut self, _: &Start) -> Result<()> {
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        let ActionSpec { min, max } = sight.environment.action_spec();
        Ok(min.into_iter().zip(max).map(|(low, high)| rng.random_range(low..=high)).collect())
    }
}

impl Policy for SingleRandom {
    fn begin(&mut self, _: &Start) -> Result<()> {
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        let ActionSpec { min, max } = sight.environment.action_spec();
        let bounds = min.into_iter().zip(max).map(|(low, high)| (low as f32)..=(high as f32));
        Ok(bounds.map(|bounds| f64::from(rng.random_range(bounds))).collect())
    }
}
