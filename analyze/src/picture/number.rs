//! Numbers as text on axes: where ticks stand, how their labels are written, and the sizes of what is written there.

use super::font::{Weight, width};

/// Size of tick labels, points.
pub const TICK_SIZE: f64 = 6.0;
/// Size of axis titles and legends, points.
pub const LABEL_SIZE: f64 = 7.0;
/// Size of figure titles, points.
pub const TITLE_SIZE: f64 = 8.0;

/// From which size on numbers have a unit, what it is, and its sign. An axis to one million has 200k rather than 0.2M.
const UNITS: [(f64, f64, &str); 4] = [(1e12, 1e12, "T"), (1e9, 1e9, "G"), (2e6, 1e6, "M"), (1e4, 1e3, "k")];
/// Sizes that are written without an exponent: more has no unit, less has more zeros than digits.
const ORDINARY: std::ops::Range<f64> = 1e-4..1e15;

/// How the numbers of an axis are written: in one unit, with as many decimals as tell them apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    unit: f64,
    suffix: String,
    decimals: usize,
}

impl Labels {
    /// `largest` is the largest number of the axis, which decides the unit of all; by `step` two of them differ at least, which decides the decimals.
    #[must_use]
    pub fn new(largest: f64, step: f64) -> Self {
        let largest = largest.abs();
        // What is smaller than this is nothing, and a unit of its size could not be divided by.
        let has_exponent = !ORDINARY.contains(&largest) && (1e-300..f64::INFINITY).contains(&largest);
        let (unit, suffix) = if has_exponent {
            let power = decade(largest);
            (10f64.powi(power), format!("e{power}"))
        } else {
            let found = UNITS.iter().find(|(from, ..)| largest >= *from);
            found.map_or((1.0, String::new()), |(_, unit, sign)| (*unit, (*sign).to_string()))
        };
        let decimals = -decade(step.abs() / unit);
        Self { unit, suffix, decimals: decimals.clamp(0, 15) as usize }
    }

    /// Labels for the ends of a range, which are no round numbers: to a hundredth of it.
    #[must_use]
    pub fn of_ends(largest: f64, extent: f64) -> Self {
        Self::new(largest, 10f64.powi(decade(extent) - 2))
    }

    /// A number's label, with a true minus sign and without zeros that say nothing.
    #[must_use]
    pub fn text(&self, value: f64) -> String {
        let text = format!("{:.*}", self.decimals, value / self.unit);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text.as_str() };
        if text.trim_start_matches('-') == "0" { "0".into() } else { minus(&format!("{text}{}", self.suffix)) }
    }
}

/// Round numbers along an axis, where ticks stand, and how they are written.
#[derive(Clone, Debug, PartialEq)]
pub struct Ticks {
    /// The numbers, rising.
    pub at: Vec<f64>,
    step: f64,
    labels: Labels,
}

impl Ticks {
    /// Ticks of a range that is `room` points long, only at whole numbers if `is_whole`. `apart` says how far from each other such ticks should stand, points; and
    /// how far at least, which holds where there would be fewer than three.
    #[must_use]
    pub fn new((lo, hi): (f64, f64), room: f64, is_whole: bool, apart: impl Fn(&Self) -> (f64, f64)) -> Self {
        let all: Vec<Self> = steps(hi - lo, is_whole).into_iter().map(|step| Self::of((lo, hi), step)).collect();
        let distance = |ticks: &Self| room * ticks.step / (hi - lo);
        let wished = all.iter().find(|ticks| distance(ticks) >= apart(ticks).0);
        let closer = all.iter().rev().find(|ticks| ticks.at.len() > 2 && distance(ticks) >= apart(ticks).1);
        let chosen = wished.filter(|ticks| ticks.at.len() > 2).or(closer).or(wished);
        chosen.cloned().unwrap_or_else(|| Self::of((lo, hi), hi - lo))
    }

    /// The multiples of a step.
    fn of((lo, hi): (f64, f64), step: f64) -> Self {
        let (first, last) = ((lo / step - 1e-9).ceil(), (hi / step + 1e-9).floor());
        let count = (last - first + 1.0).clamp(0.0, 1000.0) as usize;
        let at = (0..count).map(|i| (first + i as f64) * step).filter(|value| value.is_finite()).collect();
        Self { at, step, labels: Labels::new(lo.abs().max(hi.abs()), step) }
    }

    /// The label of a number.
    #[must_use]
    pub fn text(&self, value: f64) -> String {
        self.labels.text(value)
    }

    /// The width of the widest label, points.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.at.iter().map(|&value| width(&self.text(value), TICK_SIZE, Weight::Regular)).fold(0.0, f64::max)
    }
}

