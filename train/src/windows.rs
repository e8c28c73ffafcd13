//! The windows of every update, gathered ahead of time by a thread of their own, so that the trainer never waits for data. Which windows an update sees, and
//! its noise, follow from the seed and the update's number alone; so a run that is stopped and continued sees the same.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, Scope};

use rand::Rng;
use vibes_data::WindowBatch;
pub use vibes_data::{Purpose, Windows, update_rng};

use crate::error::{Result, TrainError};

/// Batches that wait to be used.
const AHEAD: usize = 3;
/// Bytes gathered before the recordings' pages are given back, as they are at the end, so that memory does not grow to the size of the recordings.
const RELEASE_AFTER: usize = 1 << 29;

/// What the windows of updates are drawn from.
pub trait Source: Sync {
    /// The windows of one update.
    fn sample(&self, rng: &mut impl Rng) -> WindowBatch;

    /// Gives the memory of the recordings' pages back until they are looked at again.
    fn release(&self);
}

impl Source for Windows {
    fn sample(&self, rng: &mut impl Rng) -> WindowBatch {
        Self::sample(self, rng)
    }

    fn release(&self) {
        Self::release(self);
    }
}

/// The batches of consecutive updates, gathered by a thread of `scope` that ends when this is dropped or the last update is reached.
#[derive(Debug)]
pub struct Prefetch {
    batches: Receiver<Result<WindowBatch>>,
}

impl Prefetch {
    /// Begins to gather.
    pub fn start<'scope>(
        scope: &'scope Scope<'scope, '_>,
        windows: &'scope impl Source,
        seed: u64,
        updates: std::ops::Range<u64>,
    ) -> Self {
        let (sender, batches) = sync_channel(AHEAD);
        let failed = sender.clone();
        let gather = move || {
            let mut gathered = 0;
            for update in updates {
                let batch = windows.sample(&mut update_rng(seed, update, Purpose::Windows));
                gathered += batch.pixels.len();
                if gathered > RELEASE_AFTER {
                    windows.release();
                    gathered = 0;
                }
                if sender.send(Ok(batch)).is_err() {
                    break;
                }
            }
            // However few there were: online training gathers for one episode at a time.
            windows.release();
        };
        // A panic here becomes an error of the run; left alone, it would be the scope's own.
        let gather = move || {
            if let Err(panic) = catch_unwind(AssertUnwindSafe(gather)) {
                failed.send(Err(TrainError::panicked("gathers windows", &*panic))).ok();
            }
        };
        thread::Builder::new().name("windows".to_owned()).spawn_scoped(scope, gather).ok();
        Self { batches }
    }

    /// The next update's windows.
    ///
    /// # Errors
    /// The thread has stopped, or panicked.
    #[allow(clippy::should_implement_trait, reason = "an iterator would hide that the thread can fail")]
    pub fn next(&self) -> Result<WindowBatch> {
        self.batches.recv().map_err(|_gone| TrainError::NoWindows)?
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    /// Whose third batch is not to be had.
    struct Torn;

    impl Source for Torn {
        fn sample(&self, rng: &mut impl Rng) -> WindowBatch {
            // The number of an update is the stream of its generator's draws.
            let third = update_rng(1, 2, Purpose::Windows).random::<u64>();
            assert_ne!(rng.random::<u64>(), third, "a page is gone");
            WindowBatch::default()
        }

        fn release(&self) {}
    }

    /// Counts how often its pages are given back.
    #[derive(Default)]
    struct Counted(std::sync::atomic::AtomicUsize);

    impl Source for Counted {
        fn sample(&self, _rng: &mut impl Rng) -> WindowBatch {
            WindowBatch::default()
        }

        fn release(&self) {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        }
    }

    #[test]
    fn pages_are_given_back_at_the_end_of_every_round_however_short() {
        let source = Counted::default();
        for round in 0..3 {
            thread::scope(|scope| {
                let batches = Prefetch::start(scope, &source, 1, round..round + 2);
                assert!(batches.next().is_ok() && batches.next().is_ok());
            });
        }
        assert_eq!(source.0.into_inner(), 3);
    }

    #[test]
    fn a_thread_that_panics_is_an_error_after_what_it_had_gathered() {
        thread::scope(|scope| {
            let batches = Prefetch::start(scope, &Torn, 1, 0..9);
            assert!(batches.next().is_ok() && batches.next().is_ok());
            let error = batches.next().unwrap_err().to_string();
            assert!(error.contains("gathers windows") && error.contains("a page is gone"), "{error}");
            assert!(matches!(batches.next(), Err(TrainError::NoWindows)));
        });
    }
}
