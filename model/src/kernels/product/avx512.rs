//! The tile with AVX-512 registers.
//!
//! In: slices cut to exactly what is read and written. Out: one tile of the product.

#![allow(unsafe_code, reason = "vector loads and stores through pointers, after one check of the bounds per tile")]

use std::arch::x86_64::{
    __m512, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_set1_ps, _mm512_setzero_ps, _mm512_storeu_ps,
};

use super::{HALF, PANEL, Shape, Tile};
use crate::kernels::instructions::HasAvx512;

/// As [`portable::tile`](super::portable::tile).
///
/// # Panics
/// If a slice is too short, or more than 12 rows are asked for.
#[inline]
pub(super) fn tile<const ROW: usize, const STEP: usize>(tile: Tile<'_>, left: &[f32], right: &[f32], out: &mut [f32]) {
    tile.check::<ROW, STEP>(left, right, out);
    let _ = HasAvx512::checked();
    let run = if tile.half { of_rows::<1, ROW, STEP>(tile.rows) } else { of_rows::<2, ROW, STEP>(tile.rows) };
    // SAFETY: `left` holds the last element that the shape reaches from the last row, `right` holds as many rows as are summed and `out` holds `rows` rows of `PANEL`;
    // the processor has AVX-512, as was just checked.
    unsafe { run(tile.shape, left.as_ptr(), right.as_ptr(), out.as_mut_ptr(), tile.add) }
}

type Fixed = unsafe fn(&Shape, *const f32, *const f32, *mut f32, bool);

#[inline]
fn of_rows<const REGISTERS: usize, const ROW: usize, const STEP: usize>(rows: usize) -> Fixed {
    match rows {
        1 => fixed::<1, REGISTERS, ROW, STEP>,
        2 => fixed::<2, REGISTERS, ROW, STEP>,
        3 => fixed::<3, REGISTERS, ROW, STEP>,
        4 => fixed::<4, REGISTERS, ROW, STEP>,
        5 => fixed::<5, REGISTERS, ROW, STEP>,
        6 => fixed::<6, REGISTERS, ROW, STEP>,
        7 => fixed::<7, REGISTERS, ROW, STEP>,
        8 => fixed::<8, REGISTERS, ROW, STEP>,
        9 => fixed::<9, REGISTERS, ROW, STEP>,
        10 => fixed::<10, REGISTERS, ROW, STEP>,
        11 => fixed::<11, REGISTERS, ROW, STEP>,
        _ => fixed::<12, REGISTERS, ROW, STEP>,
    }
}

#[target_feature(enable = "avx512f")]
unsafe fn fixed<const ROWS: usize, const REGISTERS: usize, const ROW: usize, const STEP: usize>(
    shape: &Shape,
    left: *const f32,
    mut right: *const f32,
    out: *mut f32,
    add: bool,
) {
    let mut sums: [[__m512; REGISTERS]; ROWS] = [[_mm512_setzero_ps(); REGISTERS]; ROWS];
    // SAFETY: see `tile`: every address below lies in one of the three slices.
    unsafe {
        if add {
            for (r, sums) in sums.iter_mut().enumerate() {
                for (part, sum) in sums.iter_mut().enumerate() {
                    *sum = _mm512_loadu_ps(out.add(r * PANEL + 16 * part));
                }
            }
        }
        for outer in 0..shape.outer {
            let mut left = left.wrapping_add(outer * shape.outer_step);
            for _ in 0..shape.of_line(outer) {
                let mut line = [_mm512_setzero_ps(); REGISTERS];
                for (part, line) in line.iter_mut().enumerate() {
                    *line = _mm512_loadu_ps(right.add(16 * part));
                }
                for (r, sums) in sums.iter_mut().enumerate() {
                    let x = _mm512_set1_ps(*left.add(r * ROW));
                    for (sum, y) in sums.iter_mut().zip(&line) {
                        *sum = _mm512_fmadd_ps(x, *y, *sum);
                    }
                }
                left = left.wrapping_add(STEP);
                right = right.wrapping_add(PANEL);
            }
        }
        for (r, sums) in sums.iter().enumerate() {
            for (part, sum) in sums.iter().enumerate() {
                _mm512_storeu_ps(out.add(r * PANEL + 16 * part), *sum);
            }
            if REGISTERS == 1 && !add {
                _mm512_storeu_ps(out.add(r * PANEL + HALF), _mm512_setzero_ps());
            }
        }
    }
}
