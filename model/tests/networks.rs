//! The networks' shapes and laws: unit norms, the GRU against its formula step by step, what the adversary may see, and checkpoints.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod made_up;

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_model::encode::{EpisodeEncoder, RawFrames};
use vibes_model::gru::GruConfig;
use vibes_model::kernels::pixel_tensor;
use vibes_model::kernels::plain::elu;
use vibes_model::observe::Frames;
use vibes_model::parameters::{read_parameters, to_values};
use vibes_model::{Model, ModelError, ObservationKind};

use made_up::config;

const SIDE: usize = 20;

fn model(observation: ObservationKind) -> Model {
    Model::init(config(observation), &mut ChaCha8Rng::seed_from_u64(3), &Device::flex()).unwrap()
}

fn pixels() -> ObservationKind {
    ObservationKind::Pixels { height: SIDE, width: SIDE }
}

fn random_pixels(frames: usize, seed: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..frames * SIDE * SIDE * 3).map(|_| rng.random()).collect()
}

fn random(shape: [usize; 3], seed: u64) -> Tensor<3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let values = vibes_model::init::normal(shape.iter().product(), &mut rng);
    Tensor::from_data(TensorData::new(values, shape), &Device::flex())
}

fn frames(bytes: Vec<u8>) -> Frames {
    let count = bytes.len() / (SIDE * SIDE * 3);
    Frames::Pixels(pixel_tensor(bytes, [count, SIDE, SIDE, 3], &Device::flex()))
}

fn assert_close(a: &[f32], b: &[f32], tolerance: f32) {
    assert_eq!(a.len(), b.len());
    for (index, (a, b)) in a.iter().zip(b).enumerate() {
        assert!((a - b).abs() <= tolerance, "{index}: {a} {b}");
    }
}

fn assert_unit(values: &[f32], dims: usize) {
    for row in values.chunks(dims) {
        let norm: f32 = row.iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-4, "{norm}");
    }
}

#[test]
fn every_mean_of_a_latent_has_unit_norm_and_every_std_is_above_its_floor() {
    let model = model(pixels());
    let actions = random([5, 2, 2], 1);
    let encoding = model.world.encoder.forward(frames(random_pixels(10, 1)), actions.clone(), None).unwrap();
    assert_eq!(encoding.means.dims(), [5, 2, 6]);
    assert_eq!(encoding.state.dims(), [2, 24]);
    assert_unit(&to_values(encoding.means.clone()), 6);
    let (dynamics, states) = model.world.dynamics.forward(encoding.means.clone(), actions.clone(), None);
    assert_eq!((dynamics.mean.dims(), dynamics.std.dims(), states.dims()), ([5, 2, 6], [5, 2, 1], [5, 2, 24]));
    let adversary = model.adversary.unwrap();
    let features = adversary.observe.forward(frames(random_pixels(10, 1)), 5).unwrap();
    let prediction = adversary.forward(features, encoding.means.clone(), actions.clone());
    for gaussian in [&dynamics, &prediction] {
        assert_unit(&to_values(gaussian.mean.clone()), 6);
        assert!(to_values(gaussian.std.clone()).iter().all(|&std| std > 0.1));
    }
    let reward = model.world.reward.forward(encoding.means, actions);
    assert_eq!((reward.mean.dims(), reward.std.dims()), ([5, 2, 1], [5, 2, 1]));
}

#[test]
fn features_of_pictures_are_normalised() {
    let model = model(pixels());
    let features = model.world.encoder.observe.forward(frames(random_pixels(3, 2)), 1).unwrap();
    for row in to_values(features).chunks(24) {
        let mean = row.iter().sum::<f32>() / 24.0;
        let variance = row.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 24.0;
        assert!(mean.abs() < 1e-4 && (variance - 1.0).abs() < 1e-2, "{mean} {variance}");
    }
}

