//! How long an update takes, and of what: on made-up windows of given sizes, beside the machine's matrix product. In: options. Out: milliseconds by part.

use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{ActionSpec, ImageSize, ObservationPart, Recording, Spec, WindowBatch};
use vibes_model::{Model, ObservationKind};

use crate::batch::Batch;
use crate::error::Result;
use crate::learners::world::{Learner, Phases};
use crate::options::Options;
use crate::windows::Windows;

mod agent;
mod end_to_end;
mod online;

pub use agent::bench_agent;
pub use end_to_end::EndToEnd;
pub use online::{OnlineReport, bench_online};

/// Sizes of what is made up.
#[derive(Debug, Clone, Copy)]
pub struct Sizes {
    /// Height and width of the pictures.
    pub picture: usize,
    /// Values of an action.
    pub actions: usize,
    /// Updates to time; the median counts.
    pub repeats: usize,
}

/// What was measured; medians, in milliseconds.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// One whole update.
    pub update_ms: f64,
    /// Its parts, in order.
    pub parts: Vec<Part>,
    /// Bytes to tensors, before every update.
    pub batch_ms: f64,
    /// Floating-point operations of all convolutions of an update, in units of 10⁹.
    pub convolution_gflop: f64,
    /// Those operations over a whole update's time.
    pub convolution_gflops: f64,
    /// This machine's product of two 1024×1024 matrices.
    pub matrix_product_gflops: f64,
    /// Gathering the windows of a batch from a recording, in 10⁹ bytes a second.
    pub sampling_gigabytes_per_second: Option<f64>,
}

/// A part of an update, or of what it is made of.
#[derive(Debug, Clone, Serialize)]
pub struct Part {
    /// What.
    pub name: &'static str,
    /// How long.
    pub ms: f64,
}

/// Times updates of these options on made-up windows, and the gathering of windows from a recording if one is given.
///
/// # Errors
/// The picture is too small for the network, or the recording has no episode as long as a window.
pub fn bench(options: &Options, sizes: Sizes, recording: Option<&Recording>, device: &Device) -> Result<Report> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let observation = ObservationKind::Pixels { height: sizes.picture, width: sizes.picture };
    let config = options.model(&made_up_spec(sizes), observation, 1.0);
    let mut learner = Learner::new(Model::init(config, &mut rng, device)?, options, device);
    let windows = made_up_windows(options, sizes, &mut rng);
    let autodiff = device.clone().autodiff();
    let (mut batch_times, mut update_times, mut phases) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..=sizes.repeats {
        let begun = Instant::now();
        let batch = Batch::new(&windows, &learner.model.config, options.burn_in, &autodiff)?;
        batch_times.push(ms(begun));
        let begun = Instant::now();
        let (next, measures) =
            learner.update(&batch, options.schedule(u64::MAX, Some(0)), options.parts(), &mut rng)?;
        learner = next;
        update_times.push(ms(begun));
        phases.push(measures.phases);
    }
    let update_ms = median(&update_times);
    let batch = Batch::new(&windows, &learner.model.config, options.burn_in, &autodiff)?;
    let mut parts = phase_parts(&phases);
    parts.extend(layer_parts(&learner, &batch, sizes.repeats)?);
    let convolution_gflop = convolution_gflop(options, sizes);
    Ok(Report {
        update_ms,
        parts,
        batch_ms: median(&batch_times),
        convolution_gflop,
        convolution_gflops: convolution_gflop / update_ms * 1e3,
        matrix_product_gflops: matrix_product_gflops(device, sizes.repeats),
        sampling_gigabytes_per_second: recording.map(|recording| sampling(options, recording, &mut rng)).transpose()?,
    })
}

fn phase_parts(phases: &[Phases]) -> Vec<Part> {
    let part = |name, of: fn(&Phases) -> f64| Part { name, ms: median(&phases.iter().map(of).collect::<Vec<_>>()) };
    vec![
        part("encoder, dynamics, reward", |phases| phases.predict),
        part("objective and adversary's step", |phases| phases.objective),
        part("auxiliary terms", |phases| phases.auxiliary),
        part("backward", |phases| phases.backward),
        part("norms and Adam", |phases| phases.step),
    ]
}

