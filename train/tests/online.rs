//! Online training as a process: what it leaves behind, that it can be killed at any moment, and what it refuses. On `known-slide`, from vector observations: no
//! picture is drawn.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;

use std::path::Path;
use std::process::{Command, Output};

use process::{assert_same, files, kill_until_done, lines, text};
use serde_json::Value as Json;
use vibes_data::{Recording, verify_recording};

/// Episodes of 40 agent steps (80 control steps), 21 updates and a quarter an episode, a checkpoint every 40 updates.
const QUICK: [&str; 13] = [
    "--no-pixels",
    "--steps",
    "40",
    "--rows-per-step",
    "17",
    "--first-updates",
    "20",
    "--checkpoint-every",
    "40",
    "--evaluate-every",
    "400",
    "--final-episodes=3",
    "--evaluation-episodes=2",
];

/// From nothing: three random episodes first.
const FROM_NOTHING: [&str; 6] = ["--task", "known-slide", "--preset", "tiny", "--prefill", "3"];

/// 30 episodes, long enough to be killed in some times.
const LONG: [&str; 2] = ["--control-steps", "2400"];

/// From an offline run: 25 episodes.
const FROM_RECORDINGS: [&str; 6] = ["--distract", "none", "--critic-first", "10", "--control-steps", "2000"];

/// 12 episodes.
const WHOLE: [&str; 2] = ["--control-steps", "960"];

fn command(folder: &Path, more: &[&str]) -> Command {
    let mut command = process::program();
    command.arg("online").args(FROM_NOTHING).args(QUICK).arg("-o").arg(folder).args(more);
    command
}

fn run(folder: &Path, more: &[&str]) -> Output {
    command(folder, more).output().unwrap()
}

#[test]
fn a_run_counts_in_both_units_and_leaves_a_sound_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("run");
    let output = run(&folder, &[&WHOLE[..], &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output));
    let said: Json = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["evaluation"]["is_final"], true);
    assert_eq!(said["evaluation"]["held_out"]["returns"].as_array().unwrap().len(), 3);
    for line in lines(&folder.join("metrics.jsonl")) {
        let [control, agent] = ["control_steps", "agent_steps"].map(|key| line[key].as_u64().unwrap());
        assert_eq!(control, 2 * agent, "{line}");
    }
    let evaluations = lines(&folder.join("evaluations.jsonl"));
    let steps: Vec<u64> = evaluations.iter().map(|line| line["control_steps"].as_u64().unwrap()).collect();
    assert_eq!(steps, [240, 400, 800, 960], "at the start, at every multiple, at the end");
    assert!(evaluations[0]["training_videos"]["interval"].is_array());
    // Nobody sees a video here, and starts are the same for both sets; nor were there recordings to begin with.
    assert!(evaluations.iter().all(|line| line["training_videos"] == line["held_out"] && line["gap"].is_null()));
    assert!(evaluations.iter().all(|line| line["given_control_steps"].is_null()));
    assert!(!folder.join("evaluating.json").exists());
    // Every episode has a line, and the first 20 updates have one: the random ones and the first that the actor lives through have no updates beside them.
    let metrics = lines(&folder.join("metrics.jsonl"));
    let returned: Vec<u64> = metrics
        .iter()
        .filter(|line| line["training_return"].is_f64())
        .map(|line| line["episodes"].as_u64().unwrap())
        .collect();
    assert_eq!(returned, (1..=12).collect::<Vec<_>>());
    let (learned, others): (Vec<_>, Vec<_>) = metrics.iter().partition(|line| line["objective"].is_f64());
    assert_eq!(others.iter().map(|line| line["update"].as_u64().unwrap()).collect::<Vec<_>>(), [0, 0, 0, 20]);
    assert!(others.iter().all(|line| line["value"].is_null()));
    // The critic learns first: the actor moves with update 101, and then in every line.
    for line in learned {
        let moves = line["actor_gradient_norm"].as_f64().is_some_and(|norm| norm > 0.0);
        assert_eq!(moves, line["update"].as_u64().unwrap() > 100, "{line}");
        let bound = 2.0 / (1.0 - 0.99);
        let [value, share] = ["value", "value_over_bound"].map(|key| line[key].as_f64().unwrap());
        assert!((share - value / bound).abs() < 1e-9, "{line}");
        assert_eq!(line["control_steps_per_second"].is_f64(), line["training_return"].is_f64(), "{line}");
    }
    let options: Json = serde_json::from_slice(&std::fs::read(folder.join("online.json")).unwrap()).unwrap();
    let axes = &options["world"]["distractors"]["axes"];
    assert!(
        axes.as_object().unwrap().values().all(|is_there| is_there == false),
        "nothing is drawn, nothing distracts: {axes}"
    );
    let replay = Recording::open(&folder.join("replay")).unwrap();
    assert_eq!(replay.episodes().len(), 12);
    assert!(replay.episodes()[..3].iter().all(|entry| entry.policy == "random"));
    assert!(replay.episodes()[3].policy.starts_with("online:update="));
    assert!(verify_recording(&replay).is_empty());
    // 12 episodes of 21 updates and a quarter each, but for the random ones and the last, and the first 20.
    let newest = std::fs::read_dir(folder.join("checkpoints")).unwrap().count();
    assert!(newest >= 1);
    assert_eq!(lines(&folder.join("metrics.jsonl")).last().unwrap()["update"], 20 + 8 * 85 / 4);
    let page = std::fs::read_to_string(folder.join("summary.md")).unwrap();
    assert!(page.contains("* no recordings: its own") && page.contains("## After 190 updates, 960 control"), "{page}");
    assert!(page.contains("| control steps | episodes | return |"), "nobody sees a video: {page}");
    // The same command has nothing left to do.
    let again = run(&folder, &WHOLE);
    assert!(again.status.success() && text(&again).contains("already"), "{}", text(&again));
    assert!(!text(&again).contains("video"), "nobody sees one: {}", text(&again));
    // More control steps go on from there, by the run's own name.
    let mut more = Command::new(env!("CARGO_BIN_EXE_vibes-train"));
    let more = more.arg("online").arg(&folder).args(["--control-steps", "1040"]).output().unwrap();
    assert!(more.status.success(), "{}", text(&more));
    assert_eq!(Recording::open(&folder.join("replay")).unwrap().episodes().len(), 13);
}

