//! What a latent shows: a picture decoder fitted on frozen latents, which the encoder never learns from.
//!
//! In: a trained model, a recording to fit on, and a recording to show. Out: the decoder, and strips of pictures ([`Decoded`]): the frame, what the
//! decoder draws of the row's state (h, s), and what it draws of the states that the dynamics predict from one row on under the recorded actions. A
//! decoder can draw no more than the state holds: of what the state leaves out it learns to draw the mean.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::seq::{SliceRandom as _, index};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Decoded, DecodedRow, EpisodeView, Recording, relative_place};
use vibes_measure::r_squared::{Squares, together};
use vibes_model::decoder::Decoder;
use vibes_model::dynamics::Dynamics;
use vibes_model::kernels::pixel_tensor;
use vibes_model::observe::Frames;
use vibes_model::parameters::{read_parameters, to_values};
use vibes_model::trained::TrainedEncoder;
use vibes_model::{Model, ModelConfig, ObservationKind, scale};

use crate::encode::{check_fit, encode_rows, folder_of};
use crate::error::{Result, TrainError};
use crate::learners::optimizer::{NamedGradients, Optimizer};

/// How the decoder is fitted and what is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecodeOptions {
    /// Updates of the decoder.
    pub updates: u64,
    /// Rows an update.
    pub batch: usize,
    /// Adam's learning rate.
    pub learning_rate: f64,
    /// Strips to draw.
    pub strips: usize,
    /// Steps of the open-loop prediction.
    pub horizon: usize,
    /// Steps before it begins.
    pub context: usize,
    /// Most rows to fit on; of a larger recording this many are drawn.
    pub rows: usize,
    /// Seed of weights and rows.
    pub seed: u64,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        let (updates, batch, learning_rate) = (2000, 64, 1e-3);
        Self { updates, batch, learning_rate, strips: 6, horizon: 15, context: 3, rows: 40_000, seed: 0 }
    }
}

/// A fitted decoder with its strips.
#[derive(Debug)]
pub struct Decoding {
    /// The decoder of (h, s).
    pub decoder: Decoder,
    /// What it draws.
    pub decoded: Decoded,
    /// Mean squared error a pixel while fitting: over the first and over the last tenth of the updates, values between 0 and 1.
    pub errors: (f64, f64),
}

/// States of an episode: `h_t` before row t's action is taken, and the posterior mean `s_t`.
struct States {
    /// `[rows, hidden]`
    hidden: Vec<f32>,
    /// `[rows, latent]`
    latent: Vec<f32>,
}

