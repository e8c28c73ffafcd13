//! Matrix products on panels, the one inner loop of all kernels.
//!
//! A matrix `[rows, columns]` is stored as panels of [`PANEL`] columns, each panel `[rows, PANEL]` row by row, the last one padded with zeros.
//! In: panels of the left side (read one number at a time) and of the right side (read one row at a time). Out: one panel of the product.

use super::instructions::Instructions;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

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
        let shape = Shape { outer: self.outer, outer_step: self.outer_step, inner: self.inner };
        let left = &self.data[..=shape.last::<ROW, STEP>(rows)];
        let (right, out) = (&right[..k * PANEL], &mut out[..rows * PANEL]);
        match instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => avx512::tile::<ROW, STEP>(shape, left, right, rows, out, add),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => avx2::tile::<ROW, STEP>(shape, left, right, rows, out, add),
            _ => portable::tile::<ROW, STEP>(shape, left, right, rows, out, add),
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

impl Shape {
    /// Where the last number lies that the left side's rows reach, none of the extents being zero.
    fn last<const ROW: usize, const STEP: usize>(self, rows: usize) -> usize {
        (rows - 1) * ROW + (self.outer - 1) * self.outer_step + (self.inner - 1) * STEP
    }
}

#[cfg(test)]
mod tests;
