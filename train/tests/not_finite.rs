//! Weights that are no numbers: whoever meets them in saving names the update that made them, and nothing is loaded that has them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_model::parameters::{read_parameters, write_parameters};
use vibes_model::{Model, ModelConfig};
use vibes_train::learners::world::Learner;
use vibes_train::options::Options;
use vibes_train::prepare::prepare;
use vibes_train::run::State;
use vibes_train::session::Session;

/// A model with one weight that is no number.
fn overflowed(config: &ModelConfig) -> Model {
    let model = Model::init(config.clone(), &mut ChaCha8Rng::seed_from_u64(0), &Device::flex()).unwrap();
    let mut weights = read_parameters(&model.world, "world");
    weights.get_mut("world.encoder.mean.bias").unwrap().values[0] = f32::NAN;
    Model { world: write_parameters(model.world, "world", &weights).unwrap(), ..model }
}

#[test]
fn a_refused_save_names_the_last_update_and_what_was_saved_otherwise_is_not_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let options = Options::resolve("tiny", &[("the test", "updates = 8".parse().unwrap())]).unwrap();
    let run = prepare(&folder.path().join("run"), &recordings, &options, None).unwrap();
    let (device, model) = (Device::flex(), overflowed(&run.info().model));

    let learner = Learner::new(model.clone(), &run.info().options, &device);
    let state = State { update: 8, ..State::default() };
    let mut session = Session::open(&run, &device, state, false).unwrap();
    let error = session.save(&learner, |_| Ok(())).unwrap_err().to_string();
    assert!(error.starts_with("update 8 diverged: a weight is NaN"), "{error}");
    assert!(run.checkpoints().is_empty());

    let file = folder.path().join("model.safetensors");
    model.save(&file).unwrap();
    let error = Model::load(&file, &device).unwrap_err().to_string();
    assert!(error.contains("`world.encoder.mean.bias` holds NaN") && error.contains("model.safetensors"), "{error}");
}