/// Fits a decoder on `fit` and draws strips of `show`; `listen` gets the updates made.
///
/// # Errors
/// The recordings do not fit the model, hold no pictures, or the loss is no longer a number.
pub fn decode(
    model: &Model,
    checkpoint: &Path,
    fit: &Recording,
    show: &Recording,
    output: &Path,
    options: DecodeOptions,
    device: &Device,
    listen: &mut dyn FnMut(u64),
) -> Result<Decoding> {
    for recording in [fit, show] {
        check_fit(model.into(), recording)?;
    }
    let ObservationKind::Pixels { height, width } = model.config.observation else {
        return Err(TrainError::OtherRecording {
            found: "vector observations".into(),
            wanted: "pictures: a decoder draws them".into(),
            path: fit.path().into(),
        });
    };
    let strips = strips(show, options);
    if strips.is_empty() {
        let rows = options.context.saturating_add(options.horizon).saturating_add(1);
        return Err(TrainError::OtherRecording {
            found: "no episode that is long enough to be shown".to_owned(),
            wanted: format!("one of {rows} rows at least (a few before, and --horizon)"),
            path: show.path().to_owned(),
        });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let (decoder, errors) = fit_decoder(model, fit, options, device, &mut rng, listen)?;
    let painter = Painter { decoder: decoder.valid(), device: device.clone().inner() };
    let (mut rows, mut explained) = (Vec::new(), Explained::default());
    for (strip, (episode, start)) in strips.into_iter().enumerate() {
        let view = show.episode(episode)?;
        let states = states(model, &view, device)?;
        let strip = Strip { number: strip as u32, start, options };
        rows.extend(strip.draw(model, &painter, &view, &states, &mut explained)?);
    }
    let decoded = Decoded {
        size: (height as u32, width as u32),
        rows,
        recording: Some(relative_place(show.path(), folder_of(output))),
        checkpoint: Some(relative_place(checkpoint, folder_of(output))),
        objective: None,
        explained: explained.share(),
    };
    Ok(Decoding { decoder, decoded, errors })
}

/// The model's sizes with the width of (h, s) in place of the latent's, which is what the decoder takes.
fn decoder_config(config: &ModelConfig) -> ModelConfig {
    ModelConfig { latent: config.hidden + config.latent, ..config.clone() }
}

/// The states of a whole episode, the model's weights fixed.
fn states(model: &Model, episode: &EpisodeView, device: &Device) -> Result<States> {
    let device = &device.clone().inner();
    let encoder = TrainedEncoder::World(model);
    let rows = episode.rows();
    let latent = encode_rows(encoder, &mut encoder.episode(device), episode, 0..rows)?;
    let (dims, wide) = (model.config.latent, model.config.hidden);
    let mut hidden = vec![0.0; wide];
    if rows > 1 {
        let dynamics = model.world.dynamics.valid();
        let latents = tensor(latent[..(rows - 1) * dims].to_vec(), [rows - 1, 1, dims], device);
        let (_, after) = dynamics.forward(latents, actions(model, episode, 0..rows - 1, device), None);
        hidden.extend(to_values(after));
    }
    Ok(States { hidden, latent })
}

fn tensor(values: Vec<f32>, shape: [usize; 3], device: &Device) -> Tensor<3> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// Scaled actions of some rows, `[rows, 1, A]`.
fn actions(model: &Model, episode: &EpisodeView, rows: std::ops::Range<usize>, device: &Device) -> Tensor<3> {
    let count = rows.len();
    let mut values: Vec<f32> = rows.flat_map(|row| episode.action(row)).copied().collect();
    scale::actions(&mut values, &model.config.action_min, &model.config.action_max);
    tensor(values, [count, 1, model.config.actions()], device)
}

impl States {
    /// (h, s) of a row.
    fn row(&self, row: usize, hidden: usize, latent: usize) -> impl Iterator<Item = f32> + '_ {
        let h = &self.hidden[row * hidden..(row + 1) * hidden];
        h.iter().chain(&self.latent[row * latent..(row + 1) * latent]).copied()
    }
}

/// Rows to fit on: their states `[rows, hidden + latent]` and pixels `[rows, height, width, 3]`.
struct Samples {
    width: usize,
    states: Vec<f32>,
    places: Vec<(u32, usize)>,
}

impl Samples {
    fn gather(model: &Model, recording: &Recording, most: usize, device: &Device, rng: &mut impl Rng) -> Result<Self> {
        let (hidden, latent) = (model.config.hidden, model.config.latent);
        let mut samples = Self { width: hidden + latent, states: Vec::new(), places: Vec::new() };
        let all: usize = recording.episodes().iter().map(|e| e.steps as usize + 1).sum();
        for entry in recording.episodes() {
            let view = recording.episode(entry.index)?;
            let states = states(model, &view, device)?;
            let share = view.rows() * most / all.max(1);
            let mut rows: Vec<usize> = (0..view.rows()).collect();
            if all > most {
                rows = index::sample(rng, view.rows(), share.clamp(1, view.rows())).into_vec();
            }
            for row in rows {
                samples.states.extend(states.row(row, hidden, latent));
                samples.places.push((entry.index, row));
            }
            view.release();
        }
        Ok(samples)
    }
}

