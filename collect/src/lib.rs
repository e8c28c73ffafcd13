//! Collecting: plans of recordings, the recorder, and the care of what was recorded.
//!
//! In: a world (`vibes-env`: tasks, policies, distractors, pictures). Out: recordings. [`recorder::record`] writes episodes; a [`Trace`] is an
//! episode in JSON, to compare simulations with.

pub mod bench;
pub mod care;
pub mod cli;
mod cut;
pub mod distractor_trace;
mod error;
pub mod extend;
pub mod frames;
mod keys;
mod largest;
mod paths;
pub mod plan;
pub mod played;
pub mod preview;
pub mod recorder;
pub mod redraw;
pub mod replay;
pub mod returns;
mod sound;
pub mod stored;
pub mod studio;
mod trace;
pub mod trained;
mod trajectories;
pub mod verify;

pub use error::{Error, Result};
pub use trace::{TRACE_FORMAT, Trace, TraceErrors};
