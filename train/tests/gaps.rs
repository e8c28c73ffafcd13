//! The gaps to a bisimulation, where it is known what a critic can find.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use std::path::Path;

use burn::tensor::Device;
use toml::Table;
use vibes_data::Recording;
use vibes_model::Model;
use vibes_train::evaluate::{GapOptions, Gaps, gaps};
use vibes_train::fit::{Go, fit};
use vibes_train::options::Options;
use vibes_train::prepare::prepare;

/// Gaps of a model after so many updates, by a critic of so many, on another recording of coins.
fn gaps_after(folder: &Path, updates: u64, critic: u64) -> Gaps {
    let learned_from = [synthetic::recording(&folder.join("coins"), synthetic::SIDE, 6, 60, false)];
    let held_out: Recording = synthetic::recording(&folder.join("grid"), synthetic::SIDE, 4, 60, true);
    let text = format!("updates = {updates}\nlr = 0.002\nadversary_lr = 0.002\ndynamics_weight = 0.01");
    let options = Options::resolve("tiny", &[("the test", text.parse::<Table>().unwrap())]).unwrap();
    let run = prepare(&folder.join("run"), &learned_from, &options, None).unwrap();
    let device = Device::flex();
    fit(&run, &learned_from, &device, None, &mut |_| Go::On).unwrap();
    let model = Model::load(&run.newest_model().unwrap(), &device).unwrap();
    gaps(&model, &learned_from, &held_out, GapOptions::like(&options, critic), &device).unwrap()
}

#[test]
fn a_critic_that_has_not_learned_anything_agrees_with_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let found = gaps_after(folder.path(), 1, 0);
    assert!(found.dynamics_gap.abs() < 1e-3 && found.reward_gap.abs() < 1e-4, "{found:?}");
}

#[test]
fn what_the_model_has_not_learned_shows_as_a_gap_and_what_it_has_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let early = gaps_after(&folder.path().join("early"), 1, 400);
    assert!(early.reward_gap > 0.3, "the reward can be told from the picture and the action: {early:?}");
    let late = gaps_after(&folder.path().join("late"), 600, 400);
    assert!(late.reward > early.reward + 0.5, "{late:?} after {early:?}");
    assert!(late.reward_gap < early.reward_gap / 2.0, "{late:?} after {early:?}");
}