#[test]
fn gru_follows_its_formula() {
    let device = Device::flex();
    let gru = GruConfig { input: 3, hidden: 5 }.init(&mut ChaCha8Rng::seed_from_u64(1), &device);
    let x = random([4, 1, 3], 2);
    let found = to_values(gru.forward(x.clone(), None));
    let (w, b) = (to_values(gru.w_input.val()), to_values(gru.b_input.val()));
    let (u, c) = (to_values(gru.w_hidden.val()), to_values(gru.b_hidden.val()));
    let x = to_values(x);
    let sigmoid = |x: f32| 1.0 / (1.0 + (-x).exp());
    let mut state = [0f32; 5];
    for step in 0..4 {
        let input = |gate: usize| b[gate] + (0..3).map(|i| x[step * 3 + i] * w[i * 15 + gate]).sum::<f32>();
        let hidden = |gate: usize| c[gate] + (0..5).map(|i| state[i] * u[i * 15 + gate]).sum::<f32>();
        let next: Vec<f32> = (0..5)
            .map(|unit| {
                let reset = sigmoid(input(unit) + hidden(unit));
                let update = sigmoid(input(5 + unit) + hidden(5 + unit));
                let new = (input(10 + unit) + reset * hidden(10 + unit)).tanh();
                (1.0 - update) * new + update * state[unit]
            })
            .collect();
        state.copy_from_slice(&next);
        assert_close(&found[step * 5..step * 5 + 5], &state, 1e-5);
    }
}

#[test]
fn going_on_from_a_hidden_state_is_the_same_as_one_long_run() {
    let model = model(pixels());
    let bytes = random_pixels(9, 4);
    let actions: Vec<f32> = (0..18).map(|i| (i as f32 * 0.7).sin()).collect();
    let device = Device::flex();
    let whole = EpisodeEncoder::new(&model, &device).push(RawFrames::Pixels(&bytes), &actions).unwrap();
    let mut encoder = EpisodeEncoder::new(&model, &device);
    let mut parts = Vec::new();
    for (start, end) in [(0, 4), (4, 5), (5, 9)] {
        let size = SIDE * SIDE * 3;
        parts.extend(
            encoder.push(RawFrames::Pixels(&bytes[start * size..end * size]), &actions[2 * start..2 * end]).unwrap(),
        );
    }
    assert_close(&whole, &parts, 1e-5);
    assert_eq!(whole.len(), 9 * 6);
}

#[test]
fn the_adversary_does_not_see_what_it_predicts() {
    let model = model(pixels());
    let adversary = model.adversary.unwrap();
    let (latents, actions) = (random([4, 1, 6], 5), random([4, 1, 2], 6));
    let mut bytes = random_pixels(4, 7);
    let features = adversary.observe.forward(frames(bytes.clone()), 4).unwrap();
    let before = to_values(adversary.forward(features, latents.clone(), actions.clone()).mean);
    // Another last observation changes the prediction made from it, and none before.
    bytes[3 * SIDE * SIDE * 3..].fill(0);
    let features = adversary.observe.forward(frames(bytes), 4).unwrap();
    let after = to_values(adversary.forward(features, latents, actions).mean);
    assert_eq!(before[..18], after[..18]);
    assert_ne!(before[18..], after[18..]);
}

#[test]
fn the_decoder_retraces_every_size() {
    for (height, width) in [(64, 64), (20, 31), (10, 13), (47, 84)] {
        let observation = ObservationKind::Pixels { height, width };
        let model = model(observation);
        let picture = model.world.decoder.unwrap().picture.unwrap().forward(random([1, 2, 6], 1).squeeze_dim(0));
        assert_eq!(picture.dims(), [2, height, width, 3]);
    }
}

#[test]
fn a_perfect_reconstruction_has_the_highest_likelihood() {
    let model = model(ObservationKind::Vector { len: 3 });
    let decoder = model.world.decoder.unwrap();
    let latents = random([2, 2, 6], 3);
    let rebuilt = decoder.vector.clone().unwrap().forward(latents.clone().reshape([4, 6]));
    let best = to_values(decoder.log_prob(Frames::Vectors(rebuilt.clone()), latents.clone()).unwrap());
    assert_close(&best, &[0.0; 4], 1e-6);
    let off = to_values(decoder.log_prob(Frames::Vectors(rebuilt + 1.0), latents).unwrap());
    assert_close(&off, &[-1.5; 4], 1e-4);
}