/// Fits a decoder by the squared error of its pictures.
fn fit_decoder(
    model: &Model,
    recording: &Recording,
    options: DecodeOptions,
    device: &Device,
    rng: &mut ChaCha8Rng,
    listen: &mut dyn FnMut(u64),
) -> Result<(Decoder, (f64, f64))> {
    let samples = Samples::gather(model, recording, options.rows, device, rng)?;
    let ObservationKind::Pixels { height, width } = model.config.observation else {
        return Err(TrainError::Options("a decoder draws pictures; this model sees vectors".into()));
    };
    let views = recording.episodes().iter().map(|entry| Ok((entry.index, recording.episode(entry.index)?)));
    let views = views.collect::<Result<std::collections::BTreeMap<u32, EpisodeView>>>()?;
    let device = &device.clone().autodiff();
    let mut decoder = Decoder::init(&decoder_config(&model.config), rng, device)?.train();
    let mut optimizer = Optimizer::new(1e-8);
    let mut order: Vec<usize> = Vec::new();
    let mut errors = Vec::new();
    for update in 0..options.updates {
        if order.len() < options.batch {
            let mut more: Vec<usize> = (0..samples.places.len()).collect();
            more.shuffle(rng);
            order.extend(more);
        }
        let rows: Vec<usize> = order.drain(..options.batch.min(order.len())).collect();
        let states = rows.iter().flat_map(|&row| &samples.states[row * samples.width..(row + 1) * samples.width]);
        let states = tensor(states.copied().collect(), [1, rows.len(), samples.width], device);
        let pixels = rows.iter().map(|&row| samples.places[row]).flat_map(|(episode, row)| views[&episode].pixels(row));
        let pixels = pixel_tensor(pixels.copied().collect(), [rows.len(), height, width, 3], device);
        // The log-density is minus half the squared error of a whole picture.
        let loss = decoder.log_prob(Frames::Pixels(pixels), states)?.mean().neg();
        let value = f64::from(loss.clone().into_scalar::<f32>()) * 2.0 / (height * width * 3) as f64;
        if !value.is_finite() {
            return Err(TrainError::Options(format!("the decoder's error is no longer a number at update {update}")));
        }
        errors.push(value);
        let mut gradients = loss.backward();
        let gradients = NamedGradients::take(&decoder, &mut gradients);
        // The rate falls to a tenth, so that the last pictures do not shake.
        let rate = options.learning_rate * 0.1_f64.powf(update as f64 / options.updates.max(1) as f64);
        decoder = optimizer.step(decoder, gradients, rate, 100.0);
        listen(update + 1);
    }
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    let tenth = (errors.len() / 10).max(1).min(errors.len());
    Ok((decoder, (mean(&errors[..tenth]), mean(&errors[errors.len() - tenth..]))))
}

/// The episodes to show and where prediction begins: episodes spread over the recording, a third of the way in. They follow from the recording alone, so
/// that several runs show the same rows.
fn strips(recording: &Recording, options: DecodeOptions) -> Vec<(u32, usize)> {
    let needed = options.context.saturating_add(options.horizon).saturating_add(1);
    let long: Vec<_> = recording.episodes().iter().filter(|entry| entry.steps as usize + 1 >= needed).collect();
    let count = options.strips.min(long.len());
    let entries = (0..count).map(|i| long[i * long.len() / count]);
    let start = |steps: usize| (steps / 3).clamp(options.context, steps - options.horizon);
    entries.map(|entry| (entry.index, start(entry.steps as usize))).collect()
}

/// Draws states.
struct Painter {
    decoder: Decoder,
    device: Device,
}

