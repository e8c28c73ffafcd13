//! Looking into a latent space: neighbours, maps, invariance, probes, and the figures that show them.
//!
//! In: a table of latents (`latents.arrow`, or anyone's) and the recording it was encoded from. Out: figures, and the
//! numbers beside them. The modules that measure take a [`vibes_measure::Table`] and give plain values; they read and write no files.

pub mod actions;
pub mod cli;
pub mod curves;
pub mod figures;
pub mod input;
pub mod metrics;
mod natural;
pub mod output;
pub mod picture;
pub mod report;
pub mod scene;
pub mod scores;
