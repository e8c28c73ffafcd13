//! Every device of this build against flex: the same seed makes the same model there, with the same values, gradients and steps. flex runs the kernels of
//! this package, `ndarray` and (with the cargo feature) `wgpu` run Burn's own operations.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod made_up;

use std::collections::BTreeMap;

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_model::encode::{EpisodeEncoder, RawFrames, to_frames};
use vibes_model::init::normal;
use vibes_model::kernels::{Adam, Moments, gru};
use vibes_model::observe::Frames;
use vibes_model::parameters::to_values;
use vibes_model::{Model, ModelConfig, ObservationKind};

/// Rows and windows of what is made up, and values of an action. Of fewer than 16 rows the perceptrons of flex would be those of every device.
const LENGTH: usize = 5;
const BATCH: usize = 4;
const ACTIONS: usize = 2;

fn devices() -> Vec<(&'static str, Device)> {
    #[allow(deprecated, reason = "chosen with --device ndarray")]
    let ndarray = Device::ndarray();
    vec![
        ("ndarray", ndarray),
        #[cfg(feature = "wgpu")]
        ("wgpu", Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
    ]
}

/// Numbers by name.
type Numbers = BTreeMap<String, Vec<f32>>;

/// Differences are measured in units of the largest number of a tensor, or of 1 if all are smaller.
fn assert_near(device: &str, found: &Numbers, expected: &Numbers, tolerance: f32) {
    assert!(found.keys().eq(expected.keys()), "{device}: {:?} {:?}", found.keys(), expected.keys());
    for (name, expected) in expected {
        let found = &found[name];
        assert_eq!(found.len(), expected.len(), "{device}: {name}");
        let scale = expected.iter().fold(1f32, |most, number| most.max(number.abs()));
        let apart = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        // `f32::max` would pass over a difference that is none.
        let difference = apart.inspect(|apart| assert!(apart.is_finite(), "{apart}")).fold(0.0, f32::max);
        assert!(difference <= tolerance * scale, "{device}: {name}: {difference} of {scale}");
        assert!(found.iter().all(|number| number.is_finite()), "{device}: {name}");
    }
}

fn config(observation: ObservationKind) -> ModelConfig {
    ModelConfig { action_min: vec![-1.0; ACTIONS], action_max: vec![1.0; ACTIONS], ..made_up::config(observation) }
}

fn random<const D: usize>(shape: [usize; D], seed: u64, device: &Device) -> Tensor<D> {
    let values = normal(shape.iter().product(), &mut ChaCha8Rng::seed_from_u64(seed));
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn observations(kind: ObservationKind, device: &Device) -> Frames {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rows = LENGTH * BATCH;
    match kind {
        ObservationKind::Pixels { height, width } => {
            let bytes: Vec<u8> = (0..rows * height * width * 3).map(|_| rng.random()).collect();
            to_frames(RawFrames::Pixels(&bytes), kind, rows, device).unwrap()
        }
        ObservationKind::Vector { len } => {
            to_frames(RawFrames::Vectors(&normal(rows * len, &mut rng)), kind, rows, device).unwrap()
        }
    }
}

fn calibrated_model(kind: ObservationKind, device: &Device) -> Model {
    let model = Model::init(config(kind), &mut ChaCha8Rng::seed_from_u64(3), device).unwrap();
    let rewards: Vec<f32> = (0..LENGTH * BATCH).map(|row| row as f32 * 0.1).collect();
    model.calibrated(observations(kind, device), random([LENGTH, BATCH, ACTIONS], 2, device), &rewards).unwrap()
}

/// What every network makes of one window, and the gradients of all of it together.
fn outputs(kind: ObservationKind, device: &Device) -> (Numbers, Numbers) {
    let Model { world, adversary, .. } = calibrated_model(kind, device);
    let (world, adversary) = (world.train(), adversary.unwrap().train());
    let device = &device.clone().autodiff();
    let frames = observations(kind, device);
    let actions = random([LENGTH, BATCH, ACTIONS], 2, device);
    let latents = world.encoder.forward(frames.clone(), actions.clone(), None).unwrap().means;
    let features = adversary.observe.forward(frames.clone(), LENGTH).unwrap();
    let dynamics = world.dynamics.forward(latents.clone(), actions.clone(), None).0;
    let critic = adversary.forward(features, latents.clone(), actions.clone());
    let reward = world.reward.forward(latents.clone(), actions);
    let observed = world.decoder.as_ref().unwrap().log_prob(frames, latents.clone()).unwrap();
    let next = random(latents.dims(), 4, device);
    let parts = [
        ("dynamics", dynamics.log_prob(next.clone())),
        ("adversary", critic.log_prob(next)),
        ("reward", reward.log_prob(random([LENGTH, BATCH, 1], 5, device))),
        ("decoder", observed.unsqueeze_dim(2)),
        ("latents", latents),
    ];
    let named = |(name, tensor): &(&str, Tensor<3>)| ((*name).to_owned(), to_values(tensor.clone().inner()));
    let values = parts.iter().map(named).collect();
    let loss = parts.into_iter().map(|(_, tensor)| tensor.mean()).reduce(|a, b| a + b).unwrap();
    let mut taker = Taker { path: Vec::new(), gradients: loss.backward(), found: Numbers::new() };
    world.visit(&mut taker);
    taker.path.push("adversary".to_owned());
    adversary.visit(&mut taker);
    (values, taker.found)
}

struct Taker {
    path: Vec<String>,
    gradients: Gradients,
    found: Numbers,
}

impl ModuleVisitor for Taker {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let gradient = param.val().grad_remove(&mut self.gradients).unwrap();
        self.found.insert(self.path.join("."), to_values(gradient));
    }
}

#[test]
fn a_model_has_the_same_values_and_gradients_everywhere() {
    let kinds = [
        ObservationKind::Pixels { height: 64, width: 64 },
        // Sizes that leave a row or a column unseen.
        ObservationKind::Pixels { height: 20, width: 31 },
        ObservationKind::Vector { len: 3 },
    ];
    for kind in kinds {
        let (values, gradients) = outputs(kind, &Device::flex());
        for (name, device) in devices() {
            let found = outputs(kind, &device);
            assert_near(name, &found.0, &values, 1e-4);
            assert_near(name, &found.1, &gradients, 1e-4);
        }
    }
}

#[test]
fn an_encoder_follows_an_episode_everywhere() {
    let kind = ObservationKind::Pixels { height: 20, width: 20 };
    let bytes: Vec<u8> = (0..9 * 20 * 20 * 3).map(|byte| (byte * 7 % 251) as u8).collect();
    let latents = |device: &Device| {
        let model = calibrated_model(kind, device);
        let mut encoder = EpisodeEncoder::new(&model, device);
        let (first, rest) = bytes.split_at(4 * 20 * 20 * 3);
        let mut latents = encoder.push(RawFrames::Pixels(first), &[0.3; 4 * ACTIONS]).unwrap();
        latents.extend(encoder.push(RawFrames::Pixels(rest), &[-0.5; 5 * ACTIONS]).unwrap());
        Numbers::from([("latents".to_owned(), latents)])
    };
    for (name, device) in devices() {
        assert_near(name, &latents(&device), &latents(&Device::flex()), 1e-4);
    }
}

#[test]
fn a_gru_starts_anew_with_an_episode_everywhere() {
    let states = |device: &Device| {
        let keep = Tensor::<2>::ones([LENGTH, BATCH], device).slice_assign([2..3, 0..1], Tensor::zeros([1, 1], device));
        let (gates, weight) = (random([LENGTH, BATCH, 21], 1, device), random([7, 21], 2, device));
        let states = gru(gates, weight, random([21], 3, device), random([BATCH, 7], 4, device), Some(keep));
        Numbers::from([("states".to_owned(), to_values(states))])
    };
    for (name, device) in devices() {
        assert_near(name, &states(&device), &states(&Device::flex()), 1e-5);
    }
}

#[test]
fn adam_makes_the_same_steps_everywhere() {
    let stepped = |device: &Device| {
        let mut parameter = random([300], 1, device);
        let mut moments: Option<Moments<1>> = None;
        for step in 1..=3 {
            let gradient = random([300], 1 + step, device);
            let (next, kept) = Adam::default().update(parameter, gradient, moments, 1e-2, 0.5, step);
            (parameter, moments) = (next, Some(kept));
        }
        let moments = moments.unwrap();
        let named = |(name, tensor): (&str, Tensor<1>)| (name.to_owned(), to_values(tensor));
        Numbers::from([("parameter", parameter), ("first", moments.first), ("second", moments.second)].map(named))
    };
    for (name, device) in devices() {
        assert_near(name, &stepped(&device), &stepped(&Device::flex()), 1e-5);
    }
}
