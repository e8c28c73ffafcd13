//! The random policies: every number of the action uniform in its bounds, anew at every agent step or held for several.

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

/// Uniform actions of which each is held for so many agent steps: where a body only moves if it is pushed the same way for a while, as a swimmer by a travelling wave.
#[derive(Clone, Debug)]
pub struct HeldRandom {
    hold: u32,
    held: Vec<f64>,
    left: u32,
}

impl HeldRandom {
    /// Holds every action for `hold` agent steps; 1 is [`Random`].
    pub fn new(hold: u32) -> Self {
        Self { hold, held: Vec::new(), left: 0 }
    }
}

impl Policy for HeldRandom {
    fn begin(&mut self, _: &Start) -> Result<()> {
        self.left = 0;
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        if self.left == 0 {
            self.held = Random.act(sight, rng)?;
            self.left = self.hold;
        }
        self.left = self.left.saturating_sub(1);
        Ok(self.held.clone())
    }
}

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
