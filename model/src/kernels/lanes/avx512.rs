//! One AVX-512 register. In and out: as [`Lanes`].

#![allow(unsafe_code, reason = "the instructions exist only where `HasAvx512` was made")]

use std::arch::x86_64::{
    __m512, _CMP_NLE_UQ, _mm512_add_ps, _mm512_cmp_ps_mask, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_maskz_mov_ps,
    _mm512_max_ps, _mm512_set1_ps, _mm512_setzero_ps, _mm512_storeu_ps, _mm512_sub_ps,
};

use super::{LANES, Lanes};
use crate::kernels::instructions::HasAvx512;

/// Sixteen numbers in a register. Its field is private and what makes one asks for [`HasAvx512`], so that there is none on a processor without AVX-512.
#[derive(Clone, Copy)]
pub(in crate::kernels) struct Register(__m512);

impl Lanes for Register {
    type Proof = HasAvx512;

    #[inline(always)]
    fn zero(_: HasAvx512) -> Self {
        // SAFETY: the processor has AVX-512: the argument is the proof.
        Self(unsafe { _mm512_setzero_ps() })
    }

    #[inline(always)]
    fn load(_: HasAvx512, from: &[f32; LANES]) -> Self {
        // SAFETY: as in `zero`; the sixteen numbers lie behind the reference.
        Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        // SAFETY: the processor has AVX-512, or `self` could not have been made; there is room for sixteen numbers behind the reference.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: the processor has AVX-512, or `self` could not have been made.
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        // SAFETY: as in `plus`.
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn opposite(self) -> Self {
        // SAFETY: as in `plus`.
        Self(unsafe { _mm512_sub_ps(_mm512_setzero_ps(), self.0) })
    }

    #[inline(always)]
    fn plus_times(self, factor: f32, other: Self) -> Self {
        // SAFETY: as in `plus`.
        Self(unsafe { _mm512_fmadd_ps(_mm512_set1_ps(factor), other.0, self.0) })
    }

    #[inline(always)]
    fn positive(self) -> Self {
        // SAFETY: as in `plus`. Where one operand is no number the result is the second.
        Self(unsafe { _mm512_max_ps(_mm512_setzero_ps(), self.0) })
    }

    #[inline(always)]
    fn where_open(self, gate: Self) -> Self {
        // SAFETY: as in `plus`.
        Self(unsafe { _mm512_maskz_mov_ps(_mm512_cmp_ps_mask::<_CMP_NLE_UQ>(gate.0, _mm512_setzero_ps()), self.0) })
    }
}
