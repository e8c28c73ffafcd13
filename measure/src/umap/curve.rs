//! The low-dimensional similarity `1 / (1 + a d^{2b})` with the parameters that fit.
//!
//! `a` and `b` are fitted, as in the paper's section 3.2, to the curve that is 1 up to `min_dist` and falls off as
//! `exp(-(d - min_dist) / spread)` beyond it.

/// The fitted curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// Steepness.
    pub a: f32,
    /// Half the exponent.
    pub b: f32,
}

impl Curve {
    /// Least squares over 300 distances up to `3 spread`, by Gauss-Newton with damping.
    #[must_use]
    pub fn fit(min_dist: f64, spread: f64) -> Self {
        let target = |d: f64| {
            if d < min_dist { 1.0 } else { (-(d - min_dist) / spread).exp() }
        };
        let samples: Vec<(f64, f64)> =
            (1..300).map(|i| 3.0 * spread * f64::from(i) / 299.0).map(|d| (d, target(d))).collect();
        let loss =
            |a: f64, b: f64| samples.iter().map(|(d, y)| (1.0 / (1.0 + a * d.powf(2.0 * b)) - y).powi(2)).sum::<f64>();
        let (mut a, mut b, mut damping) = (1.0_f64, 1.0_f64, 1e-3_f64);
        for _ in 0..200 {
            let (mut aa, mut ab, mut bb, mut ga, mut gb) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (d, y) in &samples {
                let power = d.powf(2.0 * b);
                let value = 1.0 / (1.0 + a * power);
                let by_a = -power * value * value;
                let by_b = -2.0 * a * power * d.ln() * value * value;
                aa += by_a * by_a;
                ab += by_a * by_b;
                bb += by_b * by_b;
                ga += by_a * (value - y);
                gb += by_b * (value - y);
            }
            let (damped_aa, damped_bb) = (aa * (1.0 + damping), bb * (1.0 + damping));
            let determinant = damped_aa * damped_bb - ab * ab;
            let next_a = a - (damped_bb * ga - ab * gb) / determinant;
            let next_b = b - (damped_aa * gb - ab * ga) / determinant;
            if next_a > 0.0 && next_b > 0.0 && loss(next_a, next_b) <= loss(a, b) {
                (a, b, damping) = (next_a, next_b, damping * 0.3);
            } else {
                damping *= 10.0;
            }
        }
        Self { a: a as f32, b: b as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::Curve;

    /// The values the reference implementation prints for its defaults, and for a looser map.
    #[test]
    fn fits_the_known_curves() {
        for (min_dist, a, b) in [(0.1, 1.576_943, 0.895_060_9), (0.5, 0.583_030, 1.334_167)] {
            let curve = Curve::fit(min_dist, 1.0);
            assert!((curve.a - a).abs() < 1e-3 && (curve.b - b).abs() < 1e-3, "{curve:?}");
        }
    }
}
