//! What a run does that is stopped, out of time, or begun with what cannot be; and what a panic of the thread that acts leaves behind. The panic is caused where a driver or a
//! network would cause it, on the stage between two episodes of the thread's own.

use std::path::Path;

use vibes_data::{RunFolder, verify_recording};
use vibes_env::distractors::{Axes, DistractorSettings};
use vibes_env::videos::VideoSet;
use vibes_env::{Trained, rollout_frames};
use vibes_model::actions::Choice;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use super::actor::{EpisodeKind, Lived, Task, episode_seed};
use super::model_free::folder::{FORMAT, Folder, ModelFreeOptions};
use super::model_free::{model_free_living, model_free_under};
use super::options::GivenFrom;
use super::prepare::Prepared;
use super::*;
use crate::error::TrainError;
use crate::learners::model_free::AgentOptions;
use crate::learners::sac::options::{SacOptions, Size};
use crate::options::Options;

/// The number of the episode that is not lived through.
const FATAL: u32 = 4;

fn struck(stage: &mut actor::Stage<'_>, task: Task) -> Result<Lived> {
    assert!(task.keep.as_ref().is_none_or(|(number, _)| *number != FATAL), "the driver lost its context");
    stage.live(task)
}

fn options() -> OnlineOptions {
    let world = prepare::default_world("known-slide").unwrap();
    let distractors = DistractorSettings { axes: Axes::NONE, ..world.distractors };
    let world = options::WorldOptions { steps: 20, size: None, distractors, ..world };
    OnlineOptions {
        control_steps: 8 * 40,
        rows_per_step: 8.0,
        prefill: 2,
        first_updates: 4,
        critic_first: 2,
        evaluate_every: 0,
        evaluation_episodes: 1,
        final_episodes: 1,
        ..prepare::default_options(world, false)
    }
}

/// The run at `path` as far as it gets, by an actor's thread that lives in this way.
fn with_a_world_model(path: &Path, live: Living) -> Result<End> {
    lived(path, options(), 0.0, live, &mut |_| Go::On)
}

fn tiny() -> Options {
    let mut model = Options::preset("tiny").unwrap();
    model.settings.checkpoint_every = 8;
    model
}

fn lived(
    path: &Path,
    options: OnlineOptions,
    minutes: f64,
    live: Living,
    listen: &mut dyn FnMut(Event<'_>) -> Go,
) -> Result<End> {
    let mut model = tiny();
    model.settings.minutes = minutes;
    let prepared = prepare::from_nothing(path, &model, options)?;
    let setup =
        Setup { run: &prepared.run, options: &prepared.options, given: &prepared.given, device: &Device::flex() };
    online_living(live, setup.options.world.libraries()?, &setup, listen)
}

/// The lines of evaluations, whether each is the last one.
fn finals(run: &Path) -> Vec<bool> {
    let text = std::fs::read_to_string(run.join("evaluations.jsonl")).unwrap();
    let line = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["is_final"] == true;
    text.lines().map(line).collect()
}

/// The options of the same from pictures, without a world model, in episodes of so many steps.
fn model_free_options(steps: u32) -> ModelFreeOptions {
    let agent = match AgentOptions::system("sac-drq", Size::Small).unwrap() {
        AgentOptions::Stacks(system) => AgentOptions::Stacks(SacOptions { batch: 4, ..system }),
        other @ AgentOptions::Recurrent(_) => other,
    };
    let world = options::WorldOptions { size: Some(24), steps, ..options().world };
    ModelFreeOptions {
        format: FORMAT.to_owned(),
        system: "sac-drq".to_owned(),
        size: Size::Small,
        seed: 0,
        agent,
        updates_per_step: 0.1,
        save_every: 1,
        online: OnlineOptions { world, ..options() },
    }
}

/// A system may have another number since; what can be asked for may not differ.
#[test]
fn a_run_goes_on_with_its_own_rates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let with = |change: fn(SacOptions) -> SacOptions| {
        let options = model_free_options(20);
        let AgentOptions::Stacks(agent) = options.agent else { panic!("sac-drq looks at stacks") };
        ModelFreeOptions { agent: AgentOptions::Stacks(change(agent)), ..options }
    };
    let older = with(|agent| SacOptions { encoder_rate: 0.05, ..agent });
    drop(Folder::create_or_open(&path, older.clone()).unwrap());
    let gone_on = Folder::create_or_open(&path, with(|agent| agent)).unwrap();
    assert_eq!(gone_on.options().agent, older.agent);
    drop(gone_on);
    assert_eq!(Folder::open(&path).unwrap().unwrap().options().agent, older.agent);
    let error = Folder::create_or_open(&path, with(|agent| SacOptions { views: 2, ..agent })).unwrap_err();
    assert!(error.to_string().contains("views"), "{error}");
}

