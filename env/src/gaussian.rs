//! Normally distributed numbers from a generator of uniform ones.

use std::f64::consts::TAU;

use rand::{Rng, RngCore};

/// A draw from the standard normal distribution, by the Box–Muller transform; always takes two draws from the generator.
pub fn standard_normal(rng: &mut (impl RngCore + ?Sized)) -> f64 {
    // In (0, 1], so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (TAU * rng.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn moments_are_those_of_the_standard_normal() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let draws: Vec<f64> = (0..100_000).map(|_| standard_normal(&mut rng)).collect();
        let moment = |power| draws.iter().map(|draw| draw.powi(power)).sum::<f64>() / draws.len() as f64;
        // Within four standard errors of 0, 1, 0 and 3.
        assert!(moment(1).abs() < 0.013, "mean {}", moment(1));
        assert!((moment(2) - 1.0).abs() < 0.018, "variance {}", moment(2));
        assert!(moment(3).abs() < 0.05, "third moment {}", moment(3));
        assert!((moment(4) - 3.0).abs() < 0.13, "fourth moment {}", moment(4));
    }
}
