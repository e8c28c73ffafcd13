//! Agents without a world model through the loop, on `known-slide` in tiny pictures: every system goes on exactly where it stopped and is known to every verb, whatever
//! moment the process is killed at; one process at a time.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;
mod synthetic;

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use burn::tensor::Device;
use process::{assert_same, kill_until_done, lines, signal, text};
use serde_json::Value as Json;
use vibes_data::{Latents, Recording, verify_recording};
use vibes_env::distractors::Axes;
use vibes_train::encode::encode_recording;
use vibes_train::evaluate::{EvaluateOptions, evaluate, is_new_to};
use vibes_train::fit::{End, Go};
use vibes_train::learners::model_free::{AgentOptions, system_names};
use vibes_train::learners::recurrent::options::RecurrentOptions;
use vibes_train::learners::sac::options::{SacOptions, Size};
use vibes_train::online::model_free::folder::{FORMAT, Folder, ModelFreeOptions};
use vibes_train::online::model_free::{Event, model_free};
use vibes_train::online::prepare::{default_options, default_world};
use vibes_train::trained::TrainedRun;

const SIDE: u32 = 24;

/// Five episodes of 12 agent steps, three of them random; six updates an episode; a checkpoint every second episode.
fn options(system: &str) -> ModelFreeOptions {
    let mut world = default_world("known-slide").unwrap();
    world.distractors.axes = "none".parse::<Axes>().unwrap();
    (world.size, world.steps) = (Some(SIDE), 12);
    let mut online = default_options(world, false);
    (online.prefill, online.control_steps, online.evaluate_every) = (3, 5 * 24, 48);
    (online.evaluation_episodes, online.final_episodes) = (1, 2);
    ModelFreeOptions {
        format: FORMAT.to_owned(),
        system: system.to_owned(),
        size: Size::Small,
        seed: 3,
        agent: match AgentOptions::system(system, Size::Small).unwrap() {
            AgentOptions::Stacks(options) => {
                AgentOptions::Stacks(SacOptions { batch: 4, hidden: 8, feature: 6, ..options })
            }
            AgentOptions::Recurrent(options) => {
                let sizes = RecurrentOptions { windows: 2, length: 6, depth: 4, memory: 8, latent: 6, ..options };
                AgentOptions::Recurrent(RecurrentOptions { head: 8, hidden: 8, ..sizes })
            }
        },
        updates_per_step: 0.5,
        save_every: 2,
        online,
    }
}

/// Trains, and stops after `updates` updates.
fn train(path: &Path, options: ModelFreeOptions, updates: u64) -> End {
    let folder = Folder::create_or_open(path, options).unwrap();
    let mut made = 0;
    let end = model_free(&folder, &Device::flex(), &mut |event| {
        made += u64::from(matches!(event, Event::Update));
        if made >= updates { Go::Stop } else { Go::On }
    });
    end.unwrap()
}

#[test]
fn every_system_goes_on_exactly_where_it_stopped_and_is_encoded_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let grid = synthetic::recording(&folder.path().join("grid"), SIDE, 8, 12, true);
    let device = Device::flex();
    for system in system_names() {
        let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(format!("{system}-{name}")));
        assert_eq!(train(&whole, options(system), u64::MAX), End::Updates, "{system}");
        for stop_at in [1, 3] {
            assert_eq!(train(&parts, options(system), stop_at), End::Stopped, "{system}");
        }
        assert_eq!(train(&parts, options(system), u64::MAX), End::Updates, "{system}");
        assert_same(&whole, &parts, &format!("after two stops of {system}"));

        let replay = Recording::open(&whole.join("replay")).unwrap();
        assert!(verify_recording(&replay).is_empty(), "{system}");
        let run = TrainedRun::open(&whole).unwrap();
        let (trained, checkpoint) = run.load(&device).unwrap();
        let output = whole.join("latents.arrow");
        encode_recording(trained.encoder(), &checkpoint, &replay, &output, &device, &mut |_| {}).unwrap();
        let latents = Latents::read(&output).unwrap();
        assert_eq!((latents.step.len(), latents.dims), (5 * 13, trained.encoder().latent()), "{system}");
        assert!(latents.latent.iter().all(|value| value.is_finite()), "{system}");
        let fitted = run.open_recordings().unwrap();
        let report = evaluate(trained.encoder(), &grid, &fitted, EvaluateOptions::default(), &device).unwrap();
        let retrieval = report.numbers.get("retrieval_same_step@1").unwrap().value.estimate;
        assert!((0.0..=1.0).contains(&retrieval), "{system}: {retrieval}");
        assert!(report.numbers.get("open_loop_reward_r2@1").is_none(), "{system} predicts nothing");
        let has_actor = options(system).agent.has_actor();
        let metrics = lines(&whole.join("metrics.jsonl"));
        assert_eq!(metrics.iter().any(|line| line["temperature"].is_f64()), has_actor, "{system}");
        let summary = std::fs::read_to_string(whole.join("summary.md")).unwrap();
        // Nobody sees a video in this task.
        assert!(summary.contains(system) && summary.contains("| control steps | episodes | return |"), "{summary}");
    }
}

