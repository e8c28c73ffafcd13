//! Same state, other distractor: same latent? The numbers of a grid, which nobody else gives.
//!
//! In: a table whose rows lie on a grid of state trajectories × distractor trajectories. Out: how much of the latents' variance the state explains, how
//! much the distractor and how much both together ([`variance()`]); how often a latent's nearest is of the same state ([`retrieval_same_step`],
//! [`retrieval_any_step`]); and how much farther other states are than other views of the same ([`denoising_factor`]). Every interval is over states
//! and distractors.
//!
//! On a grid every cell of a row shares its actions, so an encoder that sees only actions scores well: put the
//! action-only control beside all numbers (its latents are just another table).

mod denoising;
mod grid;
mod holes;
mod retrieval;
mod variance;

pub use denoising::denoising_factor;
pub use grid::{Dropped, Grid};
pub use retrieval::{Retrieval, RetrievalOptions, retrieval_any_step, retrieval_same_step};
pub use variance::{NoiseShares, StepShares, VarianceSplit, variance};

#[cfg(test)]
mod tests;
