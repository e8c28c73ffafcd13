//! The tables that are read: what a model makes of every row, by name. In: a model and rows. Out: one table of features a name.

use burn::tensor::Device;
use vibes_model::Model;
use vibes_model::encode::EpisodeEncoder;

use super::Rows;
use crate::encode::encode_rows;
use crate::error::Result;

/// Rows encoded at a time.
const CHUNK: usize = 128;

/// One table of features, `[rows, dims]`, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// `s` for the latents, `h` for the recurrent state before the row's action, `hs` for both.
    pub name: &'static str,
    /// Numbers a row.
    pub dims: usize,
    /// The values.
    pub values: Vec<f32>,
}

/// The tables of features of all rows, the latents first; none of no rows.
///
/// # Errors
/// The observations are not the model's.
pub fn features(model: &Model, rows: &Rows, device: &Device) -> Result<Vec<Features>> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    Ok(vec![latents(model, rows, device)?])
}

/// The posterior means of all rows.
fn latents(model: &Model, rows: &Rows, device: &Device) -> Result<Features> {
    let mut values = Vec::new();
    let mut encoder = EpisodeEncoder::new(model, device);
    for view in rows.views() {
        encoder.reset();
        for start in (0..view.rows()).step_by(CHUNK) {
            values.extend(encode_rows(model, &mut encoder, view, start..view.rows().min(start + CHUNK))?);
        }
        view.release();
    }
    Ok(Features { name: "s", dims: model.config.latent, values })
}
