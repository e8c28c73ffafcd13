//! The low-dimensional similarity `1 / (1 + a d^{2b})` and the forces its gradient exerts.
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

    /// One attraction.
    pub(super) fn attraction(self) -> Forces<1> {
        let (constant, by_power, near) = self.attracts();
        Forces { curve: self, constant: [constant], by_power: [by_power], near: [near] }
    }

    /// Repulsions in every lane.
    pub(super) fn repulsions(self) -> Forces<LANES> {
        let (constant, by_power, near) = self.repels();
        Forces { curve: self, constant: [constant; LANES], by_power: [by_power; LANES], near: [near; LANES] }
    }

    /// An attraction in the first lane, repulsions in the others.
    pub(super) fn attraction_and_repulsions(self) -> Forces<LANES> {
        let mut forces = self.repulsions();
        (forces.constant[0], forces.by_power[0], forces.near[0]) = self.attracts();
        forces
    }

    fn attracts(self) -> (f32, f32, f32) {
        (0.0, -2.0 * self.a * self.b, f32::MIN_POSITIVE)
    }

    fn repels(self) -> (f32, f32, f32) {
        (2.0 * self.b, 0.0, 0.001)
    }
}

/// Points that act on one vertex at once: one vector register of the machine, or two.
pub(super) const LANES: usize = 8;

/// What a difference of positions is multiplied by. The gradients of both forces are one formula,
/// `(constant + by_power p) / ((near + d²)(1 + a p))` with `p = d^{2b}`, so that lanes may hold either:
/// attraction `-2ab d^{2(b-1)} / (1 + a d^{2b})`, repulsion `2b / ((0.001 + d²)(1 + a d^{2b}))`.
pub(super) struct Forces<const N: usize> {
    curve: Curve,
    constant: [f32; N],
    by_power: [f32; N],
    near: [f32; N],
}

impl<const N: usize> Forces<N> {
    /// The forces at squared distances.
    #[inline]
    pub(super) fn at(&self, squared: &[f32; N]) -> [f32; N] {
        std::array::from_fn(|lane| {
            let power = power(squared[lane].max(f32::MIN_POSITIVE), self.curve.b);
            let above = self.constant[lane] + self.by_power[lane] * power;
            above / ((self.near[lane] + squared[lane]) * (1.0 + self.curve.a * power))
        })
    }
}

/// `x^b` for positive normal `x` to about 1e-5: the layout spends its time here, and the result must not depend on a
/// platform's mathematics library. `ln x` by the series of `artanh`, `2^y` by Taylor's around the nearest integer.
#[inline]
fn power(x: f32, b: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (bits.cast_signed() >> 23) as f32;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) + SQRT_HALF);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    let log2 = exponent + s * (2.885_39 + s2 * (0.961_797 + s2 * (0.577_078 + s2 * 0.412_199)));
    // Adding 1.5 · 2^23 rounds to an integer and leaves it in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let y = (b * log2).clamp(-126.0, 126.0);
    let rounded = y + ROUND;
    let whole = rounded.to_bits().wrapping_sub(ROUND.to_bits());
    let f = (y - (rounded - ROUND)) * std::f32::consts::LN_2;
    let exp = 1.0 + f * (1.0 + f * (0.5 + f * (0.166_666_67 + f * (0.041_666_67 + f * 0.008_333_334))));
    f32::from_bits(exp.to_bits().wrapping_add(whole << 23))
}

#[cfg(test)]
mod tests {
    use super::{Curve, power};

    /// The values the reference implementation prints for its defaults, and for a looser map.
    #[test]
    fn fits_the_known_curves() {
        for (min_dist, a, b) in [(0.1, 1.576_943, 0.895_060_9), (0.5, 0.583_030, 1.334_167)] {
            let curve = Curve::fit(min_dist, 1.0);
            assert!((curve.a - a).abs() < 1e-3 && (curve.b - b).abs() < 1e-3, "{curve:?}");
        }
    }

    #[test]
    fn power_is_close_to_the_true_power() {
        for exponent in -30..30 {
            let x = 1.37_f32.powi(exponent) * 1.1;
            for b in [0.3_f32, 0.895, 1.33] {
                let (got, true_power) = (power(x, b), x.powf(b));
                assert!((got / true_power - 1.0).abs() < 1e-5, "{x}^{b}: {got} {true_power}");
            }
        }
    }
}
