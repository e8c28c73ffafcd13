//! A law over the registry of objectives: each one trains on a tiny recording, and what it has trained is encoded and evaluated, with latents of the form that it declares.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use burn::tensor::Device;
use toml::Table;
use vibes_data::Latents;
use vibes_model::gaussian::LatentForm;
use vibes_train::encode::encode_recording;
use vibes_train::evaluate::{EvaluateOptions, evaluate};
use vibes_train::fit::{End, Go, fit};
use vibes_train::learners::objective::Objective;
use vibes_train::options::Options;
use vibes_train::prepare::prepare;
use vibes_train::trained::TrainedRun;

/// Of an episode of the grid: enough for a start and the fifteen steps that are run ahead of it.
const STEPS: usize = 40;

#[test]
fn every_objective_trains_is_encoded_is_evaluated_and_says_the_form_of_its_latents() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex();
    let training = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 24, false)];
    let grid = synthetic::recording(&folder.path().join("grid"), synthetic::SIDE, 8, STEPS, true);
    for objective in Objective::all() {
        let path = folder.path().join(objective.name());
        let text = format!("objective = '{objective}'\nupdates = 3\nobservations = 'pixels'");
        let options = Options::resolve("tiny", &[("the test", text.parse::<Table>().unwrap())]).unwrap();
        let run = prepare(&path, &training, &options, None).unwrap();
        assert_eq!(fit(&run, &training, &device, None, &mut |_| Go::On).unwrap(), End::Updates, "{objective}");
        drop(run);

        let run = TrainedRun::open(&path).unwrap();
        let (trained, checkpoint) = run.load(&device).unwrap();
        let output = path.join("latents.arrow");
        encode_recording(trained.encoder(), &checkpoint, &grid, &output, &device, &mut |_| {}).unwrap();
        let latents = Latents::read(&output).unwrap();
        assert_eq!(latents.step.len(), 8 * (STEPS + 1), "{objective}");
        let report = evaluate(trained.encoder(), &grid, &training, EvaluateOptions::default(), &device).unwrap();
        for name in ["retrieval_same_step@1", "retrieval_any_step@1", "state_share", "distractor_share"] {
            let value = report.numbers.get(name).unwrap().value.estimate;
            assert!((0.0..=1.0).contains(&value), "{objective}: {name} {value}");
        }
        assert!(report.numbers.get("open_loop_reward_r2@1").is_some(), "{objective}");

        let norm = |row: &[f32]| row.iter().map(|value| value * value).sum::<f32>().sqrt();
        let is_unit = latents.latent.chunks_exact(latents.dims).all(|row| (norm(row) - 1.0).abs() < 1e-4);
        let form = objective.networks(&options, 1).latents;
        assert_eq!(is_unit, form == LatentForm::UnitNorm, "{objective}");
        let said = std::fs::read_to_string(path.join("run.json")).unwrap();
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(said["model"]["latents"], serde_json::to_value(form).unwrap(), "{objective}");
        let summary = std::fs::read_to_string(path.join("summary.md")).unwrap();
        assert!(summary.contains(&format!("latent {} ({form})", latents.dims)), "{objective}: {summary}");
        let said = [
            ("(adversary)", objective.networks(&options, 1).adversary),
            ("dynamics weight", objective.dynamics_shape_latents()),
            ("nats on", objective.gate(&options).is_some()),
            ("(at most 1)", form == LatentForm::UnitNorm),
        ];
        for (words, wanted) in said {
            assert_eq!(summary.contains(words), wanted, "{objective}, {words}: {summary}");
        }
    }
}
