//! Sixteen float32 numbers handled at once: one AVX-512 register, or an array that the compiler cuts to the registers there are.
//!
//! In: sixteen neighbouring numbers. Out: their sums, differences and multiples. A vector can be made only by whoever holds the proof that the processor has its
//! instructions ([`Lanes::Proof`]), which [`with_lanes`] hands to the function that it calls; a vector that is there is proof enough of its own.

/// Numbers in one vector.
pub(super) const LANES: usize = 16;

/// Sixteen numbers.
pub(super) trait Lanes: Copy {
    /// What shows that the processor has the instructions.
    type Proof: Copy;

    fn zero(proof: Self::Proof) -> Self;
    fn load(proof: Self::Proof, from: &[f32; LANES]) -> Self;
    fn store(self, to: &mut [f32; LANES]);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    /// 0 − the number.
    fn opposite(self) -> Self;
    /// `self + factor · other`, rounded once where the instructions can.
    fn plus_times(self, factor: f32, other: Self) -> Self;
    /// The number, or 0 where it is negative; what is no number stays none.
    fn positive(self) -> Self;
    /// The number, or 0 where `gate` is 0 or below; a gate that is no number is open, as it was for [`positive`](Self::positive).
    fn where_open(self, gate: Self) -> Self;

    /// The sixteen numbers from `at` on.
    #[inline(always)]
    fn at(proof: Self::Proof, from: &[f32], at: usize) -> Self {
        match from[at..].first_chunk() {
            Some(from) => Self::load(proof, from),
            None => panic!("sixteen numbers at {at} of {}", from.len()),
        }
    }

    /// Puts the sixteen numbers from `at` on.
    #[inline(always)]
    fn put(self, to: &mut [f32], at: usize) {
        match to[at..].first_chunk_mut() {
            Some(to) => self.store(to),
            None => panic!("sixteen numbers at {at}"),
        }
    }
}

/// A number, or 0 where it is negative; what is no number stays none, so that a training that has diverged is noticed.
#[inline(always)]
pub(super) fn relu(number: f32) -> f32 {
    if number < 0.0 { 0.0 } else { number }
}

/// The gradient through [`relu`] from its output: 0 where that was closed.
#[inline(always)]
pub(super) fn relu_backward(output: f32, gradient: f32) -> f32 {
    if output <= 0.0 { 0.0 } else { gradient }
}

/// The whole vectors of a slice.
#[inline(always)]
pub(super) fn vectors(numbers: &[f32]) -> &[[f32; LANES]] {
    numbers.as_chunks().0
}

/// The whole vectors of a slice.
#[inline(always)]
pub(super) fn vectors_mut(numbers: &mut [f32]) -> &mut [[f32; LANES]] {
    numbers.as_chunks_mut().0
}

impl Lanes for [f32; LANES] {
    /// None is needed: the compiler cuts the array to what the target has.
    type Proof = ();

    #[inline(always)]
    fn zero((): ()) -> Self {
        [0.0; LANES]
    }

    #[inline(always)]
    fn load((): (), from: &Self) -> Self {
        *from
    }

    #[inline(always)]
    fn store(self, to: &mut Self) {
        *to = self;
    }

    #[inline(always)]
    fn plus(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self[i] += other[i];
        }
        self
    }

    #[inline(always)]
    fn minus(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self[i] -= other[i];
        }
        self
    }

    #[inline(always)]
    fn opposite(self) -> Self {
        [0.0; LANES].minus(self)
    }

    #[inline(always)]
    fn plus_times(mut self, factor: f32, other: Self) -> Self {
        for i in 0..LANES {
            self[i] += factor * other[i];
        }
        self
    }

    #[inline(always)]
    fn positive(mut self) -> Self {
        for number in &mut self {
            *number = relu(*number);
        }
        self
    }

    #[inline(always)]
    fn where_open(mut self, gate: Self) -> Self {
        for i in 0..LANES {
            self[i] = relu_backward(gate[i], self[i]);
        }
        self
    }
}

/// Calls a function compiled for `$instructions`, with the vector type that suits them; the proof that the processor has them is its first argument.
macro_rules! with_lanes {
    ($instructions:expr, $function:ident ( $($argument:expr),* )) => {
        match $instructions {
            #[cfg(target_arch = "x86_64")]
            crate::kernels::Instructions::Avx512 => crate::kernels::instructions::HasAvx512::checked()
                .run(#[inline(always)] |proof| $function::<crate::kernels::lanes::Register>(proof, $($argument),*)),
            #[cfg(target_arch = "x86_64")]
            crate::kernels::Instructions::Avx2 => crate::kernels::instructions::HasAvx2::checked()
                .run(#[inline(always)] |proof| $function::<crate::kernels::lanes::Pair>(proof, $($argument),*)),
            _ => $instructions.run(#[inline(always)] || $function::<[f32; crate::kernels::lanes::LANES]>((), $($argument),*)),
        }
    };
}

pub(super) use with_lanes;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Pair;
#[cfg(target_arch = "x86_64")]
pub(super) use avx512::Register;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(test)]
mod tests;