#[test]
fn however_often_it_is_killed_the_same_command_ends_with_the_same_bytes() {
    let mut all_kills = 0;
    let anew = [
        "--guard=1",
        "--short-horizon=4",
        "--short-for=60",
        "--critic-first=15",
        "--reset-at=800,1590",
        "--reset-updates=50",
    ];
    for (guard, more) in [("0", &["--guard=0"][..]), ("2", &["--guard=2"]), ("1, which begins anew twice", &anew)] {
        let folder = tempfile::tempdir().unwrap();
        let [undisturbed, killed] = ["undisturbed", "killed"].map(|name| folder.path().join(name));
        let asked = [&LONG[..], more].concat();
        let output = run(&undisturbed, &asked);
        assert!(output.status.success(), "{}", text(&output));
        let line = lines(&undisturbed.join("metrics.jsonl")).pop().unwrap();
        assert_eq!(line["disagreement"].as_f64().is_some_and(|apart| apart > 0.0), guard != "0", "{line}");
        // From before anything is there to beyond a checkpoint.
        let kills = kill_until_done(|| command(&killed, &asked), 50..400);
        all_kills += kills;
        assert_same(&undisturbed, &killed, &format!("after {kills} kills, --guard {guard}"));
    }
    assert!(all_kills >= 10, "{all_kills} kills");
}

/// Half of every batch is of given recordings here: which of their windows are drawn must not depend on when the run was killed.
#[test]
fn a_run_with_recordings_is_killed_without_a_trace_too() {
    let folder = tempfile::tempdir().unwrap();
    let [given, offline, undisturbed, killed] =
        ["given", "offline", "undisturbed", "killed"].map(|name| folder.path().join(name));
    let output = run(&given, &["--control-steps", "320"]);
    assert!(output.status.success(), "{}", text(&output));
    let mut learn = process::program();
    learn
        .arg("offline")
        .arg(given.join("replay"))
        .args(["--preset", "tiny", "--updates", "20", "--minutes", "600", "-o"])
        .arg(&offline);
    let output = learn.output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let go_on = |folder: &Path| {
        let mut command = process::program();
        command.arg("online").arg(&offline).args(FROM_RECORDINGS).args(QUICK).arg("-o").arg(folder);
        command
    };
    let output = go_on(&undisturbed).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let kills = kill_until_done(|| go_on(&killed), 50..400);
    assert!(kills >= 5, "{kills} kills");
    assert_same(&undisturbed, &killed, &format!("after {kills} kills"));
    let evaluation = lines(&killed.join("evaluations.jsonl")).pop().unwrap();
    assert_eq!(evaluation["given_control_steps"], 320);
    let info: Json = serde_json::from_slice(&std::fs::read(undisturbed.join("run.json")).unwrap()).unwrap();
    assert_eq!(info["options"]["minutes"], 0.0, "those of the offline run are over");
}

