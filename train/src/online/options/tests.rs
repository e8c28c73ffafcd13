//! Options that may change on the way, those that cannot be, and what a protocol fixes.

use super::super::prepare::{default_options, default_world};
use super::*;

type Change = fn(&mut OnlineOptions);

#[test]
fn a_longer_run_hides_no_other_change() {
    let found = default_options(default_world("cartpole-swingup").unwrap(), false);
    let longer = OnlineOptions { control_steps: 600_000, evaluate_every: 5000, ..found.clone() };
    assert_eq!(found.first_difference(&longer), None);
    let changes: [(&str, Change); 6] = [
        ("exploration", |options| options.exploration = 0.0),
        ("first_updates", |options| options.first_updates = 7),
        ("prefill", |options| options.prefill = 9),
        ("rows_per_step", |options| options.rows_per_step = 64.0),
        ("behaviour.discount", |options| options.behaviour.discount = 0.5),
        ("world.steps", |options| options.world.steps = 40),
    ];
    let short = OnlineOptions { short_horizon: 5, short_for: 400, critic_first: 500, ..found.clone() };
    assert!(short.check_new(false).unwrap_err().to_string().contains("--short-for is 400"));
    let short = OnlineOptions { critic_first: 300, ..short };
    short.check_new(false).unwrap();
    let idle = OnlineOptions { short_horizon: 0, ..short.clone() };
    assert!(idle.check_new(false).unwrap_err().to_string().contains("without --short-horizon"));
    let random = OnlineOptions { control_steps: 5000, prefill: 5, ..found.clone() };
    assert!(random.check_new(false).unwrap_err().to_string().contains("take 5000"));
    let none = OnlineOptions { prefill: 0, control_steps: 1000, ..random.clone() };
    assert!(
        none.check_new(false).unwrap_err().to_string().contains("the 1 random episodes"),
        "one is lived through anyway"
    );
    none.check_new(true).unwrap();
    OnlineOptions { control_steps: 5001, ..random }.check_new(false).unwrap();
    let horizons = [0, 399, 400].map(|updates| short.behaviour_at(updates).horizon);
    assert_eq!(horizons, [5, 5, found.behaviour.horizon]);
    let endless = OnlineOptions { rows_per_step: 1e300, ..found.clone() };
    assert!(endless.check().unwrap_err().to_string().contains("must be at most"));
    for (key, change) in changes {
        let mut other = longer.clone();
        change(&mut other);
        assert_eq!(found.first_difference(&other).map(|(key, ..)| key).as_deref(), Some(key));
    }
    let published = OnlineOptions { protocol: Some(Protocol::DcsEasyDynamic500k), ..found.clone() };
    let longer = OnlineOptions { control_steps: 600_000, ..published.clone() };
    assert_eq!(published.first_difference(&longer).map(|(key, ..)| key).as_deref(), Some("control_steps"));
}

/// Whatever may not change is told in the words in which it was typed, with the values that these words have.
#[test]
fn what_differs_is_told_as_it_is_typed() {
    let found = default_options(default_world("cartpole-swingup").unwrap(), false);
    let changes: [(&str, &str, Change); 6] = [
        ("static", "false", |options| options.world.distractors.dynamic = false),
        ("distract", "\"background,camera,color\"", |options| options.world.distractors.axes.camera = false),
        ("no-pixels", "false", |options| options.world.draw_nothing()),
        ("evaluate-samples", "false", |options| options.evaluate_mode = false),
        ("render", "\"fast\"", |options| options.world.look = Look::Suite),
        ("video-count", "null", |options| options.world.video_count = Some(9)),
    ];
    for (typed, value, change) in changes {
        let mut other = found.clone();
        change(&mut other);
        let (key, before, _) = found.first_difference(&other).unwrap();
        assert_eq!((flag(&key).as_str(), before.as_str()), (typed, value));
        assert_eq!(flag(&format!("online.{key}")), typed, "of an agent without a world model too");
    }
}