/// The encoder's layers by themselves.
fn layer_parts(learner: &Learner, batch: &Batch, repeats: usize) -> Result<Vec<Part>> {
    let encoder = &learner.model.world.encoder;
    let plain = encoder.valid();
    let (mut forward, mut both, mut gru) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..=repeats {
        let begun = Instant::now();
        plain.observe.forward(batch.frames.clone(), batch.length)?.sum().into_scalar::<f32>();
        forward.push(ms(begun));
        let begun = Instant::now();
        let features = encoder.observe.forward(batch.frames.clone(), batch.length)?;
        drop(features.clone().sum().backward());
        both.push(ms(begun));
        let inputs = Tensor::cat(vec![features.detach(), batch.previous_actions.clone()], 2);
        let begun = Instant::now();
        drop(encoder.gru.forward(inputs, None).sum().backward());
        gru.push(ms(begun));
    }
    let part = |name, times: &[f64]| Part { name, ms: median(times) };
    Ok(vec![
        part("one CNN alone, forward", &forward),
        part("one CNN alone, both passes", &both),
        part("one GRU alone, both passes", &gru),
    ])
}

fn sampling(options: &Options, recording: &Recording, rng: &mut impl Rng) -> Result<f64> {
    let windows = Windows::new(std::slice::from_ref(recording), options.length, options.batch)?;
    let (begun, mut bytes) = (Instant::now(), 0);
    while begun.elapsed().as_secs_f64() < 0.5 {
        bytes += windows.sample(rng).pixels.len();
    }
    Ok(bytes as f64 / begun.elapsed().as_secs_f64() / 1e9)
}

fn matrix_product_gflops(device: &Device, repeats: usize) -> f64 {
    const SIDE: usize = 1024;
    let random = || Tensor::<2>::random([SIDE, SIDE], Distribution::Uniform(-1.0, 1.0), device);
    let (a, b) = (random(), random());
    let mut times = Vec::new();
    for _ in 0..=repeats {
        let begun = Instant::now();
        a.clone().matmul(b.clone()).sum().into_scalar::<f32>();
        times.push(ms(begun));
    }
    2.0 * (SIDE as f64).powi(3) / median(&times) / 1e6
}

/// Forward, weight gradient, and (but for the pixels) input gradient of every convolution, for the encoder, the adversary and the decoder.
fn convolution_gflop(options: &Options, sizes: Sizes) -> f64 {
    let (mut side, mut input, mut encode, mut decode) = (sizes.picture, 3, 0.0, 0.0);
    for layer in 0..4 {
        if side < 4 {
            break;
        }
        side = (side - 4) / 2 + 1;
        let output = options.depth << layer;
        let pass = 2.0 * (side * side * 16 * input * output) as f64;
        encode += pass * if layer == 0 { 2.0 } else { 3.0 };
        // The decoder's layer between the same two sizes, run the other way.
        decode += pass * 3.0;
        input = output;
    }
    let pictures = options.objective.pictures(options.length);
    let window = encode * pictures.encoded as f64 + decode * pictures.decoded as f64;
    window * options.batch as f64 / 1e9
}

pub(crate) fn made_up_spec(sizes: Sizes) -> Spec {
    let side = sizes.picture as u32;
    Spec {
        task: "made-up".to_owned(),
        action: ActionSpec { min: vec![-1.0; sizes.actions], max: vec![1.0; sizes.actions] },
        observation: vec![ObservationPart { name: "position".to_owned(), len: 1 }],
        qpos: 1,
        qvel: 1,
        pixels: Some(ImageSize { height: side, width: side }),
        materials: Vec::new(),
        control_timestep: 0.02,
        action_repeat: 1,
        quantities: Vec::new(),
    }
}

pub(crate) fn made_up_windows(options: &Options, sizes: Sizes, rng: &mut impl Rng) -> WindowBatch {
    made_up_windows_of([options.length, options.batch], sizes, rng)
}

/// So many rows a window, and so many windows.
pub(crate) fn made_up_windows_of([length, batch]: [usize; 2], sizes: Sizes, rng: &mut impl Rng) -> WindowBatch {
    let rows = length * batch;
    let mut actions = || (0..rows * sizes.actions).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f32>>();
    let (actions, previous_actions) = (actions(), actions());
    WindowBatch {
        length,
        batch,
        pixels: (0..rows * sizes.picture * sizes.picture * 3).map(|_| rng.random()).collect(),
        observations: vec![0.0; rows],
        actions,
        previous_actions,
        rewards: (0..rows).map(|_| rng.random()).collect(),
        is_first: vec![false; rows],
        starts: vec![(0, 1); batch],
    }
}

fn ms(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}

/// The median of all but the first, which also allocates.
fn median(times: &[f64]) -> f64 {
    median_of_all(times.get(1..).unwrap_or_default())
}

/// Of all values, the first too; NaN where there are none.
fn median_of_all(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