/// Such a run at `path` as far as it gets.
fn without(path: &Path, live: Living) -> Result<End> {
    let folder = Folder::create_or_open(path, model_free_options(options().world.steps)).unwrap();
    let libraries = folder.options().online.world.libraries()?;
    model_free_living(live, libraries, &folder, &Device::flex(), &mut |_| Go::On)
}

/// Weights of the newest checkpoint and everything that was lived through, by their places.
fn left_behind(run: &Path) -> Vec<(String, Vec<u8>)> {
    let newest = RunFolder::at(run).newest_checkpoint().unwrap();
    let files = |folder: &Path, ending: &str| {
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut found: Vec<_> = names.filter(|path| path.to_string_lossy().ends_with(ending)).collect();
        found.sort();
        found
    };
    let all = [files(&newest, ".safetensors"), files(&run.join("replay/episodes"), ".arrow")].concat();
    let place = |path: &Path| path.strip_prefix(run).unwrap().display().to_string();
    all.iter().map(|path| (place(path), std::fs::read(path).unwrap())).collect()
}

#[test]
fn a_thread_that_panics_is_an_error_with_its_words_and_the_run_goes_on_later() {
    let loops: [fn(&Path, Living) -> Result<End>; 2] = [with_a_world_model, without];
    for train in loops {
        let folder = tempfile::tempdir().unwrap();
        let [undisturbed, shaken] = ["undisturbed", "shaken"].map(|name| folder.path().join(name));
        assert_eq!(train(&undisturbed, actor::as_it_is).unwrap(), End::Updates);
        let error = train(&shaken, struck).unwrap_err();
        assert!(matches!(&error, TrainError::Panicked { panic, .. } if panic.contains("lost its context")), "{error}");
        let said = error.to_string();
        assert!(
            said.contains("everything up to the last checkpoint is kept") && said.contains("same command"),
            "{said}"
        );
        let replay = Recording::open(&shaken.join("replay")).unwrap();
        assert_eq!(replay.episodes().len(), FATAL as usize, "every whole episode is listed");
        assert!(verify_recording(&replay).is_empty());
        assert_eq!(train(&shaken, actor::as_it_is).unwrap(), End::Updates);
        let (wanted, found) = (left_behind(&undisturbed), left_behind(&shaken));
        assert!(wanted.len() > 8);
        for ((place, wanted), (other, found)) in wanted.iter().zip(&found) {
            assert!(place == other && wanted == found, "{place} {other}");
        }
    }
}

#[test]
fn a_run_that_is_stopped_anywhere_stops_there_and_the_same_command_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let options = OnlineOptions { first_updates: 250, evaluate_every: 80, ..options() };
    stopped_anywhere(folder.path(), &options, &[2, 4, 30, 150]);
}

