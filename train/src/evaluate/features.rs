//! The tables that are read: what a model makes of every row, by name. In: a model and rows. Out: one table of features a name.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use vibes_model::parameters::to_values;
use vibes_model::trained::TrainedEncoder;
use vibes_model::{Model, scale};

use super::{Features, Rows};
use crate::encode::encode_rows;
use crate::error::Result;

/// Rows encoded at a time.
const CHUNK: usize = 128;

/// The tables of features of all rows, the latents first, and alone where there is no world model; none of no rows. `go_on` is asked before every episode.
///
/// # Errors
/// The observations are not the encoder's, or what `go_on` says.
pub fn features(
    encoder: TrainedEncoder<'_>,
    rows: &Rows,
    device: &Device,
    go_on: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<Features>> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let latents = latents(encoder, rows, device, go_on)?;
    let TrainedEncoder::World(model) = encoder else { return Ok(vec![latents]) };
    let states = states(model, rows, &latents, device);
    let both = beside(&latents, &states);
    Ok(vec![latents, states, both])
}

/// The dynamics' hidden states before each row's action is consumed, zeros at an episode's first row: what stands beside the latent for whoever acts.
fn states(model: &Model, rows: &Rows, latents: &Features, device: &Device) -> Features {
    let (config, device) = (&model.config, device.clone().inner());
    let gru = model.world.valid().dynamics.gru;
    let mut values = Vec::with_capacity(rows.views().iter().map(|view| view.rows() * config.hidden).sum());
    let mut first = 0;
    for view in rows.views() {
        let steps = view.steps();
        let mut actions = view.actions();
        scale::actions(&mut actions, &config.action_min, &config.action_max);
        let seen = &latents.values[first * latents.dims..(first + steps) * latents.dims];
        let tensor =
            |values: Vec<f32>, width| Tensor::<3>::from_data(TensorData::new(values, [steps, 1, width]), &device);
        let inputs = Tensor::cat(vec![tensor(seen.to_vec(), latents.dims), tensor(actions, config.actions())], 2);
        values.extend(std::iter::repeat_n(0.0, config.hidden));
        values.extend(to_values(gru.forward(inputs, None)));
        first += view.rows();
    }
    Features { name: "h", dims: config.hidden, values }
}

/// Both, side by side.
fn beside(latents: &Features, states: &Features) -> Features {
    let pairs = latents.values.chunks_exact(latents.dims).zip(states.values.chunks_exact(states.dims));
    let values = pairs.flat_map(|(latent, state)| state.iter().chain(latent)).copied().collect();
    Features { name: "hs", dims: latents.dims + states.dims, values }
}

/// The latents of all rows.
fn latents(
    encoder: TrainedEncoder<'_>,
    rows: &Rows,
    device: &Device,
    go_on: &mut dyn FnMut() -> Result<()>,
) -> Result<Features> {
    let mut values = Vec::new();
    let mut latents = encoder.episode(device);
    for view in rows.views() {
        go_on()?;
        latents.reset();
        for start in (0..view.rows()).step_by(CHUNK) {
            values.extend(encode_rows(encoder, &mut latents, view, start..view.rows().min(start + CHUNK))?);
        }
        view.release();
    }
    Ok(Features { name: "s", dims: encoder.latent(), values })
}