#[test]
fn beginning_anew_is_due_once_at_each_of_its_control_steps_and_not_at_the_end() {
    let found = default_options(default_world("cartpole-swingup").unwrap(), false);
    let resets = OnlineOptions { reset_at: vec![20_000, 60_000], reset_updates: 4000, ..found.clone() };
    resets.check().and_then(|()| resets.check_new(false)).unwrap();
    let due = |resets_before, control_steps| resets.is_reset_due(resets_before, control_steps);
    assert_eq!([due(0, 19_999), due(0, 20_000), due(1, 20_000), due(1, 61_000)], [false, true, false, true]);
    assert_eq!([due(2, 400_000), due(1, 500_000), found.is_reset_due(0, 400_000)], [false; 3]);
    let lives = resets.updates_by_life(128, false);
    assert_eq!(lives, [200 + 125 * 14, 4000 + 125 * 40, 4000 + 125 * 440], "five of the first 20 episodes are random");
    assert_eq!(
        (resets.fewest_updates(128, false), resets.where_fewest()),
        (1950, "between two beginnings, where they are fewest (--reset-at)")
    );
    for wrong in [vec![0], vec![5, 5], vec![7, 5]] {
        let error = OnlineOptions { reset_at: wrong, ..resets.clone() }.check().unwrap_err().to_string();
        assert!(error.contains("--reset-at is") && error.contains("rise"), "{error}");
    }
    let refused = |reset_at: Vec<u64>, control_steps| {
        OnlineOptions { reset_at, control_steps, ..resets.clone() }.check_new(false).unwrap_err().to_string()
    };
    let late = refused(vec![20_000, 60_000], 60_000);
    assert!(late.contains("--reset-at has 60000") && late.contains("over after 60000"), "{late}");
    assert!(refused(vec![20_000, 59_001], 60_000).contains("--reset-at has 59001"), "its episode is the last one");
    assert!(
        refused(vec![5000], 60_000).contains("the random episodes (--prefill) ends after 5000"),
        "nothing is learned before it"
    );
    assert!(
        refused(vec![20_001, 21_000], 60_000).contains("--reset-at has 21000"),
        "both are at the end of one episode"
    );
    assert!(refused(vec![20_000, u64::MAX], 60_000).contains("--reset-at has 18446744073709551615"), "however far");
    OnlineOptions { reset_at: vec![5001, 6001], ..resets.clone() }.check_new(false).unwrap();
    assert_eq!(found.first_difference(&resets).map(|(key, ..)| flag(&key)).as_deref(), Some("reset-at"));
}

/// Whose first four videos are missing, four others would train under the protocol's name.
#[test]
fn a_protocol_takes_davis_with_the_first_of_both_lists() {
    let folder = tempfile::tempdir().unwrap();
    for (video, frames) in davis::FIRST_FRAMES {
        std::fs::create_dir_all(folder.path().join(video)).unwrap();
        for frame in 0..frames {
            std::fs::write(folder.path().join(video).join(format!("{frame:05}.jpg")), []).unwrap();
        }
    }
    let mut options = default_options(default_world("cartpole-swingup").unwrap(), false);
    options.settle(Protocol::DcsEasyDynamic500k);
    options.final_episodes = 100;
    options.world.videos = VideoSource::Folder(folder.path().to_owned());
    options.check().unwrap();
    std::fs::create_dir_all(folder.path().join("breakdance-flare")).unwrap();
    std::fs::rename(folder.path().join("bear/00081.jpg"), folder.path().join("aside.jpg")).unwrap();
    let refused = options.check().unwrap_err().to_string();
    assert!(refused.contains("videos of DAVIS 2017"), "a frame is missing: {refused}");
    std::fs::rename(folder.path().join("aside.jpg"), folder.path().join("bear/00081.jpg")).unwrap();
    options.check().unwrap();
    std::fs::remove_dir_all(folder.path().join("bear")).unwrap();
    let refused = options.check().unwrap_err().to_string();
    assert!(refused.contains("videos of DAVIS 2017"), "{refused}");
}

/// A run and its folder of videos can be moved together, and the path may be typed anew from anywhere.
#[test]
fn a_folder_of_videos_is_named_from_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let [before, after] = ["before", "after"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(before.join("films")).unwrap();
    std::fs::create_dir_all(before.join("runs/a")).unwrap();
    let typed = |path: &Path| {
        let world = default_world("cartpole-swingup").unwrap();
        default_options(WorldOptions { videos: VideoSource::Folder(path.to_owned()), ..world }, false)
    };
    typed(&before.join("films")).keep(&before.join("runs/a")).unwrap();
    let text = std::fs::read_to_string(before.join("runs/a/online.json")).unwrap();
    assert!(text.contains("\"../../films\""), "{text}");
    std::fs::rename(&before, &after).unwrap();
    let found = OnlineOptions::read(&after.join("runs/a")).unwrap().unwrap();
    assert_eq!(found.world.videos, VideoSource::Folder(after.join("films")));
    typed(&after.join("runs/../films")).keep(&after.join("runs/a")).unwrap();
    let error = typed(&after.join("others")).keep(&after.join("runs/a")).unwrap_err().to_string();
    assert!(error.starts_with("this run has videos = "), "{error}");
    let manifest = found.world.manifest(0, &[], &after.join("runs/a/replay")).unwrap();
    assert_eq!(manifest.options["videos"]["folder"], "../../../films");
}