/// In the updates after a beginning anew as in the first ones; the weights are new ones, and schedules count from there.
#[test]
fn a_run_that_begins_anew_on_the_way_can_be_stopped_anywhere_too() {
    let folder = tempfile::tempdir().unwrap();
    let resets = OnlineOptions { reset_at: vec![150, 240], reset_updates: 45, ..options() };
    stopped_anywhere(folder.path(), &resets, &[2, 40, 60, 70, 110, 130]);
    let newest = RunFolder::at(&folder.path().join("undisturbed")).newest_checkpoint().unwrap();
    let read = |file: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(newest.join(file)).unwrap()).unwrap()
    };
    let (world, online) = (read("state.json"), read("online.json"));
    assert_eq!(online["resets"], 2, "{online}");
    let since = online["updates"].as_u64().unwrap() - online["updates_before_reset"].as_u64().unwrap();
    // The last time after 240 of 320 control steps: two more episodes, of which each pays for less than an update an agent step.
    assert!((45..45 + 2 * 20).contains(&since), "{online}");
    assert_eq!(world["optimizer_steps"], since, "{world}");
    assert_eq!(online["critic_steps"], since, "{online}");
    assert_eq!(world["anew_from"].as_u64().unwrap() + since, world["update"].as_u64().unwrap(), "{world}");
}

/// A run of these options ends with the same bytes as `undisturbed` whenever it is stopped.
fn stopped_anywhere(folder: &Path, options: &OnlineOptions, places: &[usize]) {
    let undisturbed = folder.join("undisturbed");
    let mut events = 0;
    let count = &mut |_: Event<'_>| {
        events += 1;
        Go::On
    };
    assert_eq!(lived(&undisturbed, options.clone(), 0.0, actor::as_it_is, count).unwrap(), End::Updates);
    let wanted = left_behind(&undisturbed);
    // In the random episodes, at the first evaluation, in the first updates, in a round, before the last evaluation.
    for stop_at in places.iter().copied().chain([events - 3, events - 1]) {
        let run = folder.join(format!("stopped-{stop_at}"));
        let (mut seen, mut after) = (0, 0);
        let stop = &mut |event: Event<'_>| {
            seen += 1;
            after += usize::from(seen > stop_at && matches!(event, Event::Update));
            if seen >= stop_at { Go::Stop } else { Go::On }
        };
        let end = lived(&run, options.clone(), 0.0, actor::as_it_is, stop).unwrap();
        assert!(end == End::Stopped || seen + 3 > events, "{end:?} at {stop_at} of {events}");
        assert!(after < 100, "{after} updates after it was to stop at {stop_at}");
        lived(&run, options.clone(), 0.0, actor::as_it_is, &mut |_| Go::On).unwrap();
        assert!(wanted == left_behind(&run), "stopped at {stop_at} of {events}");
        assert_eq!(finals(&run), finals(&undisturbed), "stopped at {stop_at} of {events}");
    }
}

/// The last evaluation of a run, stopped after two of its five episodes, makes the other three.
#[test]
fn an_evaluation_that_was_stopped_goes_on_with_its_next_episode() {
    let folder = tempfile::tempdir().unwrap();
    let options = OnlineOptions { final_episodes: 5, ..options() };
    let go = |name: &str, most: usize| {
        let mut judged = 0;
        let end = lived(&folder.path().join(name), options.clone(), 0.0, actor::as_it_is, &mut |event| {
            judged += usize::from(matches!(event, Event::Judged));
            if judged >= most && matches!(event, Event::Judged) { Go::Stop } else { Go::On }
        });
        (end.unwrap(), judged)
    };
    let begun = |name: &str| folder.path().join(name).join("evaluating.json").exists();
    let evaluations = |name: &str| std::fs::read(folder.path().join(name).join("evaluations.jsonl")).unwrap();
    assert_eq!(go("undisturbed", 99), (End::Updates, 5));
    assert_eq!((go("stopped", 2), begun("stopped")), ((End::Stopped, 2), true));
    assert_eq!((go("stopped", 99), begun("stopped")), ((End::Updates, 3), false));
    assert_eq!(evaluations("stopped"), evaluations("undisturbed"));
}

