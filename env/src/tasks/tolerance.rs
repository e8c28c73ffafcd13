//! The Control Suite's shared reward shape: 1 inside an interval, falling off outside it (`dm_control/utils/rewards.py`).
//!
//! With `d` the distance to the interval in units of the margin, the value outside is `sigmoid(d)`, scaled so that `sigmoid(1)` is
//! `value_at_margin`; without a margin it is 0.

/// How the value falls off with the distance `d`, where `v` is the value at `d = 1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sigmoid {
    /// `exp(−(d s)² / 2)` with `s² = −2 ln v`.
    Gaussian,
    /// `1 / cosh(d s)` with `s = arcosh(1 / v)`.
    Hyperbolic,
    /// `1 / ((d s)² + 1)` with `s² = 1 / v − 1`.
    LongTail,
    /// `1 / (|d| s + 1)` with `s = 1 / v − 1`.
    Reciprocal,
    /// `(1 + cos(π d s)) / 2` until it touches 0, with `s = arccos(2 v − 1) / π`.
    Cosine,
    /// `1 − d s` until it touches 0, with `s = 1 − v`.
    Linear,
    /// `1 − (d s)²` until it touches 0, with `s² = 1 − v`.
    Quadratic,
    /// `1 − tanh²(d s)` with `s = artanh(√(1 − v))`.
    TanhSquared,
}

impl Sigmoid {
    /// The value at distance `d`, where `v` in `(0, 1)` is the value at distance 1 (0 is allowed for cosine, linear and quadratic).
    fn value(self, d: f64, v: f64) -> f64 {
        let until_zero = |x: f64, value: f64| if x.abs() < 1.0 { value } else { 0.0 };
        match self {
            Self::Gaussian => (-0.5 * (d * (-2.0 * v.ln()).sqrt()).powi(2)).exp(),
            Self::Hyperbolic => 1.0 / (d * (1.0 / v).acosh()).cosh(),
            Self::LongTail => 1.0 / ((d * (1.0 / v - 1.0).sqrt()).powi(2) + 1.0),
            Self::Reciprocal => 1.0 / (d.abs() * (1.0 / v - 1.0) + 1.0),
            Self::Cosine => {
                let x = d * (2.0 * v - 1.0).acos() / std::f64::consts::PI;
                until_zero(x, f64::midpoint(1.0, (std::f64::consts::PI * x).cos()))
            }
            Self::Linear => {
                let x = d * (1.0 - v);
                until_zero(x, 1.0 - x)
            }
            Self::Quadratic => {
                let x = d * (1.0 - v).sqrt();
                until_zero(x, 1.0 - x * x)
            }
            Self::TanhSquared => 1.0 - (d * (1.0 - v).sqrt().atanh()).tanh().powi(2),
        }
    }
}

/// An interval and how the value falls off outside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// The interval's lower end, itself inside.
    pub lower: f64,
    /// The interval's upper end, itself inside; infinite for "at least `lower`".
    pub upper: f64,
    /// The distance at which the value is `value_at_margin`; with 0 it is 0 at once.
    pub margin: f64,
    /// The shape of the fall.
    pub sigmoid: Sigmoid,
    /// The value at the margin.
    pub value_at_margin: f64,
}

impl Tolerance {
    /// 1 from `lower` to `upper`, 0 outside.
    pub const fn within(lower: f64, upper: f64) -> Self {
        Self { lower, upper, margin: 0.0, sigmoid: Sigmoid::Gaussian, value_at_margin: 0.1 }
    }

    /// 1 from `lower` up.
    pub const fn at_least(lower: f64) -> Self {
        Self::within(lower, f64::INFINITY)
    }

    /// The same with a Gaussian fall to 0.1 at `margin`, `dm_control`'s default.
    #[must_use]
    pub const fn margin(mut self, margin: f64) -> Self {
        self.margin = margin;
        self
    }

    /// The same with another shape of the fall.
    #[must_use]
    pub const fn falling(mut self, sigmoid: Sigmoid, value_at_margin: f64) -> Self {
        self.sigmoid = sigmoid;
        self.value_at_margin = value_at_margin;
        self
    }

    /// The value at `x`, in `[0, 1]`.
    pub fn value(&self, x: f64) -> f64 {
        if self.lower <= x && x <= self.upper {
            return 1.0;
        }
        if self.margin <= 0.0 {
            return 0.0;
        }
        let outside = if x < self.lower { self.lower - x } else { x - self.upper };
        self.sigmoid.value(outside / self.margin, self.value_at_margin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `dm_control.utils.rewards.tolerance(x, bounds=(-1, 2), margin=1.5, sigmoid=…, value_at_margin=0.3)` at x = 2.7 and x = -4.
    #[test]
    fn agrees_with_dm_control_outside_the_bounds() {
        let golden = [
            (Sigmoid::Gaussian, 0.769358274132753, 0.008100000000000003),
            (Sigmoid::Hyperbolic, 0.7105687959086446, 0.04712041884816754),
            (Sigmoid::LongTail, 0.6630648330058939, 0.0967741935483871),
            (Sigmoid::Reciprocal, 0.478723404255319, 0.1764705882352941),
            (Sigmoid::Cosine, 0.8008855577843025, 0.0),
            (Sigmoid::Linear, 0.6733333333333333, 0.0),
            (Sigmoid::Quadratic, 0.8475555555555554, 0.0),
            (Sigmoid::TanhSquared, 0.7384604905693255, 0.03114186851211065),
        ];
        for (sigmoid, near, far) in golden {
            let tolerance = Tolerance::within(-1.0, 2.0).margin(1.5).falling(sigmoid, 0.3);
            assert!((tolerance.value(2.7) - near).abs() < 1e-14, "{sigmoid:?} at 2.7: {}", tolerance.value(2.7));
            assert!((tolerance.value(-4.0) - far).abs() < 1e-14, "{sigmoid:?} at -4: {}", tolerance.value(-4.0));
        }
    }

    #[test]
    fn the_ends_are_inside_and_no_margin_means_a_step() {
        let step = Tolerance::within(0.0, 0.06);
        let values = [-1e-9, 0.0, 0.06, 0.06 + 1e-9].map(|x| step.value(x));
        assert_eq!(values, [0.0, 1.0, 1.0, 0.0]);
        assert_eq!(Tolerance::at_least(3.0).value(1e300), 1.0);
    }

    #[test]
    fn the_value_at_the_margin_is_as_asked() {
        use Sigmoid::{Cosine, Gaussian, Hyperbolic, Linear, LongTail, Quadratic, Reciprocal, TanhSquared};
        for sigmoid in [Gaussian, Hyperbolic, LongTail, Reciprocal, Cosine, Linear, Quadratic, TanhSquared] {
            let tolerance = Tolerance::at_least(0.0).margin(2.0).falling(sigmoid, 0.4);
            assert!((tolerance.value(-2.0) - 0.4).abs() < 1e-12, "{sigmoid:?}");
            assert!(tolerance.value(-1.0) > tolerance.value(-1.5), "{sigmoid:?} falls");
        }
    }

    #[test]
    fn shapes_that_touch_zero_stay_there() {
        for sigmoid in [Sigmoid::Cosine, Sigmoid::Linear, Sigmoid::Quadratic] {
            let tolerance = Tolerance::at_least(10.0).margin(10.0).falling(sigmoid, 0.0);
            assert_eq!([tolerance.value(0.0), tolerance.value(-50.0)], [0.0, 0.0], "{sigmoid:?}");
        }
    }
}
