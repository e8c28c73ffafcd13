//! What is left to do, shared by threads, and what went wrong first.
//!
//! In: jobs, and a flag that is set from outside to stop. Out: every job to one thread, until there is none, somebody failed or the flag is set; the first failure.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::vec::IntoIter;

use super::cores;
use crate::{Error, Result};

/// Jobs that several threads take.
#[derive(Debug)]
pub(super) struct Queue<'a, Job> {
    jobs: Mutex<IntoIter<Job>>,
    failure: Mutex<Option<Error>>,
    stop: &'a AtomicBool,
}

impl<'a, Job: Send> Queue<'a, Job> {
    pub(super) fn new(jobs: Vec<Job>, stop: &'a AtomicBool) -> Self {
        Self { jobs: Mutex::new(jobs.into_iter()), failure: Mutex::new(None), stop }
    }

    /// The next job; none when there is no other, or nobody is to take one any more.
    pub(super) fn take(&self) -> Option<Job> {
        if self.stop.load(Ordering::Relaxed) {
            return None;
        }
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner).next()
    }

    /// Lets so many threads do `work`, which takes jobs until there are none: no more than there are cores or jobs.
    pub(super) fn share(&self, threads: usize, work: impl Fn() -> Result<()> + Sync) {
        let jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner).len();
        let threads = threads.min(cores()).clamp(1, jobs.max(1));
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| self.fail_on(work()));
            }
        });
    }

    /// Keeps what went wrong, if it is the first, and lets nobody take another job.
    pub(super) fn fail_on(&self, outcome: Result<()>) {
        // Who was stopped while videos were made is one of those that were stopped, and nothing went wrong.
        if let Err(error) = outcome
            && !matches!(error, Error::World(vibes_env::Error::Stopped))
        {
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            *self.jobs.lock().unwrap_or_else(PoisonError::into_inner) = Vec::new().into_iter();
        }
    }

    /// What went wrong first.
    pub(super) fn into_failure(self) -> Option<Error> {
        self.failure.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU32;

    use super::*;

    fn failed(fact: &str) -> Error {
        Error::malformed("a", fact, "right")
    }

    #[test]
    fn every_job_is_done_once_and_after_a_failure_none() {
        let (stop, sum) = (AtomicBool::new(false), AtomicU32::new(0));
        let queue = Queue::new((1..=100).collect(), &stop);
        queue.share(3, || {
            while let Some(job) = queue.take() {
                sum.fetch_add(job, Ordering::Relaxed);
            }
            Ok(())
        });
        assert_eq!(sum.into_inner(), 5050);
        assert!(queue.into_failure().is_none());
        let queue = Queue::new(vec![1, 2], &stop);
        queue.fail_on(Err(vibes_env::Error::Stopped.into()));
        assert_eq!(queue.take(), Some(1), "whoever was stopped did not fail");
        queue.fail_on(Err(failed("first")));
        queue.fail_on(Err(failed("second")));
        assert_eq!(queue.take(), None);
        assert!(queue.into_failure().unwrap().to_string().starts_with("first"));
    }

    #[test]
    fn nobody_takes_a_job_after_a_stop() {
        let stop = AtomicBool::new(false);
        let queue = Queue::new(vec![1, 2], &stop);
        assert_eq!(queue.take(), Some(1));
        stop.store(true, Ordering::Relaxed);
        assert_eq!(queue.take(), None);
    }
}
