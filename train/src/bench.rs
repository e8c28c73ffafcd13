//! How long an update takes, and of what: on made-up windows of given sizes, beside the machine's matrix product. In: options. Out: milliseconds by part.

use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{ActionSpec, ImageSize, ObservationPart, Spec, WindowBatch};
use vibes_model::{Model, ObservationKind};

use crate::batch::Batch;
use crate::error::Result;
use crate::options::Options;
use crate::update::Learner;

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
    /// Bytes to tensors.
    pub batch_ms: f64,
    /// Forward pass of the encoder's picture network alone.
    pub cnn_forward_ms: f64,
    /// Forward and backward pass of that network.
    pub cnn_both_ms: f64,
    /// Forward and backward pass of the encoder's GRU.
    pub gru_both_ms: f64,
    /// Floating-point operations of all convolutions of an update, in units of 10⁹.
    pub convolution_gflop: f64,
    /// Those operations over a whole update's time.
    pub convolution_gflops: f64,
    /// This machine's product of two 1024×1024 matrices.
    pub matrix_product_gflops: f64,
}

/// Times updates of these options on made-up windows.
///
/// # Errors
/// The picture is too small for the network.
pub fn bench(options: &Options, sizes: Sizes, device: &Device) -> Result<Report> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let observation = ObservationKind::Pixels { height: sizes.picture, width: sizes.picture };
    let config = options.model(&made_up_spec(sizes), observation);
    let mut learner = Learner::new(Model::init(config, &mut rng, device)?, options, device);
    let windows = made_up_windows(options, sizes, &mut rng);
    let autodiff = device.clone().autodiff();
    let mut batch_times = Vec::new();
    let mut update_times = Vec::new();
    for _ in 0..=sizes.repeats {
        let begun = Instant::now();
        let batch = Batch::new(&windows, &learner.model.config, options.burn_in, &autodiff)?;
        batch_times.push(ms(begun));
        let begun = Instant::now();
        learner = learner.update(&batch, options.weights(u64::MAX), options, &mut rng)?.0;
        update_times.push(ms(begun));
    }
    // The first update also allocates.
    let update_ms = median(&mut update_times[1..]);
    let batch = Batch::new(&windows, &learner.model.config, options.burn_in, &autodiff)?;
    let (cnn_forward_ms, cnn_both_ms, gru_both_ms) = parts(&learner, &batch, sizes.repeats)?;
    let convolution_gflop = convolution_gflop(options, sizes, learner.model.adversary.is_some());
    Ok(Report {
        update_ms,
        batch_ms: median(&mut batch_times[1..]),
        cnn_forward_ms,
        cnn_both_ms,
        gru_both_ms,
        convolution_gflop,
        convolution_gflops: convolution_gflop / update_ms * 1e3,
        matrix_product_gflops: matrix_product_gflops(device, sizes.repeats),
    })
}

fn parts(learner: &Learner, batch: &Batch, repeats: usize) -> Result<(f64, f64, f64)> {
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
    Ok((median(&mut forward[1..]), median(&mut both[1..]), median(&mut gru[1..])))
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
    2.0 * (SIDE as f64).powi(3) / median(&mut times[1..]) / 1e6
}

/// Forward, weight gradient, and (but for the pixels) input gradient of every convolution, for the encoder and the adversary.
fn convolution_gflop(options: &Options, sizes: Sizes, adversary: bool) -> f64 {
    let (mut side, mut input, mut per_frame) = (sizes.picture, 3, 0.0);
    for layer in 0..4 {
        if side < 4 {
            break;
        }
        side = (side - 4) / 2 + 1;
        let output = options.depth << layer;
        let passes = if layer == 0 { 2.0 } else { 3.0 };
        per_frame += passes * 2.0 * (side * side * 16 * input * output) as f64;
        input = output;
    }
    let frames = options.batch * (options.length + if adversary { options.length - 1 } else { 0 });
    per_frame * frames as f64 / 1e9
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
    }
}

pub(crate) fn made_up_windows(options: &Options, sizes: Sizes, rng: &mut impl Rng) -> WindowBatch {
    let rows = options.length * options.batch;
    let mut actions = || (0..rows * sizes.actions).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f32>>();
    let (actions, previous_actions) = (actions(), actions());
    WindowBatch {
        length: options.length,
        batch: options.batch,
        pixels: (0..rows * sizes.picture * sizes.picture * 3).map(|_| rng.random()).collect(),
        observations: vec![0.0; rows],
        actions,
        previous_actions,
        rewards: (0..rows).map(|_| rng.random()).collect(),
        is_first: vec![false; rows],
        starts: vec![(0, 1); options.batch],
    }
}

fn ms(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}