/// Random episodes depend on the seed alone, so that those of a run which was stopped before it learned anything are kept.
#[test]
fn random_episodes_are_not_lived_through_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let first = run.join("replay/episodes/000000.arrow");
    let stop = &mut |event: Event<'_>| if matches!(event, Event::Lived { .. }) { Go::Stop } else { Go::On };
    assert_eq!(lived(&run, options(), 0.0, actor::as_it_is, stop).unwrap(), End::Stopped);
    let written = std::fs::metadata(&first).unwrap().modified().unwrap();
    assert_eq!(lived(&run, options(), 0.0, actor::as_it_is, &mut |_| Go::On).unwrap(), End::Updates);
    assert_eq!(std::fs::metadata(&first).unwrap().modified().unwrap(), written);
}

#[test]
fn a_run_whose_minutes_are_up_is_evaluated_once_and_goes_on_with_more_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let go = |minutes| lived(&run, options(), minutes, actor::as_it_is, &mut |_| Go::On).unwrap();
    assert_eq!([go(1e-4), go(1e-4)], [End::Minutes, End::Nothing]);
    assert_eq!(finals(&run).iter().filter(|is_final| **is_final).count(), 1);
    assert_eq!([go(0.0), go(0.0)], [End::Updates, End::Nothing]);
    assert_eq!(finals(&run).iter().filter(|is_final| **is_final).count(), 2);
}

/// The minutes are up within the first updates; with more of them the run is saved again at the same control steps, before it is over.
#[test]
fn an_end_that_was_saved_stays_however_often_the_run_is_stopped_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let options = OnlineOptions { first_updates: 100, ..options() };
    let go = |minutes: f64, listen: &mut dyn FnMut(Event<'_>) -> Go| {
        let end = lived(&run, options.clone(), minutes, actor::as_it_is, listen).unwrap();
        (end, finals(&run).into_iter().filter(|is_final| *is_final).count())
    };
    let stop = &mut |event: Event<'_>| if matches!(event, Event::Update) { Go::Stop } else { Go::On };
    assert_eq!(go(1e-4, &mut |_| Go::On), (End::Minutes, 1));
    assert_eq!(go(0.0, stop), (End::Stopped, 1));
    assert_eq!(go(0.0, stop), (End::Stopped, 1));
    assert_eq!(go(0.0, &mut |_| Go::On), (End::Updates, 2));
}

#[test]
fn an_episode_without_a_window_is_refused_before_anything_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let short = OnlineOptions { world: options::WorldOptions { steps: 7, ..options().world }, ..options() };
    let error = prepare::from_nothing(&run, &tiny(), short).unwrap_err().to_string();
    assert!(error.contains("--steps is 7, and a window has 8 rows") && !run.exists(), "{error}");
    let error = Folder::create_or_open(&run, model_free_options(2)).unwrap_err().to_string();
    assert!(error.contains("--steps is 2"), "{error}");
}

/// What is refused leaves no folder that would be in the way of larger pictures.
#[test]
fn pictures_that_the_networks_cannot_take_are_refused_before_anything_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    for system in ["sac-drq", "core"] {
        let mut options = model_free_options(20);
        options.agent = AgentOptions::system(system, Size::Small).unwrap();
        options.online.world.size = Some(10);
        let error = Folder::create_or_open(&run, options).unwrap_err().to_string();
        assert!(error.contains("too small") && !run.exists(), "{system}: {error}");
    }
}

/// An offline run of three updates at `offline`, on the replay of an online run at `first`.
fn offline_run(first: &Path, offline: &Path) -> (Run, [Recording; 1], Options) {
    with_a_world_model(first, actor::as_it_is).unwrap();
    let replay = [Recording::open(&first.join("replay")).unwrap()];
    let mut model = tiny();
    model.settings.updates = 3;
    let run = crate::prepare::prepare(offline, &replay, &model, None).unwrap();
    crate::fit::fit(&run, &replay, &Device::flex(), None, &mut |_| Go::On).unwrap();
    (run, replay, model)
}