impl Painter {
    /// Pictures of states `[rows, hidden + latent]`.
    fn draw(&self, states: Vec<f32>, width: usize) -> Result<Vec<Vec<u8>>> {
        let rows = states.len() / width.max(1);
        let Some(decoder) = &self.decoder.picture else {
            return Err(TrainError::Options("a decoder draws pictures; this model sees vectors".into()));
        };
        let states = Tensor::<2>::from_data(TensorData::new(states, [rows, width]), &self.device);
        let pictures = to_values(decoder.forward(states));
        let byte = |value: &f32| ((value + 0.5) * 255.0).round().clamp(0.0, 255.0) as u8;
        Ok(pictures.chunks(pictures.len() / rows.max(1)).map(|picture| picture.iter().map(byte).collect()).collect())
    }
}

/// One strip: a few rows before the start, and the horizon after it.
struct Strip {
    number: u32,
    start: usize,
    options: DecodeOptions,
}

impl Strip {
    fn draw(
        &self,
        model: &Model,
        painter: &Painter,
        episode: &EpisodeView,
        states: &States,
        explained: &mut Explained,
    ) -> Result<Vec<DecodedRow>> {
        let (hidden, latent) = (model.config.hidden, model.config.latent);
        let rows = self.start - self.options.context..self.start + self.options.horizon + 1;
        let all = rows.clone().flat_map(|row| states.row(row, hidden, latent)).collect();
        let shown = painter.draw(all, hidden + latent)?;
        let predicted = painter.draw(self.predict(model, episode, states, &painter.device), hidden + latent)?;
        let row = |(i, row): (usize, usize)| DecodedRow {
            strip: self.number,
            episode: episode.index(),
            step: row as u32,
            start: self.start as u32,
            recorded: episode.pixels(row).to_vec(),
            shown: shown[i].clone(),
            predicted: row.checked_sub(self.start).and_then(|ahead| predicted.get(ahead)).cloned(),
        };
        let rows: Vec<DecodedRow> = rows.enumerate().map(row).collect();
        rows.iter().for_each(|row| explained.add(&row.recorded, &row.shown));
        Ok(rows)
    }

    /// States from `start` on that see no frame after it: `[horizon + 1, hidden + latent]`.
    fn predict(&self, model: &Model, episode: &EpisodeView, states: &States, device: &Device) -> Vec<f32> {
        let (hidden, latent) = (model.config.hidden, model.config.latent);
        let dynamics: Dynamics = model.world.dynamics.valid();
        let mut all: Vec<f32> = states.row(self.start, hidden, latent).collect();
        let mut h = Tensor::<2>::from_data(TensorData::new(all[..hidden].to_vec(), [1, hidden]), device);
        let mut s = tensor(all[hidden..].to_vec(), [1, 1, latent], device);
        for row in self.start..self.start + self.options.horizon {
            let (next, after) = dynamics.forward(s, actions(model, episode, row..row + 1, device), Some(h));
            all.extend(to_values(after.clone()));
            all.extend(to_values(next.mean.clone()));
            h = after.reshape([1, hidden]);
            s = next.mean;
        }
        all
    }
}

/// Share of the pixels' variance that pictures explain: R² of all pixels of all strips together, each about its own mean.
#[derive(Debug, Default)]
struct Explained {
    /// Of every pixel's channels.
    pixels: Vec<Squares>,
}

impl Explained {
    fn add(&mut self, recorded: &[u8], shown: &[u8]) {
        self.pixels.resize(recorded.len(), Squares::default());
        let pairs = recorded.iter().zip(shown).map(|(&recorded, &shown)| (f64::from(recorded), f64::from(shown)));
        self.pixels.iter_mut().zip(pairs).for_each(|(pixel, (recorded, shown))| pixel.add(recorded, shown));
    }

    /// None where no pixel varies.
    fn share(&self) -> Option<f64> {
        Some(together(&self.pixels)).filter(|share| share.is_finite())
    }
}

/// The decoder's weights by name, to be saved.
#[must_use]
pub fn decoder_tensors(decoder: &Decoder) -> vibes_model::parameters::HostTensors {
    read_parameters(decoder, "decoder")
}
