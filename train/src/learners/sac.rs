//! Soft actor-critic from pixels and its family: what is shared by the systems that learn without a world model.
//!
//! | module | what it holds |
//! |---|---|
//! | [`options`] | what can be asked for, and the systems by name |
//! | [`augment`] | random crops and shifts |
//! | [`update`], [`auxiliary`] | one update, and what may stand beside the critics' loss |
//! | [`checkpoint`] | a learner on disk |
//! | [`mod@bench`] | how long an update takes |
//! | [`transitions`] | stacks before and after an action, drawn from windows |

pub mod augment;
pub mod auxiliary;
pub mod bench;
pub mod checkpoint;
pub mod options;
pub mod transitions;
pub mod update;

#[cfg(test)]
mod tests;