/// Of two recordings with the same episodes one is gone.
#[test]
fn what_is_left_of_a_runs_recordings_is_counted_and_known() {
    let folder = tempfile::tempdir().unwrap();
    let [first, offline, copy, both] = ["first", "offline", "copy", "both"].map(|name| folder.path().join(name));
    let (_, [replay], model) = offline_run(&first, &offline);
    std::fs::create_dir_all(copy.join("episodes")).unwrap();
    let files = replay.episodes().iter().map(|entry| entry.arrow.path.clone()).chain(["manifest.json".to_owned()]);
    for file in files {
        std::fs::copy(replay.path().join(&file), copy.join(&file)).unwrap();
    }
    let recordings = [Recording::open(&copy).unwrap(), replay.clone()];
    let run = crate::prepare::prepare(&both, &recordings, &model, None).unwrap();
    crate::fit::fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    assert!(run.seen().is_whole);
    std::fs::remove_dir_all(&copy).unwrap();
    let options = OnlineOptions { given_share: 0.0, ..options() };
    let prepared = prepare::from_run(&folder.path().join("on"), &run, &model, options).unwrap();
    // What is gone is counted by run.json, which has the episodes of both.
    let given = (prepared.options.given_control_steps, prepared.options.given_from);
    assert_eq!(given, (Some(640), Some(GivenFrom::RunFile)));
    // A run that was begun before that was kept is told what is left.
    let older = OnlineOptions { given_control_steps: None, given_from: None, ..prepared.options.clone() };
    assert_eq!(beginning::given_control_steps(&prepared.run, &older, &[]), Some(320));
    let seen = prepared.run.seen();
    assert_eq!((seen.recordings.len(), seen.is_whole), (1, false));
    assert_eq!(crate::evaluate::is_new_to(&replay, &seen), Some(false), "through the run that it goes on from");
}

#[test]
fn an_offline_run_is_gone_on_from_with_its_own_sizes_and_action_repeat_alone() {
    let folder = tempfile::tempdir().unwrap();
    let [first, offline] = ["first", "offline"].map(|name| folder.path().join(name));
    let (run, replay, model) = offline_run(&first, &offline);
    let from = |name: &str, change: &dyn Fn(&mut Options, &mut OnlineOptions)| {
        let (mut model, mut online) = (model.clone(), options());
        change(&mut model, &mut online);
        prepare::from_run(&folder.path().join(name), &run, &model, online)
    };
    let refused = |name: &str, change: &dyn Fn(&mut Options, &mut OnlineOptions)| {
        let error = from(name, change).unwrap_err().to_string();
        assert!(!folder.path().join(name).exists(), "{error}");
        error
    };
    let error = refused("wide", &|model, _| model.settings.hidden = 64);
    assert!(error.contains("begin from a run of the same task, sizes and objective"), "{error}");
    assert!(error.contains("this run's has hidden 64;") && !error.contains("action"), "what differs alone: {error}");
    let error = refused("held", &|_, online| online.world.action_repeat = 5);
    assert!(error.contains("actions held for 2 control steps") && error.contains("--action-repeat"), "{error}");
    // Neither takes the folder of the other.
    let error = from("offline", &|_, _| {}).unwrap_err().to_string();
    assert!(error.contains("an offline run is at") && !offline.join("online.json").exists(), "{error}");
    let error = crate::prepare::prepare(&first, &replay, &model, None).unwrap_err().to_string();
    assert!(error.contains("an online run is at"), "{error}");
    let prepared = from("as-it-is", &|_, _| {}).unwrap();
    assert_eq!(prepared.run.info().model, run.info().model);
    let setup =
        Setup { run: &prepared.run, options: &prepared.options, given: &prepared.given, device: &Device::flex() };
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
    // A term that begins with the online run brings a head of its own.
    let added = from("added", &|model, _| {
        *model = model.with(&[("a test", toml::toml! { inverse_weight = 0.5 })]).unwrap();
    });
    let added = added.unwrap();
    let setup = Setup { run: &added.run, options: &added.options, given: &added.given, device: &Device::flex() };
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
}

