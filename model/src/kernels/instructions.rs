//! Which vector instructions the kernels use: found out when the program runs, so that one binary serves every machine.
//!
//! In: a loop over slices. Out: the same loop, compiled for and run with the widest instructions the processor has.

use std::sync::OnceLock;

use crate::error::ModelError;

/// The environment variable that asks for a set.
const VARIABLE: &str = "VIBES_INSTRUCTIONS";
/// The words that it may hold.
const NAMES: [(&str, Instructions); 3] =
    [("avx512", Instructions::Avx512), ("avx2", Instructions::Avx2), ("portable", Instructions::Portable)];

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
            // A word that is none of them is refused where networks are made.
            let narrowest = Self::asked().ok().flatten().unwrap_or(Self::Avx512);
            [Self::Avx512, Self::Avx2, Self::Portable]
                .into_iter()
                .find(|set| *set as u8 >= narrowest as u8 && set.available())
                .unwrap_or(Self::Portable)
        })
    }

    /// The set that the environment variable `VIBES_INSTRUCTIONS` asks for; none where it is not there or empty.
    ///
    /// # Errors
    /// It holds another word.
    pub fn asked() -> Result<Option<Self>, ModelError> {
        Self::named(&std::env::var_os(VARIABLE).unwrap_or_default().to_string_lossy())
    }

    fn named(word: &str) -> Result<Option<Self>, ModelError> {
        match (word, NAMES.iter().find(|(name, _)| *name == word)) {
            ("", _) => Ok(None),
            (_, Some((_, set))) => Ok(Some(*set)),
            (_, None) => {
                let known = NAMES.map(|(name, _)| name).to_vec();
                Err(ModelError::UnknownInstructions { variable: VARIABLE, asked: word.to_owned(), known })
            }
        }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_word_that_names_no_instructions_is_refused_with_those_that_do() {
        assert_eq!(Instructions::named("").unwrap(), None);
        assert_eq!(NAMES.map(|(name, _)| Instructions::named(name).unwrap()), NAMES.map(|(_, set)| Some(set)));
        for typo in ["avx", "AVX2", "portable "] {
            let error = Instructions::named(typo).unwrap_err().to_string();
            assert!(error.contains(typo) && error.contains("avx512, avx2, portable"), "{error}");
        }
    }
}
