//! Every set of instructions computes what the portable one does, bit by bit but for sums that are rounded once.

use super::{LANES, Lanes};
use crate::kernels::Instructions;

/// Numbers with both signs, zeros of both signs and some that are not numbers.
fn numbers() -> Vec<f32> {
    let odd = [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 2.0, -1e-30, 3.5];
    (0..LANES).map(|i| (i as f32 - 7.5) * 0.37).chain(odd).chain(odd.into_iter().rev()).collect()
}

/// Each operation's result on `a` and `b`, one after another.
#[inline(always)]
fn everything<V: Lanes>(proof: V::Proof, a: &[f32], b: &[f32], out: &mut [f32]) {
    let (a, b) = (V::at(proof, a, 0), V::at(proof, b, 0));
    let results =
        [a, V::zero(proof), a.plus(b), a.minus(b), a.opposite(), a.positive(), a.where_open(b), a.plus_times(0.5, b)];
    for (index, result) in results.into_iter().enumerate() {
        result.put(out, index * LANES);
    }
}

#[test]
fn instructions_agree() {
    let numbers = numbers();
    let sets = [Instructions::Avx512, Instructions::Avx2].into_iter().filter(|set| set.available());
    for set in sets {
        for (a, b) in [(0, LANES), (LANES, 0), (LANES, LANES), (0, 0)] {
            let (a, b) = (&numbers[a..a + LANES], &numbers[b..b + LANES]);
            let (mut found, mut wanted) = (vec![9.0; 8 * LANES], vec![7.0; 8 * LANES]);
            with_lanes!(set, everything(a, b, &mut found));
            with_lanes!(Instructions::Portable, everything(a, b, &mut wanted));
            for (index, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                // One half of a number is exact, so that even the fused sum is rounded once in both. A zero's sign does not matter.
                let equal = found == wanted || found.is_nan() && wanted.is_nan();
                assert!(equal, "{set:?}, operation {}, lane {}: {found} {wanted}", index / LANES, index % LANES);
            }
        }
    }
}

/// A training that has diverged must not look like one whose units are off.
#[test]
fn what_is_no_number_stays_none_and_passes_gradients_on() {
    let numbers = numbers();
    let (regular, odd) = (&numbers[..LANES], &numbers[LANES..2 * LANES]);
    let none = odd.iter().position(|number| number.is_nan()).expect("one that is no number");
    let sets = [Instructions::Avx512, Instructions::Avx2, Instructions::Portable];
    for set in sets.into_iter().filter(|set| set.available()) {
        let [mut of_odd, mut of_regular] = [vec![9.0; 8 * LANES], vec![9.0; 8 * LANES]];
        with_lanes!(set, everything(odd, odd, &mut of_odd));
        with_lanes!(set, everything(regular, odd, &mut of_regular));
        let (positive, open) = (of_odd[5 * LANES + none], of_regular[6 * LANES + none]);
        assert!(positive.is_nan(), "{set:?}: {positive}");
        assert_eq!(open, regular[none], "{set:?}");
    }
}