/// With recordings in every batch, a share of them that is no whole number of windows, and schedules that count on from the run before.
#[test]
fn a_run_that_went_on_from_an_offline_one_can_be_stopped_anywhere_too() {
    let folder = tempfile::tempdir().unwrap();
    let [first, offline, undisturbed] = ["first", "offline", "undisturbed"].map(|name| folder.path().join(name));
    let (from, _, model) = offline_run(&first, &offline);
    let asked = OnlineOptions { prefill: 0, given_share: 0.7, rows_per_step: 7.3, evaluate_every: 80, ..options() };
    let go = |run: &Path, listen: &mut dyn FnMut(Event<'_>) -> Go| {
        let prepared = prepare::from_run(run, &from, &model, asked.clone()).unwrap();
        let Prepared { run, options, given } = &prepared;
        online(&Setup { run, options, given, device: &Device::flex() }, listen).unwrap()
    };
    let mut events = 0;
    let counted = go(&undisturbed, &mut |_| {
        events += 1;
        Go::On
    });
    assert_eq!(counted, End::Updates);
    let evaluations = |run: &Path| std::fs::read_to_string(run.join("evaluations.jsonl")).unwrap();
    // The recording is of 8 episodes of 20 agent steps.
    assert!(evaluations(&undisturbed).lines().all(|line| line.contains("\"given_control_steps\":320")));
    for stop_at in [2, events / 3, events / 2, events - 2] {
        let run = folder.path().join(format!("stopped-{stop_at}"));
        let mut seen = 0;
        let end = go(&run, &mut |_| {
            seen += 1;
            if seen >= stop_at { Go::Stop } else { Go::On }
        });
        assert_eq!(end, End::Stopped, "at {stop_at} of {events}");
        go(&run, &mut |_| Go::On);
        assert!(left_behind(&run) == left_behind(&undisturbed), "stopped at {stop_at} of {events}");
        assert_eq!(evaluations(&run), evaluations(&undisturbed), "stopped at {stop_at} of {events}");
    }
}

/// What the gap between the two sets of videos rests on.
#[test]
fn an_episode_of_either_set_of_videos_has_the_start_camera_and_colours_of_the_other() {
    let world = prepare::default_world("cartpole-swingup").unwrap();
    let world = options::WorldOptions { size: Some(24), steps: 3, ..world };
    let seen = |set| {
        let mut eyes = world.eyes(world.video_library(set).unwrap()).unwrap();
        let mut still = Trained::new("still".to_owned(), None, |_, _, _| Ok(vec![0.0]));
        let seed = episode_seed(5, EpisodeKind::Evaluation, 1);
        rollout_frames(&mut eyes, &mut still, world.steps, seed.into()).unwrap().1
    };
    let [known, new] = [VideoSet::Train, VideoSet::Val].map(seen);
    assert_eq!((&known.qpos, &known.cameras, &known.colors), (&new.qpos, &new.cameras, &new.colors));
    assert!(known.pixels != new.pixels, "the videos are others");
}

/// A run's own evaluation and a policy that is loaded from its checkpoint are one way of acting.
#[test]
fn the_last_evaluation_is_what_the_saved_agent_does_in_the_one_loop() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    with_a_world_model(&run, actor::as_it_is).unwrap();
    let text = std::fs::read_to_string(run.join("evaluations.jsonl")).unwrap();
    let line: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let newest = RunFolder::at(&run).newest_checkpoint().unwrap();
    let agent = TrainedAgent::load(&newest, &Device::flex()).unwrap();
    let mut player = Player::new(agent, Choice::Mode, 0.0);
    let mut policy = Trained::new("saved".to_owned(), None, move |sight, is_first, mut rng| {
        player.act(is_first, sight.pixels, sight.observation, &mut rng).map_err(Into::into)
    });
    let world = options().world;
    let mut eyes = world.eyes(world.video_library(VideoSet::Val).unwrap()).unwrap();
    let seed = episode_seed(tiny().seed, EpisodeKind::Final, 0);
    let (_, episode) = rollout_frames(&mut eyes, &mut policy, world.steps, seed.into()).unwrap();
    assert_eq!(line["held_out"]["returns"][0].as_f64(), Some(episode.episode_return()), "{line}");
}

