//! Where the tests of this package find the built programs. `tests/pipeline.rs` runs the three programs on a tiny real recording, `tests/fence.rs` guards who may
//! depend on whom.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

/// Where cargo puts the built programs: two folders above the running test.
pub fn programs() -> PathBuf {
    std::env::current_exe().unwrap().parent().and_then(Path::parent).unwrap().to_owned()
}

/// One of the built programs.
pub fn program(name: &str) -> PathBuf {
    let path = programs().join(name);
    assert!(path.is_file(), "{name} is not built; run `cargo build --workspace` first: {}", path.display());
    path
}
