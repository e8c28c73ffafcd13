//! Same state, other distractor: same latent? The grid's two numbers, which nobody else gives.
//!
//! In: a table whose rows lie on a grid of state trajectories × distractor trajectories. Out: how much of the latents' variance the
//! state explains, how much the distractor and how much both together ([`variance()`]); and how often a latent's nearest
//! among those seen under other distractors is of the same state ([`retrieval()`]); each with a 95% interval over state trajectories.
//!
//! On a grid every cell of a row shares its actions, so an encoder that sees only actions scores well: put the
//! action-only control beside both numbers (its latents are just another table).

mod grid;
mod retrieval;
mod variance;

pub use grid::{Dropped, Grid};
pub use retrieval::{Retrieval, RetrievalOptions, retrieval, retrieval_at_step};
pub use variance::{StepShares, VarianceSplit, variance};

#[cfg(test)]
mod tests;
