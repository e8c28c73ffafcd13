//! The measures: one definition of every number that the toolkit prints. Neighbours, retrieval, variance shares, probes, symmetry, maps and
//! the intervals beside them.
//!
//! In: plain arrays, as a [`Table`] of latents with the key of every row. Out: plain values. Nothing here reads or writes a file.

mod error;
mod left_out;
mod table;

pub mod clusters;
pub mod episodes;
pub mod intervals;
pub mod invariance;
pub mod neighbours;
pub mod numbers;
pub mod past_actions;
pub mod pca;
pub mod probes;
pub mod quality;
pub mod r_squared;
pub mod returns;
pub mod spectrum;
pub mod state_error;
pub mod symmetry;
pub mod tsne;
pub mod umap;

pub use error::Error;
pub use table::Table;
