//! The tile in plain Rust.
//!
//! In: slices cut to what is read and written. Out: one tile of the product.

use super::{HALF, PANEL, Shape, Tile};

/// Four rows and sixteen columns at a time; the compiler makes vectors of it. Nothing is fused: where the target has no such instruction, a fused sum is a call of a function.
#[inline(always)]
pub(super) fn tile<const ROW: usize, const STEP: usize>(tile: Tile<'_>, left: &[f32], right: &[f32], out: &mut [f32]) {
    let Tile { shape, rows, add, half } = tile;
    for row in (0..rows).step_by(4) {
        for column in (0..if half { HALF } else { PANEL }).step_by(16) {
            let left = &left[row * ROW..];
            let out = &mut out[row * PANEL + column..];
            match rows - row {
                1 => block::<1, ROW, STEP>(shape, left, &right[column..], out, add),
                2 => block::<2, ROW, STEP>(shape, left, &right[column..], out, add),
                3 => block::<3, ROW, STEP>(shape, left, &right[column..], out, add),
                _ => block::<4, ROW, STEP>(shape, left, &right[column..], out, add),
            }
        }
    }
    tile.clear_other_half(out);
}

#[inline(always)]
fn block<const ROWS: usize, const ROW: usize, const STEP: usize>(
    shape: &Shape,
    left: &[f32],
    right: &[f32],
    out: &mut [f32],
    add: bool,
) {
    let mut sums = [[0.0_f32; 16]; ROWS];
    let mut k = 0;
    for outer in 0..shape.outer {
        for i in 0..shape.of_line(outer) {
            let line: &[f32] = &right[k * PANEL..k * PANEL + 16];
            let at = outer * shape.outer_step + i * STEP;
            for (r, sums) in sums.iter_mut().enumerate() {
                let x = left[at + r * ROW];
                for (sum, y) in sums.iter_mut().zip(line) {
                    *sum += x * y;
                }
            }
            k += 1;
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        for (out, sum) in out[r * PANEL..r * PANEL + 16].iter_mut().zip(sums) {
            *out = if add { *out + sum } else { *sum };
        }
    }
}
