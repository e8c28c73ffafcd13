//! The networks of VIBES, their checkpoints, and what is needed to use a trained model: encode observations into latents.
//!
//! | module | what it holds |
//! |---|---|
//! | [`config`] | sizes and constants of a model |
//! | [`model`] | encoder, dynamics, reward and decoder in one module, the adversary beside it |
//! | [`encoder`], [`dynamics`], [`reward`], [`adversary`], [`decoder`] | one network each |
//! | [`heads`], [`numbers`] | further predictions and learned numbers, by name |
//! | [`observe`], [`cnn`], [`mlp`], [`gru`], [`linear`] | the layers they are made of |
//! | [`actor`], [`actions`] | who acts, and the distribution that is drawn from |
//! | [`critic`], [`values`] | what it is worth, and the distribution of returns |
//! | [`guard`] | reward heads whose disagreement says where the reward model is not to be believed |
//! | [`imagine`], [`returns`] | acting in the learned dynamics, and the returns of it |
//! | [`kernels`] | the operations that decide how long an update takes |
//! | [`gaussian`] | the distributions they predict |
//! | [`cross_entropy`] | the action a critic values most |
//! | [`recurrent`], [`belief`] | the networks of agents that act through a GRU without imagining; what is known of an episode |
//! | [`sac`], [`slow`] | the networks of agents without a world model, and slow copies |
//! | [`agent`], [`behaviour`] | a trained agent at work; actor and critic together, and their file |
//! | [`trained`] | whatever was trained, in one shape for everyone who only uses it |
//! | [`player`] | a trained agent as it plays an episode: its memory of the last action, mode or sample, exploration |
//! | [`checkpoint`], [`parameters`] | weights on disk and by name |
//! | [`encode`], [`scale`] | a trained encoder at work, and how raw numbers enter it |
//!
//! Tensors are time-major, `[length, batch, …]`, as in Algorithm 1 of the paper.

pub mod actions;
pub mod actor;
pub mod adversary;
pub mod agent;
pub mod behaviour;
pub mod belief;
pub mod checkpoint;
pub mod cnn;
pub mod config;
pub mod critic;
pub mod cross_entropy;
pub mod decoder;
mod described;
pub mod dynamics;
pub mod encode;
pub mod encoder;
pub mod error;
pub mod gaussian;
pub mod gru;
pub mod guard;
pub mod heads;
pub mod imagine;
pub mod init;
pub mod kernels;
pub mod linear;
pub mod mlp;
pub mod model;
pub mod numbers;
pub mod observe;
pub mod parameters;
pub mod player;
pub mod recurrent;
pub mod returns;
pub mod reward;
pub mod sac;
pub mod scale;
pub mod slow;
pub mod trained;
pub mod values;

#[cfg(test)]
mod golden;

/// The CPU with this package's own kernels, for programs that use a trained model and name no backend.
pub fn cpu() -> burn::tensor::Device {
    burn::tensor::Device::flex()
}

pub use config::{ModelConfig, ObservationKind};
pub use error::ModelError;
pub use heads::HeadConfig;
pub use model::{Model, World};
