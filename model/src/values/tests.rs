//! The two-hot distribution against `tests/golden/behaviour.json`.

use super::*;
use crate::golden::{Case, assert_close};

#[test]
fn the_two_hot_distribution_is_the_golden_one() {
    let case = Case::named("two_hot_symexp");
    let logits = case.input::<2>("logits");
    let values: Tensor<1> = case.input("values");
    let loss = ValueDistribution::TwoHot.loss(logits.clone(), values.clone());
    assert_close(&to_values(loss.clone()), &case.out("cross_entropy"), "cross_entropy");
    // The outermost bins are 5e8 apart: float32 holds such a mean to a few hundred.
    let mean = to_values(ValueDistribution::TwoHot.value(logits.clone()));
    for (found, wanted) in mean.iter().zip(case.out("mean")) {
        assert!((found - wanted).abs() < 1e-4 * wanted.abs() + 300.0, "{found} against {wanted}");
    }
    let gradient = logits.grad(&loss.sum().backward()).unwrap();
    assert_close(&to_values(gradient), &case.gradient("logits"), "logits");
    let (places, shares) = (case.out("bin"), case.out("upper_weight"));
    for ((value, place), share) in to_values(values).iter().zip(places).zip(shares) {
        let (found, found_share) = split(&bins(), f64::from(*value));
        // A value on a bin may be counted to either side of it.
        let position = |bin: f64, share: f64| bin + share;
        let wanted = position(f64::from(place), f64::from(share));
        assert!((position(found as f64, found_share) - wanted).abs() < 1e-3, "{value}: {found} {found_share}");
    }
}

#[test]
fn targets_beyond_the_outermost_bins_go_to_them() {
    let bins = bins();
    assert_eq!((bins.len(), bins[BINS / 2]), (BINS, 0.0));
    assert_eq!(split(&bins, 1e12), (BINS - 2, 1.0));
    assert_eq!(split(&bins, -1e12), (0, 0.0));
}
