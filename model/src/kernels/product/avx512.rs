//! The tile with AVX-512 registers.
//!
//! In: slices cut to exactly what is read and written. Out: one tile of the product.

#![allow(unsafe_code, reason = "vector loads and stores through pointers, after one check of the bounds per tile")]

use std::arch::x86_64::{
    __m512, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_set1_ps, _mm512_setzero_ps, _mm512_storeu_ps,
};

use super::{PANEL, Shape};
use crate::kernels::instructions::HasAvx512;

/// As [`portable::tile`](super::portable::tile).
///
/// # Panics
/// If a slice is too short, or more than 12 rows are asked for.
#[inline]
pub(super) fn tile<const ROW: usize, const STEP: usize>(
    shape: Shape,
    left: &[f32],
    right: &[f32],
    rows: usize,
    out: &mut [f32],
    add: bool,
) {
    let run = match rows {
        1 => fixed::<1, ROW, STEP>,
        2 => fixed::<2, ROW, STEP>,
        3 => fixed::<3, ROW, STEP>,
        4 => fixed::<4, ROW, STEP>,
        5 => fixed::<5, ROW, STEP>,
        6 => fixed::<6, ROW, STEP>,
        7 => fixed::<7, ROW, STEP>,
        8 => fixed::<8, ROW, STEP>,
        9 => fixed::<9, ROW, STEP>,
        10 => fixed::<10, ROW, STEP>,
        11 => fixed::<11, ROW, STEP>,
        _ => fixed::<12, ROW, STEP>,
    };
    // In every build, as the call below is sound only after it. The processor was asked once; the lengths are three comparisons per tile.
    let (last, k) = (shape.last::<ROW, STEP>(rows), shape.outer * shape.inner);
    assert!(
        (1..=12).contains(&rows) && k > 0 && left.len() > last && right.len() >= k * PANEL && out.len() >= rows * PANEL,
        "a tile of {rows} rows over {k} from slices of {}, {} and {}",
        left.len(),
        right.len(),
        out.len()
    );
    let _ = HasAvx512::checked();
    // SAFETY: `left` holds the last element that `shape` reaches from row `rows − 1`, `right` holds `outer · inner` rows and
    // `out` holds `rows` rows of `PANEL`; the processor has AVX-512, as was just checked.
    unsafe { run(shape, left.as_ptr(), right.as_ptr(), out.as_mut_ptr(), add) }
}

#[target_feature(enable = "avx512f")]
unsafe fn fixed<const ROWS: usize, const ROW: usize, const STEP: usize>(
    shape: Shape,
    left: *const f32,
    mut right: *const f32,
    out: *mut f32,
    add: bool,
) {
    let mut sums: [[__m512; 2]; ROWS] = [[_mm512_setzero_ps(); 2]; ROWS];
    // SAFETY: see `tile`: every address below lies in one of the three slices.
    unsafe {
        if add {
            for (r, sums) in sums.iter_mut().enumerate() {
                *sums = [_mm512_loadu_ps(out.add(r * PANEL)), _mm512_loadu_ps(out.add(r * PANEL + 16))];
            }
        }
        for outer in 0..shape.outer {
            let mut left = left.wrapping_add(outer * shape.outer_step);
            for _ in 0..shape.inner {
                let (low, high) = (_mm512_loadu_ps(right), _mm512_loadu_ps(right.add(16)));
                for (r, sums) in sums.iter_mut().enumerate() {
                    let x = _mm512_set1_ps(*left.add(r * ROW));
                    sums[0] = _mm512_fmadd_ps(x, low, sums[0]);
                    sums[1] = _mm512_fmadd_ps(x, high, sums[1]);
                }
                left = left.wrapping_add(STEP);
                right = right.wrapping_add(PANEL);
            }
        }
        for (r, sums) in sums.iter().enumerate() {
            _mm512_storeu_ps(out.add(r * PANEL), sums[0]);
            _mm512_storeu_ps(out.add(r * PANEL + 16), sums[1]);
        }
    }
}
