//! Matrix products on panels, the one inner loop of all kernels.
//!
//! A matrix `[rows, columns]` is stored as panels of [`PANEL`] columns, each panel `[rows, PANEL]` row by row, the last one padded with zeros.
//! In: panels of the left side (read one number at a time) and of the right side (read one row at a time). Out: one panel of the product.

use super::instructions::Instructions;

/// Columns of a panel: two AVX-512 registers.
pub(super) const PANEL: usize = 32;

/// Most rows of the product made at once: 12 rows of two registers leave enough registers for the right side.
const TILE: usize = 12;

/// Where the left side's numbers lie: element `(row, k)` with `k = outer·inner + i` is at `row·ROW + outer·outer_step + i·STEP`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Left<'a, const ROW: usize, const STEP: usize> {
    pub(super) data: &'a [f32],
    pub(super) outer: usize,
    pub(super) outer_step: usize,
    pub(super) inner: usize,
}

impl<'a> Left<'a, PANEL, 1> {
    /// Panels `[k/PANEL][rows, PANEL]` as they are: `left · right`.
    #[inline]
    pub(super) fn panels(data: &'a [f32], rows: usize, k: usize) -> Self {
        Self { data, outer: k / PANEL, outer_step: rows * PANEL, inner: PANEL }
    }
}

impl<'a> Left<'a, 1, PANEL> {
    /// One panel `[k, PANEL]` turned round: `leftᵀ · right`, [`PANEL`] rows.
    #[inline]
    pub(super) fn turned(data: &'a [f32], k: usize) -> Self {
        Self { data, outer: 1, outer_step: 0, inner: k }
    }
}

impl<const ROW: usize, const STEP: usize> Left<'_, ROW, STEP> {
    /// Sets `out` (`[rows, PANEL]`) to the product with `right` (`[k, PANEL]`), or adds to it.
    ///
    /// # Panics
    /// If a slice is too short.
    #[inline]
    pub(super) fn times(&self, right: &[f32], rows: usize, out: &mut [f32], add: bool, instructions: Instructions) {
        for start in (0..rows).step_by(TILE) {
            let tile = Left { data: &self.data[start * ROW..], ..*self };
            let count = TILE.min(rows - start);
            tile.tile(right, count, &mut out[start * PANEL..(start + count) * PANEL], add, instructions);
        }
    }

    fn tile(&self, right: &[f32], rows: usize, out: &mut [f32], add: bool, instructions: Instructions) {
        let k = self.outer * self.inner;
        if k == 0 {
            if !add {
                out.fill(0.0);
            }
            return;
        }
        let last = (rows - 1) * ROW + (self.outer - 1) * self.outer_step + (self.inner - 1) * STEP;
        let (left, right, out) = (&self.data[..=last], &right[..k * PANEL], &mut out[..rows * PANEL]);
        let shape = Shape { outer: self.outer, outer_step: self.outer_step, inner: self.inner };
        match instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => avx512::tile::<ROW, STEP>(shape, left, right, rows, out, add),
            Instructions::Avx2 => {
                instructions.run(|| portable::<ROW, STEP, true>(shape, left, right, rows, out, add));
            }
            _ => portable::<ROW, STEP, false>(shape, left, right, rows, out, add),
        }
    }
}

/// Extent of the summed index.
#[derive(Clone, Copy)]
struct Shape {
    outer: usize,
    outer_step: usize,
    inner: usize,
}

/// The tile in plain Rust, four rows and sixteen columns at a time; the compiler makes vectors of it.
#[inline(always)]
fn portable<const ROW: usize, const STEP: usize, const FUSED: bool>(
    shape: Shape,
    left: &[f32],
    right: &[f32],
    rows: usize,
    out: &mut [f32],
    add: bool,
) {
    for row in (0..rows).step_by(4) {
        for column in (0..PANEL).step_by(16) {
            let left = &left[row * ROW..];
            let out = &mut out[row * PANEL + column..];
            match rows - row {
                1 => block::<1, ROW, STEP, FUSED>(shape, left, &right[column..], out, add),
                2 => block::<2, ROW, STEP, FUSED>(shape, left, &right[column..], out, add),
                3 => block::<3, ROW, STEP, FUSED>(shape, left, &right[column..], out, add),
                _ => block::<4, ROW, STEP, FUSED>(shape, left, &right[column..], out, add),
            }
        }
    }
}

#[inline(always)]
fn block<const ROWS: usize, const ROW: usize, const STEP: usize, const FUSED: bool>(
    shape: Shape,
    left: &[f32],
    right: &[f32],
    out: &mut [f32],
    add: bool,
) {
    let mut sums = [[0.0_f32; 16]; ROWS];
    let mut k = 0;
    for outer in 0..shape.outer {
        for i in 0..shape.inner {
            let line: &[f32] = &right[k * PANEL..k * PANEL + 16];
            let at = outer * shape.outer_step + i * STEP;
            for (r, sums) in sums.iter_mut().enumerate() {
                let x = left[at + r * ROW];
                for (sum, y) in sums.iter_mut().zip(line) {
                    *sum = if FUSED { x.mul_add(*y, *sum) } else { x * y + *sum };
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

#[cfg(target_arch = "x86_64")]
mod avx512 {
    //! The tile with AVX-512 registers.
    #![allow(unsafe_code, reason = "vector loads and stores through pointers, after one check of the bounds per tile")]

    use std::arch::x86_64::{
        __m512, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_set1_ps, _mm512_setzero_ps, _mm512_storeu_ps,
    };

    use super::{PANEL, Shape};

    /// As [`super::portable`]. The caller has cut the slices to exactly what is read and written.
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
        // SAFETY: `left` ends after the last element that `shape` reaches from row `rows − 1`, `right` holds `outer · inner` rows and
        // `out` holds `rows` rows of `PANEL`; `Instructions::Avx512` exists only where the processor has AVX-512.
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
}