/// Round steps along an extent, from a tenth or less of it to all of it.
fn steps(extent: f64, is_whole: bool) -> Vec<f64> {
    let own = decade(extent);
    let all = (own - 1..=own + 1).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    all.filter(|step| !is_whole || *step >= 1.0).collect()
}

/// The power of ten that a number begins at, held to those that numbers have.
fn decade(size: f64) -> i32 {
    (size.log10() + 1e-12).floor().clamp(-320.0, 308.0) as i32
}

/// A number's text with a minus sign in place of the hyphen.
#[must_use]
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// A number with so many decimals; what is rounded to nothing has no sign.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_nothing = text.chars().all(|sign| matches!(sign, '-' | '0' | '.'));
    if is_nothing { text.replace('-', "") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_rounded_to_nothing_has_no_sign() {
        assert_eq!([-0.0, -0.0004, 0.0004].map(|value| fixed(value, 3)), ["0.000", "0.000", "0.000"]);
        assert_eq!([-0.0006, f64::NAN].map(|value| fixed(value, 3)), ["-0.001", "NaN"]);
        assert_eq!(fixed(-0.4, 0), "0");
    }

    fn ticks(lo: f64, hi: f64) -> Ticks {
        Ticks::new((lo, hi), 100.0, false, |_| (22.0, 9.0))
    }

    fn labels(lo: f64, hi: f64) -> Vec<String> {
        let ticks = ticks(lo, hi);
        ticks.at.iter().map(|&value| ticks.text(value)).collect()
    }

    #[test]
    fn labels_have_the_decimals_they_need() {
        assert_eq!(labels(0.0, 0.5), ["0", "0.2", "0.4"]);
        assert_eq!(labels(-20.0, 20.0), ["−20", "−10", "0", "10", "20"]);
        assert_eq!(labels(0.0, 100_000.0), ["0", "50k", "100k"]);
        assert_eq!(labels(0.0, 1e6), ["0", "500k", "1000k"]);
        assert_eq!(labels(0.0, 4e6), ["0", "1M", "2M", "3M", "4M"]);
    }

    #[test]
    fn numbers_of_unusual_sizes_have_labels_that_can_be_read() {
        assert_eq!(labels(0.0, 1e-6), ["0", "0.5e−6", "1e−6"]);
        assert_eq!(labels(0.0, 1e-9), ["0", "0.5e−9", "1e−9"]);
        assert_eq!(labels(0.0, 1e12), ["0", "0.5T", "1T"]);
        assert_eq!(labels(0.0, 2e20), ["0", "0.5e20", "1e20", "1.5e20", "2e20"]);
        assert_eq!(labels(-1e6, 1e6), ["−1000k", "−500k", "0", "500k", "1000k"]);
        assert_eq!(labels(0.0, 3e-4), ["0", "0.0001", "0.0002", "0.0003"]);
    }

    /// As of a loss that rests at a large number, or of a quantity in small units.
    #[test]
    fn no_two_ticks_have_one_label() {
        for exponent in -30..=30 {
            for (lo, hi) in [(0.0, 1.0), (-1.0, 3.7), (1.0, 1.000_01), (-7.03, -7.0), (0.2, 97.0)] {
                let size = 10f64.powi(exponent);
                let (at, labels) = (ticks(lo * size, hi * size).at, labels(lo * size, hi * size));
                assert!((3..=11).contains(&at.len()), "{lo} to {hi} e{exponent}: {labels:?}");
                assert!(labels.iter().all(|label| label.chars().count() < 14), "{labels:?}");
                let mut different = labels.clone();
                different.sort_unstable();
                different.dedup();
                assert_eq!(different.len(), at.len(), "{lo} to {hi} e{exponent}: {labels:?}");
            }
        }
    }

    #[test]
    fn whole_numbers_have_whole_ticks_and_no_range_breaks_them() {
        let whole = |hi: f64| Ticks::new((0.0, hi), 100.0, true, |_| (22.0, 9.0)).at;
        assert_eq!((whole(1.0), whole(2.0)), (vec![0.0, 1.0], vec![0.0, 1.0, 2.0]));
        for (lo, hi) in [(0.0, 0.0), (1.0, 0.0), (f64::NAN, 1.0), (-f64::MAX, f64::MAX), (0.0, f64::MIN_POSITIVE)] {
            assert!(ticks(lo, hi).at.iter().all(|value| value.is_finite()), "{lo} to {hi}");
        }
        assert_eq!(Labels::of_ends(249.0, 249.0).text(249.0), "249");
        assert_eq!(Labels::of_ends(100_500.0, 1_000.0).text(-100_496.0), "−100.5k");
        assert_eq!(Labels::of_ends(0.0, 0.0).text(0.0), "0");
    }
}
