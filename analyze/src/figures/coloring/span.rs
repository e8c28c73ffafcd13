//! The numbers that the colours of a quantity are spread over.

/// From how many values on a few may be left out of a range.
const FEW: usize = 20;
/// One of so many values is left out at either end, at least one: half a percent.
const ONE_IN: usize = 200;
/// Values that are left out must lie further off than this share of the extent of the others, or the range is not worth the words.
const FAR: f64 = 0.3;

/// The range of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Span {
    /// The numbers of the first and the last colour.
    pub(in super::super) range: (f64, f64),
    /// Whether some values lie below, and whether some lie above.
    pub(in super::super) cut: (bool, bool),
    /// Whether all values are whole numbers.
    pub(in super::super) is_whole: bool,
}

impl Span {
    /// The range of the finite values, but for a few that lie far from all others; none where no value is finite.
    pub(in super::super) fn of(values: &[f64]) -> Option<Self> {
        let (range, cut) = bulk(values.iter().copied())?;
        let is_whole = values.iter().filter(|value| value.is_finite()).all(|value| value.fract() == 0.0);
        Some(Self { range, cut, is_whole })
    }

    /// A range of whole numbers.
    pub(in super::super) fn of_counts(first: u32, last: u32) -> Self {
        Self { range: (f64::from(first), f64::from(last)), cut: (false, false), is_whole: true }
    }

    /// Whether there is more than one value.
    pub(in super::super) fn varies(&self) -> bool {
        self.range.1 > self.range.0
    }

    /// How far along the range a value lies, from 0 to 1.
    pub(in super::super) fn share(&self, value: f64) -> f64 {
        let (lo, hi) = self.range;
        if self.varies() { ((value - lo) / (hi - lo)).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The range of the finite values, but for half a percent at either end if they lie far from all others; and at which ends some lie outside. None without any
/// finite value.
pub(in super::super) fn bulk(values: impl Iterator<Item = f64>) -> Option<((f64, f64), (bool, bool))> {
    let mut sorted: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    let left_out = if sorted.len() < FEW { 0 } else { sorted.len().div_ceil(ONE_IN) };
    let (low, high) = (sorted[left_out], sorted[sorted.len() - 1 - left_out]);
    // Where the others are all alike, what differs from them is what there is to see.
    let is_far = |distance: f64| high > low && distance > FAR * (high - low);
    let cut = (is_far(low - first), is_far(last - high));
    Some(((if cut.0 { low } else { first }, if cut.1 { high } else { last }), cut))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: u32) -> Vec<f64> {
        (0..count).map(f64::from).collect()
    }

    #[test]
    fn one_value_far_away_does_not_make_all_others_one_colour() {
        let mut values = numbers(100);
        assert_eq!(Span::of(&values).map(|span| (span.range, span.cut)), Some(((0.0, 99.0), (false, false))));
        values[50] = 1e6;
        let span = Span::of(&values).expect("values");
        assert_eq!((span.range, span.cut), ((0.0, 99.0), (false, true)));
        assert!(span.share(80.0) > 0.7 && (span.share(1e6) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_range_without_values_far_away_is_that_of_all() {
        let even: Vec<f64> = numbers(4000).into_iter().map(|i| (i * 0.37).sin()).collect();
        assert_eq!(Span::of(&even).map(|span| span.cut), Some((false, false)));
        let mut rare = vec![0.0; 5000];
        rare[7] = 1.0;
        assert_eq!(Span::of(&rare).map(|span| span.range), Some((0.0, 1.0)), "a reward that is seldom given");
        assert_eq!(Span::of(&[0.0, 1.0, 900.0]).map(|span| span.range), Some((0.0, 900.0)), "too few to tell");
        assert_eq!(Span::of(&[f64::NAN]), None);
    }

    #[test]
    fn very_small_ranges_have_all_colours() {
        let span = Span::of(&[0.0, 1e-13, 2e-13]).expect("values");
        assert!((span.share(1e-13) - 0.5).abs() < 1e-9);
        let one = Span::of(&[7.0, 7.0]).expect("values");
        assert!(!one.varies() && one.is_whole && one.share(7.0) < 1e-12);
    }
}
