//! Soft actor-critic through a GRU, and `CoRe` (apple/ml-core) on the same networks: the systems without a world model's imagination that remember more than a stack of
//! pictures.
//!
//! | module | what it holds |
//! |---|---|
//! | [`options`] | what can be asked for, and the systems by name |
//! | [`update`], [`model_losses`] | one update, and what may stand beside the critics' loss |
//! | [`checkpoint`] | a learner on disk |

pub mod checkpoint;
pub mod model_losses;
pub mod options;
pub mod update;

#[cfg(test)]
mod tests;
