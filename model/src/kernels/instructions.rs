//! Which vector instructions the kernels use: found out when the program runs, so that one binary serves every machine.
//!
//! In: a loop over slices. Out: the same loop, compiled for and run with the widest instructions the processor has.

use std::sync::OnceLock;

/// A set of vector instructions, widest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// 16 float32 lanes.
    Avx512,
    /// 8 float32 lanes, fused multiply-add.
    Avx2,
    /// What every processor of the target has.
    Portable,
}

impl Instructions {
    /// The widest set this processor has. The environment variable `VIBES_INSTRUCTIONS` (`avx512`, `avx2` or `portable`)
    /// can ask for a narrower one; it is read once.
    pub fn best() -> Self {
        static BEST: OnceLock<Instructions> = OnceLock::new();
        *BEST.get_or_init(|| {
            let asked = std::env::var("VIBES_INSTRUCTIONS").unwrap_or_default();
            let narrowest = match asked.as_str() {
                "portable" => Self::Portable,
                "avx2" => Self::Avx2,
                _ => Self::Avx512,
            };
            [Self::Avx512, Self::Avx2, Self::Portable]
                .into_iter()
                .find(|set| *set as u8 >= narrowest as u8 && set.available())
                .unwrap_or(Self::Portable)
        })
    }

    /// Whether this processor has them.
    pub fn available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("fma")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }

    /// Runs `work` compiled for these instructions. `work` itself, also a closure, and what it calls must be `#[inline(always)]` to profit: what is not inlined is compiled for the
    /// target's minimum, where a fused multiply-add is a call of a function and takes a hundred times as long.
    ///
    /// # Panics
    /// If the processor does not have them.
    #[inline]
    pub(super) fn run<R>(self, work: impl FnOnce() -> R) -> R {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => HasAvx512::checked().run(
                #[inline(always)]
                |_| work(),
            ),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => HasAvx2::checked().run(
                #[inline(always)]
                |_| work(),
            ),
            _ => {
                assert!(self.available(), "{self:?} asked for on a processor without it");
                work()
            }
        }
    }
}

/// Proof that this processor has the instructions of [`Instructions::Avx2`]: only a check makes one, so whatever asks for it may use them.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(super) struct HasAvx2(());

#[cfg(target_arch = "x86_64")]
impl HasAvx2 {
    /// The proof, by asking the processor, in every build; what it answered once is read again.
    ///
    /// # Panics
    /// If the processor does not have them.
    #[inline]
    pub(super) fn checked() -> Self {
        static KNOWN: OnceLock<bool> = OnceLock::new();
        assert!(*KNOWN.get_or_init(|| Instructions::Avx2.available()), "AVX2 asked for on a processor without it");
        Self(())
    }

    /// Runs `work` compiled for these instructions, as [`Instructions::run`].
    #[inline]
    #[expect(unsafe_code, reason = "calls a function compiled for more instructions than the target's minimum")]
    pub(super) fn run<R>(self, work: impl FnOnce(Self) -> R) -> R {
        // SAFETY: the processor has them: `self` is the proof.
        unsafe { with_avx2(self, work) }
    }
}

/// Proof that this processor has the instructions of [`Instructions::Avx512`]: only a check makes one, so whatever asks for it may use them.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(super) struct HasAvx512(());

#[cfg(target_arch = "x86_64")]
impl HasAvx512 {
    /// The proof, by asking the processor, in every build; what it answered once is read again.
    ///
    /// # Panics
    /// If the processor does not have them.
    #[inline]
    pub(super) fn checked() -> Self {
        static KNOWN: OnceLock<bool> = OnceLock::new();
        assert!(*KNOWN.get_or_init(|| Instructions::Avx512.available()), "AVX-512 asked for on a processor without it");
        Self(())
    }

    /// Runs `work` compiled for these instructions, as [`Instructions::run`].
    #[inline]
    #[expect(unsafe_code, reason = "calls a function compiled for more instructions than the target's minimum")]
    pub(super) fn run<R>(self, work: impl FnOnce(Self) -> R) -> R {
        // SAFETY: the processor has them: `self` is the proof.
        unsafe { with_avx512(self, work) }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,fma")]
fn with_avx512<R>(proof: HasAvx512, work: impl FnOnce(HasAvx512) -> R) -> R {
    work(proof)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<R>(proof: HasAvx2, work: impl FnOnce(HasAvx2) -> R) -> R {
    work(proof)
}