/// The options of a run with the protocol put in after the check that would refuse such a short one; its folder says them.
fn put_under_a_protocol(run: &Path, options: OnlineOptions) -> OnlineOptions {
    let options = OnlineOptions { protocol: Some(protocol::Protocol::DcsEasyDynamic500k), ..options };
    std::fs::write(run.join("online.json"), serde_json::to_string(&options).unwrap()).unwrap();
    options
}

/// A protocol is named in every line and on every page about a run, which must be able to read them.
#[test]
fn a_run_under_a_protocol_is_saved_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let prepared = prepare::from_nothing(&path, &tiny(), options()).unwrap();
    let options = OnlineOptions { evaluate_every: 100, ..prepared.options };
    let options = put_under_a_protocol(&path, options);
    let setup = Setup { run: &prepared.run, options: &options, given: &prepared.given, device: &Device::flex() };
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
    let rows = crate::metrics::read_rows(&path.join("metrics.jsonl")).unwrap();
    assert!(rows.len() > 2 && rows.iter().all(|row| row.objective.is_finite()), "{rows:?}");
    for file in ["metrics.jsonl", "evaluations.jsonl"] {
        let text = std::fs::read_to_string(path.join(file)).unwrap();
        assert!(text.lines().count() > 2, "{file}: {text}");
        let is_named = |line: &str| line.contains("\"protocol\":\"dcs-easy-dynamic-500k\"");
        assert!(text.lines().all(is_named), "{file}: {text}");
    }
    let page = std::fs::read_to_string(path.join("summary.md")).unwrap();
    assert!(page.contains("320 control steps") && page.contains("| 1, of other starts |"), "{page}");
    assert!(page.contains("* protocol dcs-easy-dynamic-500k"), "{page}");
    let replay = Recording::open(&path.join("replay")).unwrap();
    assert_eq!(replay.manifest().options["protocol"], "dcs-easy-dynamic-500k");
}

/// A replay that was begun before it named the protocol is the same recording, and goes on as it is.
#[test]
fn an_older_replay_goes_on_without_the_name_of_its_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let prepared = prepare::from_nothing(&path, &tiny(), options()).unwrap();
    let options = put_under_a_protocol(&path, prepared.options);
    let setup = Setup { run: &prepared.run, options: &options, given: &prepared.given, device: &Device::flex() };
    let stop = &mut |event: Event<'_>| if matches!(event, Event::Lived { .. }) { Go::Stop } else { Go::On };
    assert_eq!(online(&setup, stop).unwrap(), End::Stopped);
    let replay = path.join("replay");
    let mut manifest = Recording::open(&replay).unwrap().manifest().clone();
    assert_eq!(manifest.options.as_object_mut().unwrap().remove("protocol").unwrap(), "dcs-easy-dynamic-500k");
    manifest.write(&replay.join("manifest.json")).unwrap();
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
    let whole = Recording::open(&replay).unwrap();
    assert_eq!((whole.episodes().len(), whole.manifest().options.get("protocol")), (8, None));
}

/// Returns under videos that a run has learned under are not those of new ones, and every line says so.
#[test]
fn an_evaluation_under_videos_that_were_seen_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let prepared = prepare::from_nothing(&path, &tiny(), options()).unwrap();
    let options = OnlineOptions {
        held_out_seen: vec!["tiles-000".to_owned()],
        given_control_steps: Some(320),
        given_from: Some(GivenFrom::RunFile),
        ..prepared.options
    };
    std::fs::write(path.join("online.json"), serde_json::to_string(&options).unwrap()).unwrap();
    let setup = Setup { run: &prepared.run, options: &options, given: &prepared.given, device: &Device::flex() };
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
    let text = std::fs::read_to_string(path.join("evaluations.jsonl")).unwrap();
    let said = "\"given_control_steps\":320,\"given_from\":\"run.json\",\"is_held_out\":false";
    assert!(text.lines().all(|line| line.contains(said)), "{text}");
    let page = std::fs::read_to_string(path.join("summary.md")).unwrap();
    assert!(
        page.contains("* began with 320 control steps of recordings and of runs before it (of those that are gone"),
        "{page}"
    );
    assert!(page.contains("no recordings in its batches") && page.contains("nothing of new videos"), "{page}");
}

