//! The random policy: every number of the action uniform in its bounds, anew at every agent step.

use rand::{Rng, RngCore};
use vibes_data::ActionSpec;

/// Draws an action.
pub(super) fn act(bounds: &ActionSpec, rng: &mut impl RngCore) -> Vec<f64> {
    bounds.min.iter().zip(&bounds.max).map(|(&low, &high)| rng.random_range(low..=high)).collect()
}
