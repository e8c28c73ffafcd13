//! Threads to which work is shared out: rayon's own, and others where those do not exist.
//!
//! In: work. Out: what it gives. A fork copies the thread that calls it and no other: the child finds rayon as its parent left it, without a single thread,
//! and whatever is shared out there is waited for for ever. So a child starts threads of its own.

use std::sync::OnceLock;

use rayon::{ThreadPool, ThreadPoolBuilder};

/// The threads of one process.
struct Threads {
    process: u32,
    /// None in the process that shared work out first, which has rayon's own.
    pool: Option<Result<ThreadPool, String>>,
    /// Those of its child, in the child's copy of this memory. A chain and no lock: a lock may be held by a thread that a fork leaves behind.
    of_child: OnceLock<Box<Self>>,
}

static FIRST: OnceLock<Threads> = OnceLock::new();

/// Runs `work` where its parts go to threads that exist.
///
/// # Errors
/// No threads can be started.
pub(crate) fn shared_out<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, String> {
    match &of_this_process().pool {
        None => Ok(work()),
        Some(Ok(pool)) => Ok(pool.install(work)),
        Some(Err(fact)) => Err(fact.clone()),
    }
}

fn of_this_process() -> &'static Threads {
    let process = std::process::id();
    let mut threads = FIRST.get_or_init(|| Threads { process, pool: None, of_child: OnceLock::new() });
    while threads.process != process {
        let started = || Box::new(Threads { process, pool: Some(start()), of_child: OnceLock::new() });
        threads = threads.of_child.get_or_init(started);
    }
    threads
}

/// As many threads as rayon's own would be.
fn start() -> Result<ThreadPool, String> {
    let pool = ThreadPoolBuilder::new().thread_name(|_| "vibes".into()).build();
    pool.map_err(|error| format!("no threads for the work: {error}"))
}