/// Videos are opened once, while a signal is heard: a run takes those that it is handed.
#[test]
fn a_run_is_under_the_videos_that_were_opened_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let axes = Axes { background: true, ..Axes::NONE };
    let world = options().world;
    let distractors = DistractorSettings { axes, ..world.distractors };
    let world = options::WorldOptions { size: Some(24), distractors, ..world };
    let opened = options::WorldOptions { video_count: Some(1), ..world.clone() }.libraries().unwrap();
    let videos = |run: &Path| Recording::open(&run.join("replay")).unwrap().manifest().videos.len();
    let path = folder.path().join("run");
    let mut model = tiny();
    model.settings.observations = crate::settings::Observations::Vectors;
    let asked = OnlineOptions { world: world.clone(), ..options() };
    let Prepared { run, options, given } = &prepare::from_nothing(&path, &model, asked).unwrap();
    let setup = Setup { run, options, given, device: &Device::flex() };
    assert_eq!(online_under(opened.clone(), &setup, &mut |_| Go::Stop).unwrap(), End::Stopped);
    assert_eq!(videos(&path), 1);
    let path = folder.path().join("model-free");
    let asked = model_free_options(20);
    let asked = ModelFreeOptions { online: OnlineOptions { world, ..asked.online }, ..asked };
    let run = Folder::create_or_open(&path, asked).unwrap();
    assert_eq!(model_free_under(opened, &run, &Device::flex(), &mut |_| Go::Stop).unwrap(), End::Stopped);
    assert_eq!(videos(&path), 1);
}

/// An agent that looks at numbers sees no video, also where the world is drawn.
#[test]
fn who_sees_no_video_has_no_gap() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let axes = Axes { background: true, ..Axes::NONE };
    let world = options().world;
    let distractors = DistractorSettings { axes, ..world.distractors };
    let world = options::WorldOptions { size: Some(24), distractors, ..world };
    let mut model = tiny();
    model.settings.observations = crate::settings::Observations::Vectors;
    let prepared = prepare::from_nothing(&path, &model, OnlineOptions { world, ..options() }).unwrap();
    let Prepared { run, options, given } = &prepared;
    online(&Setup { run, options, given, device: &Device::flex() }, &mut |_| Go::On).unwrap();
    let text = std::fs::read_to_string(path.join("evaluations.jsonl")).unwrap();
    assert!(text.contains("held_out") && !text.contains("gap"), "{text}");
}

/// A checkpoint that lacks a file is damaged, whichever it is, rather than gone on with as if it were another.
#[test]
fn a_checkpoint_that_lacks_a_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut asked = options();
    asked.behaviour.guard = 1.0;
    let go =
        || lived(&path, OnlineOptions { control_steps: 400, ..asked.clone() }, 0.0, actor::as_it_is, &mut |_| Go::On);
    lived(&path, asked.clone(), 0.0, actor::as_it_is, &mut |_| Go::On).unwrap();
    let newest = RunFolder::at(&path).newest_checkpoint().unwrap();
    let names: Vec<_> = std::fs::read_dir(&newest).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(names.len(), 7, "{names:?}");
    for place in names.iter().filter(|place| !place.ends_with("behaviour_optimizer.safetensors")) {
        let aside = path.join("aside");
        std::fs::rename(place, &aside).unwrap();
        let error = go().unwrap_err().to_string();
        assert!(error.contains("checkpoint"), "{}: {error}", place.display());
        std::fs::rename(&aside, place).unwrap();
    }
    assert_eq!(go().unwrap(), End::Updates);
}
