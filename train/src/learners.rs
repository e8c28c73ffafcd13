//! The learners: what is maximised, and one update of it. In: a model, a batch of windows. Out: the model after the update, and its measures.

pub mod losses;
pub mod objective;
pub mod optimizer;
pub mod sac;
pub mod world;
