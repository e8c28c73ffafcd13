//! The learners: what is maximised, and one update of it. In: a model, a batch of windows. Out: the model after the update, and its measures.
//!
//! An [`objective`] is chosen by name and says what stands beside the reward; any number of [`auxiliary`] terms may be added to it by their weights.
//! Each is one file that states its name, options, networks and value, and one line in its registry.

pub mod auxiliary;
pub mod behaviour;
pub mod losses;
pub mod number;
pub mod objective;
pub mod optimizer;
pub mod rollout;
pub mod sac;
pub mod scene;
pub mod world;
