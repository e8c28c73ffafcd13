//! The gates' functions, written so that the compiler can make vectors of them.
//!
//! In: pre-activations. Out: exp, logistic function, hyperbolic tangent, each within 4e-7 (of itself, the last one of 1).

/// eˣ: 2ⁿ times a polynomial on |r| ≤ ln 2 / 2 (coefficients of Cephes' `expf`), saturating at both ends.
#[inline(always)]
#[allow(clippy::excessive_precision, reason = "the published coefficients")]
pub(in crate::kernels) fn exp(x: f32) -> f32 {
    let x = x.clamp(-87.0, 88.0);
    // Rounds to the nearest integer: adding 1.5·2²³ leaves no bits for the fraction.
    let shifted = x * std::f32::consts::LOG2_E + 12_582_912.0;
    let n = shifted - 12_582_912.0;
    let r = (x - n * 0.693_359_375) + n * 2.121_944_4e-4;
    let p = [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 5.0e-1]
        .iter()
        .fold(1.987_569_1e-4, |p: f32, c| p * r + c);
    // The low bits of what was shifted are the integer's: no conversion is needed, of whose saturation the compiler makes no vectors.
    let power = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    (p * r * r + r + 1.0) * power
}

/// 1 / (1 + e⁻ˣ)
#[inline(always)]
pub(in crate::kernels) fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent; near zero by its series, where the quotient would cancel.
#[inline(always)]
pub(in crate::kernels) fn tanh(x: f32) -> f32 {
    let square = x * x;
    let near = x * (1.0 + square * (-1.0 / 3.0 + square * (2.0 / 15.0 - square * (17.0 / 315.0))));
    let far = 1.0 - 2.0 / (exp(2.0 * x) + 1.0);
    if square < 0.01 { near } else { far }
}

#[cfg(test)]
mod tests {
    use super::{exp, logistic, tanh};

    #[test]
    fn agree_with_float64() {
        for i in -4000..=4000 {
            let x = i as f32 / 100.0;
            let wide = f64::from(x);
            let close = |found: f32, exact: f64| (f64::from(found) - exact).abs() <= 4e-7 * exact.abs() + 1e-37;
            assert!(close(exp(x), wide.exp()), "exp {x}");
            assert!(close(logistic(x), 1.0 / (1.0 + (-wide).exp())), "logistic {x}");
            assert!((f64::from(tanh(x)) - wide.tanh()).abs() <= 4e-7, "tanh {x}");
        }
        assert!(logistic(-1e4) >= 0.0 && logistic(1e4) <= 1.0 && tanh(-1e4) >= -1.0 && tanh(f32::NAN).is_nan());
    }
}