/// Ten episodes, five of them random, and 200 updates before the first of the others.
fn of_ten_episodes() -> OnlineOptions {
    OnlineOptions {
        control_steps: 10_000,
        prefill: 5,
        first_updates: 200,
        rows_per_step: 64.0,
        ..default_options(default_world("cartpole-swingup").unwrap(), false)
    }
}

#[test]
fn random_episodes_pay_for_no_updates() {
    let options = of_ten_episodes();
    assert_eq!(options.fewest_updates(128, false), 200 + (10_000 / 8 - 6 * 125) / 2);
    assert_eq!(OnlineOptions { prefill: 0, ..options.clone() }.fewest_updates(128, true), 200 + (10_000 / 8 - 125) / 2);
    assert_eq!(OnlineOptions { first_updates: u64::MAX, ..options.clone() }.fewest_updates(128, false), u64::MAX);
    assert_eq!(OnlineOptions { control_steps: 100, ..options }.fewest_updates(128, false), 200);
}

#[test]
fn an_actor_that_would_never_move_is_refused_where_that_was_asked_for() {
    let options = of_ten_episodes();
    assert_eq!(options.fewest_updates(128, false), 450);
    let held = |critic_first| OnlineOptions { critic_first, ..options.clone() }.check_actor_moves(128, false);
    held(449).unwrap();
    let error = held(450).unwrap_err().to_string();
    assert!(error.contains("--critic-first is 450, and about 450 updates"), "{error}");
    let brief = OnlineOptions { control_steps: 100, first_updates: 4, ..options };
    brief.check_actor_moves(128, false).unwrap();
    let anew = OnlineOptions { reset_at: vec![8000], reset_updates: 12, critic_first: 150, ..of_ten_episodes() };
    let error = anew.check_actor_moves(128, false).unwrap_err().to_string();
    assert!(error.contains("about 137 updates are made between two beginnings"), "{error}");
    assert!(OnlineOptions { critic_first: 99, ..brief }.check_actor_moves(128, false).is_err());
}

#[test]
fn the_next_evaluation_is_at_the_next_multiple() {
    let every = |evaluate_every| OnlineOptions {
        evaluate_every,
        ..default_options(default_world("cartpole-swingup").unwrap(), false)
    };
    assert_eq!([0, 9999, 10_000].map(|at| every(10_000).next_evaluation(at)), [10_000, 10_000, 20_000]);
    assert_eq!(every(0).next_evaluation(5), u64::MAX);
}

fn settled(task: &str) -> OnlineOptions {
    let mut options = default_options(default_world(task).unwrap(), false);
    options.settle(Protocol::DcsEasyDynamic500k);
    options
}

#[test]
fn the_protocol_fixes_its_settings_and_refuses_others() {
    let options = settled("cartpole-swingup");
    assert_eq!((options.world.action_repeat, options.control_steps, options.final_episodes), (8, 500_000, 100));
    assert!(options.check().is_ok());
    let changes: [Change; 8] = [
        |options| options.world.video_count = Some(8),
        |options| options.world.steps = 10,
        |options| options.evaluate_mode = false,
        |options| options.world.action_repeat = 4,
        |options| options.control_steps = 100_000,
        |options| options.final_episodes = 10,
        |options| options.world.distractors.dynamic = false,
        |options| options.world.size = None,
    ];
    for change in changes {
        let mut other = options.clone();
        change(&mut other);
        let error = other.check().unwrap_err().to_string();
        assert!(error.contains("dcs-easy-dynamic-500k has"), "{error}");
    }
    let error = settled("swimmer-10").check().unwrap_err().to_string();
    assert!(error.contains("walker-walk"), "{error}");
}

/// A run's returns on held-out videos are of the same videos to its end.
#[test]
fn a_folder_that_holds_out_other_videos_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let films = folder.path().join("films");
    for film in ["a", "b", "c", "d"] {
        std::fs::create_dir_all(films.join(film)).unwrap();
        std::fs::write(films.join(film).join("0.png"), []).unwrap();
    }
    let run = folder.path().join("runs/one");
    std::fs::create_dir_all(&run).unwrap();
    let world = default_world("cartpole-swingup").unwrap();
    let world = WorldOptions { videos: VideoSource::Folder(films.clone()), video_count: Some(1), ..world };
    let options = default_options(world, false);
    options.keep(&run).unwrap();
    assert_eq!(OnlineOptions::read(&run).unwrap().unwrap().held_out_videos, Some(vec!["c".to_owned()]));
    options.keep(&run).unwrap();
    std::fs::rename(films.join("c"), films.join("e")).unwrap();
    let error = options.check_found(&run).unwrap_err().to_string();
    assert!(error.contains("held-out videos") && error.contains("= c") && error.contains("d"), "{error}");
}
