//! Nothing but tests lives here: `tests/pipeline.rs` runs the three programs on a tiny real recording, `tests/fence.rs`
//! guards who may depend on whom.