#[test]
fn a_checkpoint_gives_back_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let model = model(pixels());
    model.save(&path).unwrap();
    let loaded = Model::load(&path, &Device::flex()).unwrap();
    assert_eq!(loaded.config, model.config);
    assert_eq!(read_parameters(&loaded.world, "world"), read_parameters(&model.world, "world"));
    assert_eq!(read_parameters(&loaded.adversary.unwrap(), "a"), read_parameters(&model.adversary.unwrap(), "a"));
    let names: Vec<String> = read_parameters(&loaded.world, "world").into_keys().collect();
    assert!(names.contains(&"world.encoder.gru.w_hidden".to_owned()), "{names:?}");
}

#[test]
fn tensors_that_do_not_fit_are_named() {
    let model = model(pixels());
    let mut tensors = read_parameters(&model.world, "world");
    tensors.extend(read_parameters(&model.adversary.clone().unwrap(), "adversary"));
    let name = "world.encoder.mean.bias";
    let mut other = tensors.clone();
    other.get_mut(name).unwrap().shape = vec![7];
    assert!(
        matches!(model.clone().with_parameters(&other), Err(ModelError::TensorShape { name: found, .. }) if found == name)
    );
    tensors.remove(name);
    assert!(matches!(model.with_parameters(&tensors), Err(ModelError::MissingTensor { name: found }) if found == name));
}

#[test]
fn what_the_model_cannot_take_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let small = config(ObservationKind::Pixels { height: 9, width: 64 });
    assert!(matches!(
        Model::init(small, &mut rng, &Device::flex()),
        Err(ModelError::PictureTooSmall { height: 9, .. })
    ));
    let model = model(pixels());
    let device = Device::flex();
    let error = EpisodeEncoder::new(&model, &device).push(RawFrames::Vectors(&[0.0; 3]), &[0.0; 2]).unwrap_err();
    assert!(error.to_string().contains("20×20"), "{error}");
    let vectors = Frames::Vectors(Tensor::zeros([1, 3], &device));
    assert!(model.world.encoder.forward(vectors, Tensor::zeros([1, 1, 2], &device), None).is_err());
}

#[test]
fn the_same_seed_gives_the_same_model() {
    assert_eq!(read_parameters(&model(pixels()).world, ""), read_parameters(&model(pixels()).world, ""));
}

#[test]
fn plain_and_own_operations_give_the_same_latents() {
    // ndarray runs Burn's own operations, flex the kernels of this package.
    #[allow(deprecated, reason = "the reference")]
    let plain = Device::ndarray();
    let model = model(pixels());
    // Of fewer than 16 rows the perceptrons of both would be Burn's own.
    let bytes = random_pixels(18, 8);
    let actions = [0.3; 36];
    let fast = EpisodeEncoder::new(&model, &Device::flex()).push(RawFrames::Pixels(&bytes), &actions).unwrap();
    let moved = Model { world: model.world.clone().to_device(&plain), ..model };
    let slow = EpisodeEncoder::new(&moved, &plain).push(RawFrames::Pixels(&bytes), &actions).unwrap();
    assert_close(&fast, &slow, 1e-4);
}

#[test]
fn vector_observations_go_through_symlog_and_actions_through_their_bounds() {
    let mut values = [0.0, 1.0, -(1f32.exp() - 1.0)];
    vibes_model::scale::symlog(&mut values);
    assert_close(&values, &[0.0, 2f32.ln(), -1.0], 1e-6);
    let mut actions = [-1.0, 0.0, 1.0, 4.0, 0.0, 2.0];
    vibes_model::scale::actions(&mut actions, &[-1.0, 0.0], &[1.0, 4.0]);
    assert_close(&actions, &[-1.0, -1.0, 1.0, 1.0, 0.0, 0.0], 1e-6);
}

