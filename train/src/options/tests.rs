//! How options come about, and which are refused.

use super::presets::small;
use super::*;

#[test]
fn every_preset_passes_its_own_checks() {
    for (name, _) in PRESETS {
        Options::resolve(name, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn later_layers_win_and_whole_numbers_are_widened() {
    let file: Table = "batch = 3\nlr = 1".parse().unwrap();
    let flags: Table = "batch = 5".parse().unwrap();
    let options = Options::resolve("small", &[("a.toml", file), ("the arguments", flags)]).unwrap();
    assert_eq!((options.batch, options.lr), (5, 1.0));
}

#[test]
fn unknown_names_list_the_known_ones() {
    let error = Options::resolve("huge", &[]).unwrap_err().to_string();
    assert!(error.contains("tiny, small, base, paper, paper-small"), "{error}");
    let file: Table = "batchsize = 3".parse().unwrap();
    let error = Options::resolve("small", &[("a.toml", file)]).unwrap_err().to_string();
    assert!(error.contains("batchsize") && error.contains("gradient_clip") && error.contains("a.toml"), "{error}");
}

#[test]
fn impossible_values_are_refused() {
    for text in [
        "batch = 0",
        "lr = 0",
        "adam_epsilon = 0",
        "latent_std = -1.0",
        "length = 3",
        "objective = 'dreamer'",
        "lr = nan",
        "hidden = 65537",
        "batch = 1000000000000",
    ] {
        let layer: Table = text.parse().unwrap();
        assert!(Options::resolve("small", &[("the arguments", layer)]).is_err(), "{text}");
    }
}

/// A file of a run holds finite numbers alone, so that whatever else is asked for would be a run that nothing can open.
#[test]
fn no_number_may_be_anything_but_finite() {
    let options = Options::resolve("small", &[]).unwrap();
    let numbers: Vec<String> = Table::try_from(&options)
        .unwrap()
        .into_iter()
        .filter(|(_, value)| value.is_float())
        .map(|(key, _)| key)
        .collect();
    assert!(numbers.len() > 15, "{numbers:?}");
    for key in numbers {
        for value in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, -1.0, 1e39, 1e-46] {
            if key == "dynamics_after" && value == -1.0 {
                continue; // A condition that is met from the start.
            }
            let layer = Table::from_iter([(key.clone(), toml::Value::Float(value))]);
            let error = Options::resolve("small", &[("the arguments", layer)]).unwrap_err().to_string();
            assert!(error.contains(&key.replace('_', "-")), "{key} = {value}: {error}");
        }
    }
}

#[test]
fn warm_up_rises_to_the_weight() {
    let options = Settings { dynamics_warmup: 100, dynamics_weight: 0.5, ..small() };
    let found = [0, 10, 60, 110, 1000].map(|update| options.schedule(update, Some(10)).dynamics_weight);
    assert_eq!(found, [0.0, 0.0, 0.25, 0.5, 0.5]);
    assert_eq!(options.schedule(1000, None).dynamics_weight, 0.0);
    let at_once = Settings { dynamics_warmup: 0, dynamics_weight: 0.03, ..small() };
    let warmed = Settings { lr: 1.0, lr_warmup: 4, ..small() };
    assert_eq!([0, 1, 3, 9].map(|update| warmed.schedule(update, None).lr), [0.25, 0.5, 1.0, 1.0]);
    assert_eq!(at_once.schedule(0, Some(0)).dynamics_weight, 0.03);
    let falling = Settings { lr: 1.0, adversary_lr: 2.0, lr_warmup: 0, lr_decay: 100, ..small() };
    assert_eq!([0, 99, 399].map(|update| falling.schedule(update, None).lr), [1.0, 1.0, 0.5]);
    assert_eq!(falling.schedule(399, None).adversary_lr, 1.0);
    // New moments warm up; what has fallen stays fallen.
    assert_eq!(falling.schedule_after(0, 399, None).lr, 0.5);
}

#[test]
fn only_options_that_change_the_numbers_are_compared() {
    let options = |settings| Options { objective: Objective::default(), settings };
    let longer = options(Settings { updates: 5, ..small() });
    assert_eq!(options(small()).first_difference(&longer), None);
    let other = options(Settings { dynamics_weight: 1.0, ..small() });
    assert_eq!(options(small()).first_difference(&other).unwrap().0, "dynamics-weight");
    // Older runs may have one that their objective never looked at.
    let unread = |settings: Settings| Options { objective: "deepmdp".parse().unwrap(), settings };
    let other = Settings { dynamics_weight: 0.1, dynamics_warmup: 7, ..small() };
    assert_eq!(unread(other).first_difference(&unread(small())), None);
}

#[test]
fn declared_options_lie_beside_all_others() {
    let layer: Table = "inverse_weight = 1\nclip = 'none'\nreward_steps = 4".parse().unwrap();
    let options = Options::resolve("small", &[("a.toml", layer)]).unwrap();
    assert_eq!(options.own.number(&crate::learners::auxiliary::inverse::WEIGHT), 1.0);
    let text = toml::to_string(&options).unwrap();
    assert!(text.contains("inverse_weight = 1.0") && text.contains("clip = \"none\""), "{text}");
    let read: Options = toml::from_str(&text).unwrap();
    assert_eq!(read, options);
    let json = serde_json::to_string(&options).unwrap();
    assert_eq!(serde_json::from_str::<Options>(&json).unwrap(), options);
    // A run of before an option was declared reads as if it were at its default.
    let older: String = text.lines().filter(|line| !line.starts_with("inverse_weight")).collect::<Vec<_>>().join("\n");
    let read: Options = toml::from_str(&older).unwrap();
    assert_eq!(read.own.number(&crate::learners::auxiliary::inverse::WEIGHT), 0.0);
    assert_eq!(read.first_difference(&options).unwrap().0, "inverse-weight", "it may not change on the way either");
    let wrong = [
        "clip = 'sometimes'",
        "reward_steps = 0.5",
        "inverse_weight = -1",
        "reward_steps = 14",
        "inverse_steps = 14",
        "inverse_steps = 0",
        "objective = 'self-prediction'\nself_prediction_steps = 40",
        "objective = 'multi-step-inverse'\nmulti_step_inverse_steps = 0",
    ];
    for wrong in wrong {
        let layer: Table = wrong.parse().unwrap();
        assert!(Options::resolve("small", &[("a.toml", layer)]).is_err(), "{wrong}");
    }
}

#[test]
fn the_recipe_is_laid_over_small_for_the_papers_objective_with_and_without_its_adversary() {
    for objective in Objective::all() {
        for (preset, _) in PRESETS {
            let layer: Table = format!("objective = '{objective}'").parse().unwrap();
            let options = Options::resolve(preset, &[("the arguments", layer)]).unwrap();
            let wanted = if preset == "small" && objective.takes_recipe() { 3 } else { 0 };
            assert_eq!(asked(&options).count(), wanted, "{preset}, {objective}");
        }
    }
    let without: Table = "inverse_weight = 0\nlatent_steps = 0\nreward_steps = 0".parse().unwrap();
    let options = Options::resolve("small", &[("the arguments", without)]).unwrap();
    assert_eq!((asked(&options).count(), options.dynamics_weight), (0, 0.03), "what is typed wins");
}

#[test]
fn the_reward_floor_follows_the_rewards() {
    let spec = crate::bench::made_up_spec(crate::bench::Sizes { picture: 16, actions: 1, repeats: 1 });
    let kind = ObservationKind::Vector { len: 1 };
    let model = |text: &str| {
        let layer: Table = text.parse().unwrap();
        Options::resolve("small", &[("the test", layer)]).unwrap().model(&spec, kind, 2.5)
    };
    let relative = model("reward_floor = 0.1");
    assert_eq!((relative.reward_scale, relative.reward_floor), (2.5, 0.25));
    let absolute = model("reward_floor = 0.1\nreward_scale = 1.0");
    assert_eq!((absolute.reward_scale, absolute.reward_floor), (1.0, 0.1));
}

#[test]
fn the_paper_has_rates_and_floors_of_its_own() {
    let paper = Options::resolve("paper", &[]).unwrap();
    assert!(paper.adversary_lr > paper.lr && paper.adversary_lr <= 3.0 * paper.lr);
    assert!(paper.prediction_floor < small().prediction_floor && paper.reward_floor < small().reward_floor);
    assert_eq!((paper.dynamics_weight, paper.reward_scale), (1.0, 1.0));
    assert!(asked(&paper).next().is_none());
}