#[test]
fn what_cannot_be_is_refused_with_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vibes-train"));
        let output = command.current_dir(folder.path()).arg("online").args(arguments).output().unwrap();
        assert!(!output.status.success(), "{arguments:?}");
        text(&output)
    };
    assert!(refused(&["--task", "cartpole"]).contains("cartpole-swingup"));
    assert!(refused(&["nothing-here"]).contains("run.json"));
    assert!(refused(&[]).contains("--task"));
    assert!(refused(&["--task", "reacher-easy", "--recipe", "none"]).contains("dreamer-v3"));
    assert!(refused(&["--task", "reacher-easy", "--rows-per-step", "0"]).contains("above 0"));
    let other = refused(&["--task", "reacher-easy", "--protocol", "dcs-easy-dynamic-500k", "--action-repeat", "2"]);
    assert!(other.contains("action repeat 4, not 2"), "{other}");
    let published = ["--task", "reacher-easy", "--protocol", "dcs-easy-dynamic-500k"];
    let vectors = refused(&[&published[..], &["--observations", "vectors"]].concat());
    assert!(vectors.contains("observations pictures, not vectors"), "{vectors}");
    let own = folder.path().join("films");
    for video in 0..8 {
        std::fs::create_dir_all(own.join(format!("film-{video}"))).unwrap();
        std::fs::write(own.join(format!("film-{video}/00000.jpg")), b"").unwrap();
    }
    let films = refused(&[&published[..], &["--videos", "films"]].concat());
    assert!(films.contains("videos of DAVIS 2017"), "{films}");
    let nothing_drawn = refused(&["--task", "reacher-easy", "--no-pixels", "--observations", "pixels"]);
    assert!(nothing_drawn.contains("nothing is drawn"), "{nothing_drawn}");
    let vectors = ["--task", "reacher-easy", "--no-pixels"];
    for (option, more) in [
        ("difficulty", &["--difficulty", "hard"][..]),
        ("static", &["--static"]),
        ("distract", &["--distract", "color"]),
    ] {
        let unseen = refused(&[&vectors[..], more].concat());
        assert!(unseen.contains(&format!("--{option} has no effect where nothing is drawn")), "{unseen}");
    }
    let never = refused(&["--task", "reacher-easy", "--evaluate-every", "0", "--evaluation-episodes", "3"]);
    assert!(never.contains("--evaluation-episodes has no effect"), "{never}");
    assert!(refused(&["--task", "reacher-easy", "--guard=-1"]).contains("0 or more"));
    assert!(refused(&["--task", "reacher-easy", "--entropy=-1"]).contains("0 or more"));
    assert!(refused(&["--task", "reacher-easy", "--every-start", "0"]).contains("above 0"));
    assert!(refused(&["--task", "reacher-easy", "--every-start", "15"]).contains("at most"));
    assert!(
        refused(&["--task", "reacher-easy", "--short-horizon", "3", "--short-for", "90"])
            .contains("must be above that")
    );
    let still = refused(&["--task", "reacher-easy", "--control-steps", "6000", "--critic-first", "10000"]);
    assert!(still.contains("--critic-first is 10000") && still.contains("the actor does not move"), "{still}");
    assert!(refused(&["--task", "reacher-easy", "--guard", "1", "--guard-members", "1"]).contains("two to disagree"));
    assert!(refused(&["--task", "reacher-easy", "--guard-members", "3"]).contains("--guard-members has no effect"));
    assert!(refused(&["--task", "reacher-easy", "--agent", "sac", "--guard", "1"]).contains("--guard has no effect"));
    for option in ["--views", "--next-views"] {
        let blind = refused(&["--task", "reacher-easy", "--agent", "sac", option, "0"]);
        assert!(blind.contains("0 is not in 1.."), "{blind}");
    }
    let missing = refused(&["--task", "reacher-easy", "--videos", "no-such-folder"]);
    assert!(missing.contains("no-such-folder"), "{missing}");
    // A run that is there keeps its options.
    let run_folder = folder.path().join("run");
    assert!(run(&run_folder, &["--control-steps", "320"]).status.success());
    let changed = text(&run(&run_folder, &["--control-steps", "320", "--discount", "0.5"]));
    assert!(changed.contains("discount = 0.99, asked for was 0.5"), "{changed}");
    let guarded = text(&run(&run_folder, &["--control-steps", "320", "--guard", "1"]));
    assert!(guarded.contains("guard = 0.0, asked for was 1.0"), "{guarded}");
    // Its config.toml, which does not say that its preset was tiny, begins the same run elsewhere.
    let other = folder.path().join("other");
    let mut again = process::program();
    again.args(["online", "--task", "known-slide", "--prefill", "3", "--control-steps", "320", "--config"]);
    let again = again.arg(run_folder.join("config.toml")).args(QUICK).arg("-o").arg(&other).output().unwrap();
    assert!(again.status.success(), "{}", text(&again));
    assert_same(&run_folder, &other, "from its config.toml");
    // What is refused changes nothing, and a copy that was kept is no run to go on with.
    let kept = folder.path().join("kept");
    let keep = process::program().arg("keep").arg(&run_folder).arg("-o").arg(&kept).output().unwrap();
    assert!(keep.status.success(), "{}", text(&keep));
    let before = [&run_folder, &kept].map(|run| files(run));
    let noisier = ["--control-steps", "320", "--exploration", "0.7"];
    assert!(text(&run(&run_folder, &noisier)).contains("exploration = 0.3"));
    assert!(refused(&["kept", "--control-steps", "480"]).contains("kept copy"));
    assert!(text(&run(&kept, &["--control-steps", "480"])).contains("kept copy"));
    assert!([&run_folder, &kept].map(|run| files(run)) == before, "a file has changed");
}
