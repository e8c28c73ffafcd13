//! Two AVX2 registers. In and out: as [`Lanes`].
//!
//! Arrays of sixteen numbers would do, but the compiler moves some of them through memory between two operations.

#![allow(unsafe_code, reason = "the instructions exist only where `HasAvx2` was made")]

use std::arch::x86_64::{
    __m256, _CMP_NLE_UQ, _mm256_add_ps, _mm256_and_ps, _mm256_cmp_ps, _mm256_fmadd_ps, _mm256_loadu_ps, _mm256_max_ps,
    _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps, _mm256_sub_ps,
};

use super::{LANES, Lanes};
use crate::kernels::instructions::HasAvx2;

/// Sixteen numbers in two registers. Its fields are private and what makes one asks for [`HasAvx2`], so that there is none on a processor without AVX2.
#[derive(Clone, Copy)]
pub(in crate::kernels) struct Pair(__m256, __m256);

impl Lanes for Pair {
    type Proof = HasAvx2;

    #[inline(always)]
    fn zero(_: HasAvx2) -> Self {
        // SAFETY: the processor has AVX2: the argument is the proof.
        let zero = unsafe { _mm256_setzero_ps() };
        Self(zero, zero)
    }

    #[inline(always)]
    fn load(_: HasAvx2, from: &[f32; LANES]) -> Self {
        // SAFETY: as in `zero`; the sixteen numbers lie behind the reference.
        unsafe { Self(_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(LANES / 2))) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        // SAFETY: the processor has AVX2, or `self` could not have been made; there is room for sixteen numbers behind the reference.
        unsafe {
            _mm256_storeu_ps(to.as_mut_ptr(), self.0);
            _mm256_storeu_ps(to.as_mut_ptr().add(LANES / 2), self.1);
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2, or `self` could not have been made.
        unsafe { Self(_mm256_add_ps(self.0, other.0), _mm256_add_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        // SAFETY: as in `plus`.
        unsafe { Self(_mm256_sub_ps(self.0, other.0), _mm256_sub_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn opposite(self) -> Self {
        // SAFETY: as in `plus`.
        unsafe {
            let zero = _mm256_setzero_ps();
            Self(_mm256_sub_ps(zero, self.0), _mm256_sub_ps(zero, self.1))
        }
    }

    #[inline(always)]
    fn plus_times(self, factor: f32, other: Self) -> Self {
        // SAFETY: as in `plus`; the processor has fused multiply-add too, as the proof asks for both.
        unsafe {
            let factor = _mm256_set1_ps(factor);
            Self(_mm256_fmadd_ps(factor, other.0, self.0), _mm256_fmadd_ps(factor, other.1, self.1))
        }
    }

    #[inline(always)]
    fn positive(self) -> Self {
        // SAFETY: as in `plus`. Where one operand is no number the result is the second.
        unsafe {
            let zero = _mm256_setzero_ps();
            Self(_mm256_max_ps(zero, self.0), _mm256_max_ps(zero, self.1))
        }
    }

    #[inline(always)]
    fn where_open(self, gate: Self) -> Self {
        // SAFETY: as in `plus`.
        unsafe {
            let zero = _mm256_setzero_ps();
            let open = |gate| _mm256_cmp_ps::<_CMP_NLE_UQ>(gate, zero);
            Self(_mm256_and_ps(open(gate.0), self.0), _mm256_and_ps(open(gate.1), self.1))
        }
    }
}