/// A copy that lacks the replay does not say what it has learned from, so that nobody knows whether a grid is new to it.
#[test]
fn whether_a_grid_is_new_to_a_run_without_its_replay_is_not_known() {
    let folder = tempfile::tempdir().unwrap();
    let grid = synthetic::recording(&folder.path().join("grid"), SIDE, 2, 12, true);
    let run = folder.path().join("run");
    assert_eq!(train(&run, options("sac-drq"), u64::MAX), End::Updates);
    let is_new = || is_new_to(&grid, &TrainedRun::open(&run).unwrap().seen());
    assert_eq!(is_new(), Some(true));
    std::fs::remove_dir_all(run.join("replay")).unwrap();
    assert_eq!(is_new(), None);
}

/// Eight episodes.
const WHOLE: u32 = 320;
/// More than anybody waits for.
const LONG: u32 = 1_000_000;

/// The same as a process.
fn command(folder: &Path, system: &str, control_steps: u32) -> Command {
    let agent = if system.starts_with("qt-opt") { "qt-opt" } else { "sac" };
    let transitions = if ["rsac", "core"].contains(&system) { 32 } else { 4 };
    let line = format!(
        "online --task known-slide --distract none --size {SIDE} --agent {agent} --system {system} --transitions {transitions} --steps 20 --prefill 3 --save-every 2 \
         --control-steps {control_steps} --evaluate-every 96 --evaluation-episodes 1 --final-episodes 2"
    );
    let mut command = process::program();
    command.args(line.split_whitespace()).arg("-o").arg(folder);
    command
}

#[test]
fn however_often_it_is_killed_the_same_command_ends_with_the_same_bytes() {
    for system in ["sac-drq", "sar", "core"] {
        let folder = tempfile::tempdir().unwrap();
        let [undisturbed, killed] = ["undisturbed", "killed"].map(|name| folder.path().join(name));
        let output = command(&undisturbed, system, WHOLE).output().unwrap();
        assert!(output.status.success(), "{}", text(&output));
        let kills = kill_until_done(|| command(&killed, system, WHOLE), 100..1200);
        assert!(kills >= 2, "{kills} kills");
        assert_same(&undisturbed, &killed, &format!("after {kills} kills of {system}"));
    }
}

fn wait_until(what: &str, process: &mut Child, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(process.try_wait().unwrap().is_none(), "it ended before {what}");
        assert!(begun.elapsed() < Duration::from_secs(120), "no end of waiting until {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_second_process_is_refused_with_the_owners_name_and_the_first_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let mut first = command(&run, "sac-drq", LONG).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    wait_until("it owned the run", &mut first, || run.join("replay/episodes").exists());
    let second = command(&run, "sac-drq", LONG).output().unwrap();
    assert_eq!(second.status.code(), Some(75), "{}", text(&second));
    assert!(text(&second).contains(&format!("process {}", first.id())), "{}", text(&second));
    signal(&first, "TERM");
    assert_eq!(first.wait().unwrap().code(), Some(75), "saved, to be started again");
    let last = command(&run, "sac-drq", 40).output().unwrap();
    assert!(last.status.success(), "{}", text(&last));
}

#[test]
fn it_says_what_it_is_and_what_it_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let output = command(&run, "curl", 160).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let verb = |arguments: &[&str]| process::program().args(arguments).arg(&run).output().unwrap();
    let said = text(&verb(&["info"]));
    assert!(said.contains("curl, small") && said.contains("features of the critics, 50"), "{said}");
    assert!(said.contains("160 of 160 control steps"), "{said}");
    let said: Json = serde_json::from_slice(&verb(&["info", "--json"]).stdout).unwrap();
    assert_eq!((&said["info"]["system"], &said["last"]["control_steps"]), (&Json::from("curl"), &Json::from(160)));
    // How often it is saved may change where a run is gone on with.
    let again = process::program().arg("online").arg(&run).args(["--save-every", "7"]).output().unwrap();
    assert!(again.status.success() && text(&again).contains("already"), "{}", text(&again));
    assert_eq!(Folder::open(&run).unwrap().unwrap().options().save_every, 7);
    let refused = process::program().args(["decode"]).arg(&run).arg(run.join("replay")).output().unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused).contains("no world model"), "{}", text(&refused));
    // A run with a world model is not begun where one without lies.
    let other =
        process::program().args(["online", "--task", "known-slide", "--no-pixels", "-o"]).arg(&run).output().unwrap();
    assert!(!other.status.success() && text(&other).contains("no world model"), "{}", text(&other));
}
