//! The figures, one file each: plain numbers and pictures in, a [`Picture`] out, and the one place that writes them as PNG and SVG.
//!
//! A new figure is a file beside the others, with a struct of what it shows and a `draw`, and a variant of [`Figure`]; the laws in
//! `figures/tests.rs` then hold for it without a new test.

mod axes;
mod bars;
mod coloring;
mod colors;
mod curves;
mod heading;
mod legend;
mod map;
mod neighbour_sheet;
mod panels;
mod probe_chart;
mod strips;
mod table;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

pub use bars::{Bar, BarGroup, Bars};
pub use coloring::Coloring;
pub use curves::{Curve, Curves, Facet};
pub use heading::Heading;
pub use map::Map;
pub use neighbour_sheet::{NeighbourSheet, SheetColumn, Thumb};
pub use panels::{Panel, Panels};
pub use probe_chart::{ProbeChart, ProbeMark, ProbeRow};
pub use strips::{Strip, StripLine, Strips};
pub use table::{Entry, Table};

use crate::picture::encode::encode_png;
use crate::picture::{Picture, png, svg};

/// Every figure that the analyzer can draw.
#[derive(Clone, Debug)]
pub enum Figure {
    /// Queries above their neighbours (Figures 4b and 5 of the paper).
    NeighbourSheet(NeighbourSheet),
    /// All rows as points in the plane.
    Map(Map),
    /// State trajectories × distractor trajectories on one map (Figure 4a).
    Panels(Panels),
    /// Numbers with intervals.
    Bars(Bars),
    /// What can be read from the latent, against controls.
    ProbeChart(ProbeChart),
    /// Metrics over training (Figure 3).
    Curves(Curves),
    /// What latents show of pictures, over time.
    Strips(Strips),
    /// Numbers with intervals in rows and columns (Table 1).
    Table(Table),
}

impl Figure {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Picture {
        match self {
            Self::NeighbourSheet(figure) => figure.draw(),
            Self::Map(figure) => figure.draw(),
            Self::Panels(figure) => figure.draw(),
            Self::Bars(figure) => figure.draw(),
            Self::ProbeChart(figure) => figure.draw(),
            Self::Curves(figure) => figure.draw(),
            Self::Strips(figure) => figure.draw(),
            Self::Table(figure) => figure.draw(),
        }
    }

    /// Writes the figure into a folder as `STEM.png` (300 pixels an inch) and `STEM.svg` and returns both paths.
    ///
    /// # Errors
    /// [`FigureError`] if the folder cannot be written or the figure is too large for an image.
    pub fn save(&self, folder: &Path, stem: &str) -> Result<Vec<PathBuf>, FigureError> {
        let picture = self.draw();
        let (svg_path, png_path) = (folder.join(format!("{stem}.svg")), folder.join(format!("{stem}.png")));
        let pixels = png::rasterize(&picture, png::DPI).ok_or_else(|| FigureError::Size {
            width: picture.width / 72.0,
            height: picture.height / 72.0,
            path: png_path.clone(),
        })?;
        let bytes = encode_png(&pixels).map_err(|cause| FigureError::Encode { cause, path: png_path.clone() })?;
        vibes_data::write_atomically(&png_path, &bytes)?;
        vibes_data::write_atomically(&svg_path, svg::render(&picture).as_bytes())?;
        Ok(vec![png_path, svg_path])
    }
}

/// Why a figure could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The figure would have no pixels or too many.
    #[error("a figure of {width:.1} by {height:.1} inches is too large to draw; show less in one figure: {path}")]
    Size {
        /// Width in inches.
        width: f64,
        /// Height in inches.
        height: f64,
        /// The file it should have become.
        path: PathBuf,
    },
    /// The PNG encoder refused.
    #[error("cannot encode the figure: {cause}: {path}")]
    Encode {
        /// The encoder's answer.
        cause: image::ImageError,
        /// The file it should have become.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] vibes_data::Error),
}
