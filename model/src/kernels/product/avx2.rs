//! The tile with AVX2 registers and fused multiply-add.
//!
//! In: slices cut to exactly what is read and written. Out: one tile of the product.

#![allow(unsafe_code, reason = "vector loads and stores through pointers, after one check of the bounds per tile")]

use std::arch::x86_64::{
    __m256, _mm256_add_ps, _mm256_fmadd_ps, _mm256_loadu_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps,
};

use super::{HALF, PANEL, Shape, Tile};
use crate::kernels::instructions::HasAvx2;

/// Rows made at once: 6 rows of two registers leave enough of the sixteen for the right side.
const ROWS: usize = 6;
/// Columns made at once: two registers.
const COLUMNS: usize = 16;

/// As [`portable::tile`](super::portable::tile).
///
/// # Panics
/// If a slice is too short.
#[inline]
pub(super) fn tile<const ROW: usize, const STEP: usize>(tile: Tile<'_>, left: &[f32], right: &[f32], out: &mut [f32]) {
    tile.check::<ROW, STEP>(left, right, out);
    let _ = HasAvx2::checked();
    let mut row = 0;
    while row < tile.rows {
        // So few sums as one or two rows have wait for one another: seven and eight rows are made as four and the others.
        let left_over = tile.rows - row;
        let rows = if (ROWS + 1..ROWS + 3).contains(&left_over) { 4 } else { left_over.min(ROWS) };
        let run = match rows {
            1 => fixed::<1, ROW, STEP>,
            2 => fixed::<2, ROW, STEP>,
            3 => fixed::<3, ROW, STEP>,
            4 => fixed::<4, ROW, STEP>,
            5 => fixed::<5, ROW, STEP>,
            _ => fixed::<ROWS, ROW, STEP>,
        };
        for column in (0..if tile.half { HALF } else { PANEL }).step_by(COLUMNS) {
            let (left, right) = (left[row * ROW..].as_ptr(), right[column..].as_ptr());
            let out = out[row * PANEL + column..].as_mut_ptr();
            // SAFETY: `left` holds the last element that the shape reaches from the last of all rows, `right` holds as many rows as are summed and `out` holds all rows of
            // `PANEL`, of which these are `ROWS` at most and the columns from `column` on; the processor has AVX2, as was just checked.
            unsafe { run(tile.shape, left, right, out, tile.add) }
        }
        row += rows;
    }
    tile.clear_other_half(out);
}

#[target_feature(enable = "avx2,fma")]
unsafe fn fixed<const ROWS: usize, const ROW: usize, const STEP: usize>(
    shape: &Shape,
    left: *const f32,
    mut right: *const f32,
    out: *mut f32,
    add: bool,
) {
    let mut sums: [[__m256; 2]; ROWS] = [[_mm256_setzero_ps(); 2]; ROWS];
    // SAFETY: see `tile`: every address below lies in one of the three slices.
    unsafe {
        for outer in 0..shape.outer {
            let mut left = left.wrapping_add(outer * shape.outer_step);
            for _ in 0..shape.of_line(outer) {
                let (low, high) = (_mm256_loadu_ps(right), _mm256_loadu_ps(right.add(8)));
                for (r, sums) in sums.iter_mut().enumerate() {
                    let x = _mm256_set1_ps(*left.add(r * ROW));
                    sums[0] = _mm256_fmadd_ps(x, low, sums[0]);
                    sums[1] = _mm256_fmadd_ps(x, high, sums[1]);
                }
                left = left.wrapping_add(STEP);
                right = right.wrapping_add(PANEL);
            }
        }
        for (r, sums) in sums.iter().enumerate() {
            for (half, sum) in sums.iter().enumerate() {
                let place = out.add(r * PANEL + 8 * half);
                _mm256_storeu_ps(place, if add { _mm256_add_ps(_mm256_loadu_ps(place), *sum) } else { *sum });
            }
        }
    }
}
