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

/// A model after so many updates, what it learned from, another recording of coins, and the critic's options.
fn trained(folder: &Path, updates: u64, critic: u64) -> (Model, Recording, Recording, GapOptions) {
    let learned_from = synthetic::recording(&folder.join("coins"), synthetic::SIDE, 6, 60, false);
    let held_out = synthetic::recording(&folder.join("grid"), synthetic::SIDE, 4, 60, true);
    let text = format!("updates = {updates}\nlr = 0.002\nadversary_lr = 0.002\ndynamics_weight = 0.01");
    let options = Options::resolve("tiny", &[("the test", text.parse::<Table>().unwrap())]).unwrap();
    let run = prepare(&folder.join("run"), std::slice::from_ref(&learned_from), &options, None).unwrap();
    fit(&run, std::slice::from_ref(&learned_from), &Device::flex(), None, &mut |_| Go::On).unwrap();
    let model = Model::load(&run.newest_model().unwrap(), &Device::flex()).unwrap();
    (model, learned_from, held_out, GapOptions::like(&options, critic))
}

fn gaps_after(folder: &Path, updates: u64, critic: u64) -> Gaps {
    let (model, learned_from, held_out, options) = trained(folder, updates, critic);
    gaps(&model, &[learned_from], &held_out, options, &Device::flex()).unwrap()
}

#[test]
fn a_critic_that_has_not_learned_anything_agrees_with_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let found = gaps_after(folder.path(), 1, 0);
    for judged in [found.held_out, found.training, found.half_way] {
        for of in [judged.dynamics, judged.reward] {
            assert!((of.critic - of.model).abs() < 1e-3 && (of.refitted - of.model).abs() < 1e-3, "{of:?}");
            assert!(of.gap.estimate.abs() < 1e-3 && of.gap.low <= of.gap.high, "{of:?}");
        }
    }
}

/// The encoder of a model that has learned nothing passes the coin on all the same, so that heads refitted on its latents tell the reward: what they gain is no
/// gap. Only what the latents themselves lack is one.
#[test]
fn heads_that_were_fitted_too_briefly_are_no_gap() {
    let folder = tempfile::tempdir().unwrap();
    let found = gaps_after(folder.path(), 1, 400);
    let reward = found.held_out.reward;
    assert!(reward.refitted - reward.model > 0.3, "heads learn the reward from (h, s, a): {reward:?}");
    assert!(reward.gap.estimate < 0.5 * (reward.critic - reward.model), "{reward:?}");
    assert!(found.training.reward.critic > found.training.reward.model + 0.3, "{found:?}");
}

/// A model whose latents say nothing of the coin: the reward can be predicted from the picture, and never from (h, s, a).
#[test]
fn what_the_latents_lack_is_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let (mut model, learned_from, held_out, options) = trained(folder.path(), 1, 400);
    let mean = &mut model.world.encoder.mean;
    mean.weight = mean.weight.clone().map(|weight| weight.zeros_like());
    mean.bias = mean.bias.clone().map(|bias| bias.ones_like());
    let found = gaps(&model, &[learned_from], &held_out, options, &Device::flex()).unwrap();
    let reward = found.held_out.reward;
    assert!((reward.refitted - reward.model).abs() < 0.4 && reward.gap.low > 0.3, "{reward:?}");
    assert!(found.half_way.reward.gap.estimate < reward.gap.estimate + 0.1, "{found:?}");
}
