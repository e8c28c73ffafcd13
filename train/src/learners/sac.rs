//! Soft actor-critic from pixels and its family: what is shared by the systems that learn without a world model.
//!
//! | module | what it holds |
//! |---|---|
//! | [`options`] | what can be asked for, and the systems by name |
//! | [`augment`] | random crops and shifts |
//! | [`transitions`] | stacks before and after an action, drawn from windows |

pub mod augment;
pub mod options;
pub mod transitions;
