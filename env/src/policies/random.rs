//! The random policy: every number of the action uniform in its bounds, anew at every agent step.

use rand::{Rng, RngCore};

use super::{Policy, Sight};
use crate::{Result, Start};

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct Random;

impl Policy for Random {
    fn begin(&mut self, _: &Start) -> Result<()> {
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        let bounds = sight.environment.action_spec();
        Ok(bounds.min.iter().zip(&bounds.max).map(|(&low, &high)| rng.random_range(low..=high)).collect())
    }
}
