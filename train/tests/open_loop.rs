//! The open-loop reward where its R² is known: what depends on the action alone can be predicted at any distance, and under other actions is predicted wrongly; what depends on a
//! coin that is still to be tossed cannot.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use burn::tensor::Device;
use synthetic::Reward;
use toml::Table;
use vibes_measure::numbers::Numbers;
use vibes_model::Model;
use vibes_train::evaluate::{EvaluateOptions, evaluate};
use vibes_train::fit::{Go, fit};
use vibes_train::options::Options;
use vibes_train::prepare::prepare;

fn numbers(reward: Reward, steps: usize) -> Numbers {
    let folder = tempfile::tempdir().unwrap();
    let recording =
        |name: &str, grid| synthetic::recording_of(&folder.path().join(name), synthetic::SIDE, 8, steps, grid, reward);
    let (training, grid) = ([recording("coins", false)], recording("grid", true));
    let text = "updates = 300\nlr = 0.002\ndynamics_weight = 0.01\nobservations = 'vectors'";
    let options = Options::resolve("tiny", &[("the test", text.parse::<Table>().unwrap())]).unwrap();
    let run = prepare(&folder.path().join("run"), &training, &options, None).unwrap();
    let device = Device::flex();
    fit(&run, &training, &device, None, &mut |_| Go::On).unwrap();
    let model = Model::load(&run.newest_model().unwrap(), &device).unwrap();
    evaluate((&model).into(), &grid, &training, EvaluateOptions::default(), &device).unwrap().numbers
}

#[test]
fn what_the_action_alone_earns_is_told_at_any_distance_under_the_recorded_actions_only() {
    let found = numbers(|_state, action| 3.0 + 2.0 * action, 150);
    for ahead in [1, 5, 10, 15] {
        let of = |name: &str| found.get(&format!("{name}@{ahead}")).unwrap().value;
        let (recorded, shuffled) = (of("open_loop_reward_r2"), of("open_loop_reward_r2_shuffled"));
        assert!(recorded.estimate > 0.9, "{ahead}: {recorded:?}");
        // Of independent coins of variance 1: 1 − E(x − y)² = −1.
        assert!((shuffled.estimate + 1.0).abs() < 0.35, "{ahead}: {shuffled:?}");
        let persistence = of("open_loop_reward_r2_persistence");
        assert!((persistence.estimate + 1.0).abs() < 0.35, "{ahead}: {persistence:?}");
        assert!(recorded.low <= recorded.estimate && recorded.estimate <= recorded.high);
    }
    for features in ["s", "h", "hs"] {
        let names = found.iter().map(|number| number.name.clone());
        assert!(names.into_iter().any(|name| name.starts_with("probe/") && name.ends_with(&format!("/{features}"))));
    }
}

#[test]
fn what_a_coin_still_to_be_tossed_earns_is_not_told() {
    let found = numbers(|state, action| state * action, 150);
    for ahead in [1, 5, 10, 15] {
        let recorded = found.get(&format!("open_loop_reward_r2@{ahead}")).unwrap().value;
        assert!(recorded.estimate < 0.2, "{ahead}: {recorded:?}");
    }
}

#[test]
fn short_episodes_are_judged_as_far_as_they_go() {
    let found = numbers(|_state, action| 3.0 + 2.0 * action, 20);
    let of = |name: &str, ahead: usize| found.get(&format!("{name}@{ahead}")).map(|number| number.value.estimate);
    for name in ["open_loop_reward_r2", "open_loop_reward_r2_shuffled", "open_loop_reward_r2_persistence"] {
        assert!([1, 5, 10].iter().all(|&ahead| of(name, ahead).is_some()), "{name}");
        assert_eq!(of(name, 15), None, "after a quarter of 20 steps no 15 are to come: {name}");
    }
    assert!(of("open_loop_reward_r2", 10).unwrap() > 0.9);
}
