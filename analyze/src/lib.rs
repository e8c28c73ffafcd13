//! Looking into a latent space: neighbours, maps, invariance, probes, and the figures that show them.
//!
//! In: a table of latents (`latents.arrow`, or anyone's) and the recording it was encoded from. Out: figures, and the
//! numbers beside them. The modules that measure take a [`Table`] and give plain values; they read and write no files.

mod error;
mod table;

pub mod actions;
pub mod cli;
pub mod curves;
pub mod figures;
pub mod input;
pub mod intervals;
pub mod invariance;
pub mod neighbours;
pub mod output;
pub mod pca;
pub mod picture;
pub mod probes;
pub mod quality;
pub mod report;
pub mod scene;
pub mod state_error;
pub mod symmetry;
pub mod tsne;
pub mod umap;

pub use error::Error;
pub use table::Table;
