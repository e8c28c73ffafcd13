//! Training VIBES and its ablations: objectives, the update of Algorithm 1, the offline loop, and the run folder it fills.
//!
//! | module | what it holds |
//! |---|---|
//! | [`options`] | everything a run can be asked for, presets |
//! | [`windows`], [`batch`] | windows gathered ahead of time, and as tensors |
//! | [`learners`] | objectives and auxiliary terms, one file each; one update of Algorithm 1; Adam |
//! | [`gate`] | when the dynamics term begins to reach the encoder |
//! | [`prepare`], [`fit`] | the run folder begun or found; the one loop |
//! | [`run`], [`metrics`], [`vibes_measure::spectrum`] | the run folder, its numbers over time |
//! | [`mod@summary`], [`tensorboard`] | those numbers on one page, and for TensorBoard |
//! | [`encode`] | a trained run's latents of a recording |
//! | [`evaluate`] | how good the latents are, on a held-out grid |
//! | [`mod@bench`] | how long an update takes |

pub mod batch;
pub mod bench;
pub mod encode;
pub mod error;
pub mod evaluate;
pub mod fit;
pub mod gate;
pub mod learners;
pub mod metrics;
pub mod options;
pub mod prepare;
pub mod run;
pub mod summary;
pub mod tensorboard;
pub mod windows;

pub use error::{Result, TrainError};
