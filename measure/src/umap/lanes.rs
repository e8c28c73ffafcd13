//! The forces on one vertex, eight at once: the layout spends its time here.
//!
//! In: the differences between a vertex's position and those of the points that act on it. Out: where these move it. Eight points are taken
//! together, the first three of them attracting and the other five repelling, since the reference draws five points that repel for one that
//! attracts. Every step is a plain loop over the eight, which the compiler turns into vector instructions (it would unroll an iterator's into single ones); no sum is taken in another
//! order, so that wide instructions and narrow ones give the same bits.

use super::curve::Curve;

/// A point of the map.
pub type Position = [f32; 2];

/// Points that act at once: one vector register of the machine, or two.
const LANES: usize = 8;
/// The lanes that attract, the first ones.
const ATTRACTING: usize = 3;
/// No single move is longer than this times the learning rate, per coordinate.
const LONGEST: f32 = 4.0;

/// What a difference of positions is multiplied by, in every lane. The gradients of both forces are one formula,
/// `(constant + by_power p) / ((near + d²)(1 + a p))` with `p = d^{2b}`, so that lanes may hold either:
/// attraction `-2ab d^{2(b-1)} / (1 + a d^{2b})`, repulsion `2b / ((0.001 + d²)(1 + a d^{2b}))`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forces {
    curve: Curve,
    constant: [f32; LANES],
    by_power: [f32; LANES],
    near: [f32; LANES],
}

impl Forces {
    pub(super) fn new(curve: Curve) -> Self {
        let lanes = |attracts, repels| std::array::from_fn(|lane| if lane < ATTRACTING { attracts } else { repels });
        Self {
            curve,
            constant: lanes(0.0, 2.0 * curve.b),
            by_power: lanes(-2.0 * curve.a * curve.b, 0.0),
            near: lanes(f32::MIN_POSITIVE, 0.001),
        }
    }
}

/// The differences of positions that wait to act on a vertex. A lane that holds none exerts no force.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lanes {
    x: [f32; LANES],
    y: [f32; LANES],
    attracting: usize,
    repelling: usize,
}

impl Lanes {
    #[inline(always)]
    pub(super) fn may_attract(&self) -> bool {
        self.attracting < ATTRACTING
    }

    #[inline(always)]
    pub(super) fn may_repel(&self) -> bool {
        self.repelling < LANES - ATTRACTING
    }

    /// Whether no lane is taken.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.attracting == 0 && self.repelling == 0
    }

    /// Whether none of the lanes that repel is taken.
    #[inline(always)]
    pub(super) fn repels_nothing(&self) -> bool {
        self.repelling == 0
    }

    /// Panics where [`may_attract`](Self::may_attract) is false.
    #[inline(always)]
    pub(super) fn attract(&mut self, at: Position, other: Position) {
        (self.x[self.attracting], self.y[self.attracting]) = (at[0] - other[0], at[1] - other[1]);
        self.attracting += 1;
    }

    /// Panics where [`may_repel`](Self::may_repel) is false.
    #[inline(always)]
    pub(super) fn repel(&mut self, at: Position, other: Position) {
        let lane = ATTRACTING + self.repelling;
        (self.x[lane], self.y[lane]) = (at[0] - other[0], at[1] - other[1]);
        self.repelling += 1;
    }

    /// Where the vertex at `at` is moved to. The lanes are empty then.
    #[inline(always)]
    pub(super) fn act(&mut self, at: Position, forces: &Forces, rate: f32) -> Position {
        let (mut to_x, mut to_y) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let (x, y) = (self.x[lane], self.y[lane]);
            let squared = x * x + y * y;
            let power = power(squared.max(f32::MIN_POSITIVE), forces.curve.b);
            let above = forces.constant[lane] + forces.by_power[lane] * power;
            let force = above / ((forces.near[lane] + squared) * (1.0 + forces.curve.a * power));
            to_x[lane] = (force * x).clamp(-LONGEST, LONGEST);
            to_y[lane] = (force * y).clamp(-LONGEST, LONGEST);
        }
        *self = Self::default();
        [at[0] + rate * sum(to_x), at[1] + rate * sum(to_y)]
    }
}

/// The sum of all lanes, in the order that halves take the least time to add.
#[inline(always)]
fn sum(lanes: [f32; LANES]) -> f32 {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// `x^b` for positive normal `x` to about 1e-5: the result must not depend on a
/// platform's mathematics library. `ln x` by the series of `artanh`, `2^y` by Taylor's around the nearest integer.
#[inline(always)]
fn power(x: f32, b: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (bits.cast_signed() >> 23) as f32;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) + SQRT_HALF);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    // Halves of a polynomial do not wait for each other.
    let log2 = exponent + s * ((2.885_39 + s2 * 0.961_797) + s2 * s2 * (0.577_078 + s2 * 0.412_199));
    // Adding 1.5 · 2^23 rounds to an integer and leaves it in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let y = (b * log2).clamp(-126.0, 126.0);
    let rounded = y + ROUND;
    let whole = rounded.to_bits().wrapping_sub(ROUND.to_bits());
    let f = (y - (rounded - ROUND)) * std::f32::consts::LN_2;
    let f2 = f * f;
    let exp = (1.0 + f) + f2 * ((0.5 + f * 0.166_666_67) + f2 * (0.041_666_67 + f * 0.008_333_334));
    f32::from_bits(exp.to_bits().wrapping_add(whole << 23))
}

#[cfg(test)]
mod tests {
    use super::power;

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