#[test]
fn pixels_keep_their_place() {
    let tensor: Tensor<4, Int> = pixel_tensor((0..24).collect(), [1, 2, 4, 3], &Device::flex());
    let corner: i64 = tensor.narrow(1, 1, 1).narrow(2, 0, 1).narrow(3, 2, 1).into_scalar();
    assert_eq!(corner, 14);
}

/// Mean and standard deviation of every column of `[rows, width]`.
fn columns(values: &[f32], width: usize) -> Vec<(f32, f32)> {
    let rows = (values.len() / width) as f32;
    let column = |i: usize| values.iter().skip(i).step_by(width);
    (0..width)
        .map(|i| {
            let mean = column(i).sum::<f32>() / rows;
            (mean, (column(i).map(|x| (x - mean).powi(2)).sum::<f32>() / rows).sqrt())
        })
        .collect()
}

#[test]
fn calibrated_latents_begin_spread_over_the_sphere() {
    let (pixels, actions) = (frames(random_pixels(60, 5)), random([10, 6, 2], 6));
    let spread = |model: &Model| {
        let means = model.world.encoder.forward(pixels.clone(), actions.clone(), None).unwrap().means;
        columns(&to_values(means), 6).iter().map(|(_, std)| std * std).sum::<f32>()
    };
    let plain = model(self::pixels());
    let calibrated = plain.clone().calibrated(pixels.clone(), actions.clone(), &[0.0, 2.0, 4.0]).unwrap();
    assert!(spread(&plain) < 0.5, "{}: pictures of noise hardly differ", spread(&plain));
    // Latents have norm 1, so their total variance is 1 less the squared norm of their mean.
    assert!(spread(&calibrated) > 0.9, "{}", spread(&calibrated));
}

#[test]
fn a_calibrated_reward_model_predicts_the_rewards_own_distribution_whatever_it_sees() {
    let (pixels, actions) = (frames(random_pixels(4, 5)), random([2, 2, 2], 6));
    // A standard deviation of 300 is more than an exponential takes.
    for (rewards, mean, std) in [
        ([1.0, 3.0, 1.0, 3.0], 2.0, 1.0),
        ([-30.0, 10.0, -30.0, 10.0], -10.0, 20.0),
        ([0.0, 600.0, 0.0, 600.0], 300.0, 300.0),
    ] {
        let model = model(self::pixels()).calibrated(pixels.clone(), actions.clone(), &rewards).unwrap();
        let prediction = model.world.reward.forward(random([2, 2, 6], 7), actions.clone());
        assert_close(&to_values(prediction.mean), &[mean; 4], 1e-5);
        assert_close(&to_values(prediction.std), &[std; 4], 1e-5 * std);
    }
}

#[test]
fn standardizing_leaves_an_output_that_never_changes_finite() {
    let mut model = model(ObservationKind::Vector { len: 3 });
    let observe = model.world.encoder.observe.clone();
    let still = Tensor::<2>::ones([5, 3], &Device::flex());
    model.world.encoder.observe = observe.calibrated(Frames::Vectors(still.clone())).unwrap();
    let features = model.world.encoder.observe.forward(Frames::Vectors(still), 5).unwrap();
    assert_close(&to_values(features), &[0.0; 5 * 24], 1e-4);
}

#[test]
fn elu_has_its_values_and_a_gradient_for_large_numbers_too() {
    let device = Device::flex().autodiff();
    let x = Tensor::<1>::from_data([-200.0_f32, -1.0, 0.5, 200.0], &device).require_grad();
    let y = elu(x.clone());
    assert_close(&to_values(y.clone()), &[-1.0, -0.632_120_6, 0.5, 200.0], 1e-5);
    let gradient = x.grad(&y.sum().backward()).unwrap();
    assert_close(&to_values(gradient), &[0.0, 0.367_879_4, 1.0, 1.0], 1e-5);
}
