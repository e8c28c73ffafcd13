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

/// Columns that are made together: of a panel that has no more than these, half of the work is left out.
const HALF: usize = PANEL / 2;

/// Most rows of the product made at once: 12 rows of two registers leave enough registers for the right side.
const TILE: usize = 12;

/// Where the left side's numbers lie: element `(row, k)` with `k = outer·inner + i` is at `row·ROW + outer·outer_step + i·STEP`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Left<'a, const ROW: usize, const STEP: usize> {
    data: &'a [f32],
    shape: Shape,
}

impl<'a> Left<'a, PANEL, 1> {
    /// Panels `[k/PANEL][rows, PANEL]` as they are, the last one filled with zeros: `left · right`.
    #[inline]
    pub(super) fn panels(data: &'a [f32], rows: usize, k: usize) -> Self {
        let outer = k.div_ceil(PANEL);
        Self { data, shape: Shape { outer, outer_step: rows * PANEL, inner: PANEL, last: PANEL - (outer * PANEL - k) } }
    }
}

impl<'a> Left<'a, 1, PANEL> {
    /// One panel `[k, PANEL]` turned round: `leftᵀ · right`, [`PANEL`] rows.
    #[inline]
    pub(super) fn turned(data: &'a [f32], k: usize) -> Self {
        Self::lines(data, 1, 0, k)
    }
}

impl<'a, const ROW: usize, const STEP: usize> Left<'a, ROW, STEP> {
    /// `outer` lines of `inner` numbers each.
    #[inline]
    pub(super) fn lines(data: &'a [f32], outer: usize, outer_step: usize, inner: usize) -> Self {
        Self { data, shape: Shape { outer, outer_step, inner, last: inner } }
    }

    /// The same without the rows before row `start`.
    #[inline]
    pub(super) fn rows_from(self, start: usize) -> Self {
        Self { data: &self.data[start * ROW..], ..self }
    }

    /// Sets `out` (`[rows, PANEL]`) to the product with `right` (`[k, PANEL]`), or adds to it.
    ///
    /// # Panics
    /// If a slice is too short.
    #[inline]
    pub(super) fn times(&self, right: &[f32], rows: usize, out: &mut [f32], add: bool, instructions: Instructions) {
        self.times_columns(PANEL, right, rows, out, add, instructions);
    }

    /// The same where only the first `columns` columns of `right` are wanted. Where they fill no more than half of a panel, the other half of `right` is not
    /// read, and that of `out` is set to zero, or left as it is.
    ///
    /// # Panics
    /// If a slice is too short.
    #[inline]
    pub(super) fn times_columns(
        &self,
        columns: usize,
        right: &[f32],
        rows: usize,
        out: &mut [f32],
        add: bool,
        instructions: Instructions,
    ) {
        for start in (0..rows).step_by(TILE) {
            let count = TILE.min(rows - start);
            let out = &mut out[start * PANEL..(start + count) * PANEL];
            self.tile([start, count], columns <= HALF, right, out, add, instructions);
        }
    }

    /// `rows` rows from row `start` on.
    fn tile(
        &self,
        [start, rows]: [usize; 2],
        half: bool,
        right: &[f32],
        out: &mut [f32],
        add: bool,
        instructions: Instructions,
    ) {
        if self.shape.k() == 0 {
            if !add {
                out.fill(0.0);
            }
            return;
        }
        let left = &self.data[start * ROW..][..=self.shape.reach::<ROW, STEP>(rows)];
        let out = &mut out[..rows * PANEL];
        let tile = Tile { shape: &self.shape, half, rows, add };
        match instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => avx512::tile::<ROW, STEP>(tile, left, right, out),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => avx2::tile::<ROW, STEP>(tile, left, right, out),
            _ => portable::tile::<ROW, STEP>(tile, left, right, out),
        }
    }
}

/// One tile of a product.
#[derive(Clone, Copy)]
struct Tile<'a> {
    /// Where it lies, not a copy of it: a copy is read two numbers at a time, which have just been written one by one, and so waits for everything that was written before.
    shape: &'a Shape,
    /// Only the first half of the panel's columns.
    half: bool,
    rows: usize,
    add: bool,
}

impl Tile<'_> {
    /// Sets the half of the product that is not made to zero, where nothing is added to it.
    #[inline(always)]
    fn clear_other_half(self, out: &mut [f32]) {
        if self.half && !self.add {
            out.chunks_exact_mut(PANEL).for_each(|row| row[HALF..].fill(0.0));
        }
    }

    /// That the slices hold all that is read and written. The sets of instructions ask in every build, as what they do is sound only then: a few comparisons a tile.
    #[cfg(target_arch = "x86_64")]
    fn check<const ROW: usize, const STEP: usize>(self, left: &[f32], right: &[f32], out: &[f32]) {
        let (rows, k) = (self.rows, self.shape.k());
        assert!(
            (1..=TILE).contains(&rows)
                && k > 0
                && left.len() > self.shape.reach::<ROW, STEP>(rows)
                && right.len() >= k * PANEL
                && out.len() >= rows * PANEL,
            "a tile of {rows} rows over {k} from slices of {}, {} and {}",
            left.len(),
            right.len(),
            out.len()
        );
    }
}

/// Extent of the summed index: `outer` lines of `inner` numbers, the last of them of `last`.
#[derive(Clone, Copy, Debug)]
struct Shape {
    outer: usize,
    outer_step: usize,
    inner: usize,
    last: usize,
}

impl Shape {
    /// How many numbers are summed.
    #[inline(always)]
    fn k(&self) -> usize {
        if self.outer == 0 { 0 } else { (self.outer - 1) * self.inner + self.last }
    }

    /// How many of line `outer`.
    #[inline(always)]
    fn of_line(&self, outer: usize) -> usize {
        if outer + 1 == self.outer { self.last } else { self.inner }
    }

    /// Where the last number lies that the left side's rows reach, some being summed.
    fn reach<const ROW: usize, const STEP: usize>(&self, rows: usize) -> usize {
        let line = |outer: usize, count: usize| outer * self.outer_step + count.saturating_sub(1) * STEP;
        let before = if self.outer > 1 { line(self.outer - 2, self.inner) } else { 0 };
        (rows - 1) * ROW + before.max(line(self.outer - 1, self.last))
    }
}

#[cfg(test)]
mod tests;
