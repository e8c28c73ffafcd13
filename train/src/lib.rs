//! Training VIBES and its ablations: objectives, the update of Algorithm 1, actor and critic, the offline and the online loop, and the run folder they fill.
//!
//! | module | what it holds |
//! |---|---|
//! | [`options`] | everything a run can be asked for, presets |
//! | [`windows`], [`batch`] | windows gathered ahead of time, and as tensors |
//! | [`learners`] | objectives and auxiliary terms, one file each; one update of Algorithm 1; Adam |
//! | [`gate`] | when the dynamics term begins to reach the encoder |
//! | [`prepare`], [`session`] | the run folder begun or found; what every loop shares |
//! | [`fit`], [`online`] | the two loops: on recordings, and in the environment |
//! | [`replay`] | what online training has lived through |
//! | [`run`], [`metrics`], [`vibes_measure::spectrum`] | the run folder, its numbers over time |
//! | [`mod@summary`], [`tensorboard`] | those numbers on one page, and for TensorBoard |
//! | [`trained`] | a run folder of either kind, opened to be read |
//! | [`sweep`] | many runs from one plan |
//! | [`mod@keep`] | a small copy of a run |
//! | [`encode`] | a trained run's latents of a recording |
//! | [`same_world`] | whether a recording is of the task and the action repeat that were learned from |
//! | [`mod@decode`] | what those latents show: a picture decoder fitted on them |
//! | [`evaluate`] | how good the latents are, on a held-out grid |
//! | [`mod@bench`] | how long an update takes |

pub mod batch;
pub mod bench;
pub mod checkpoints;
pub mod decode;
pub mod encode;
pub mod error;
pub mod evaluate;
pub mod fit;
pub mod gate;
pub mod json;
pub mod keep;
pub mod learners;
pub mod metrics;
pub mod online;
pub mod options;
pub mod prepare;
pub mod replay;
pub mod run;
pub mod same_world;
pub mod session;
pub mod settings;
pub mod summary;
pub mod sweep;
pub mod tensorboard;
pub mod trained;
pub mod windows;

pub use error::{Result, TrainError};
