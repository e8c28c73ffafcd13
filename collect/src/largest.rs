//! The one reduction over errors of numbers that come from files. In: differences. Out: the largest of their sizes; infinite as soon as one of them is
//! no finite number, which `f64::max` would pass over without a word.

/// The largest absolute value, 0 of none; infinite when any is not finite.
pub(crate) fn largest(differences: impl IntoIterator<Item = f64>) -> f64 {
    differences.into_iter().fold(0.0, |largest: f64, next| {
        let size = if next.is_finite() { next.abs() } else { f64::INFINITY };
        largest.max(size)
    })
}

/// The largest absolute difference of pairs, as [`largest`].
pub(crate) fn largest_difference(pairs: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    largest(pairs.into_iter().map(|(one, other)| one - other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_none_is_the_largest() {
        assert_eq!(largest([]), 0.0);
        assert_eq!(largest([0.5, -2.0, 1.0]), 2.0);
        for none in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in 0..3 {
                let mut numbers = [1.0; 3];
                numbers[place] = none;
                assert_eq!(largest(numbers), f64::INFINITY, "{numbers:?}");
            }
        }
        assert_eq!(largest_difference([(1.0, 4.0), (f64::NAN, f64::NAN)]), f64::INFINITY);
    }
}
