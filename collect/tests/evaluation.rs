//! What a policy earns without a recording (`--no-record`), and where recordings of several trained runs go.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde_json::Value;
use vibes_collect::Error;
use vibes_collect::recorder::{PolicyMaker, Progress, RecordRun, Source, evaluate};
use vibes_collect::returns::Returns;
use vibes_collect::stored::options_of;
use vibes_data::Recording;

use run::{fails, works};

/// Puts a kept run where a command finds it, under a name.
fn link(folder: &Path, kept: &str, name: &str) {
    let kept = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../checkpoints")).join(kept);
    std::os::unix::fs::symlink(kept, folder.join(name)).unwrap();
}

fn said(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&works(folder, &format!("{arguments} --json"))).unwrap()
}

#[test]
fn without_a_recording_a_policy_earns_the_same_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    link(folder.path(), "swimmer-100-online", "blind");
    link(folder.path(), "cartpole-swingup-online", "seeing");
    let policies = [
        "--policy random --task cartpole-swingup",
        "--policy blind",
        "--mix blind:0.5,random:0.5",
        "--policy seeing --video-set val",
    ];
    for (place, policy) in policies.into_iter().enumerate() {
        let common = format!("{policy} --episodes 3 --steps 4 --seed 5");
        let alone = said(folder.path(), &format!("{common} --no-record --threads 1"));
        assert!(!folder.path().join("recordings").exists(), "{policy}");
        let recorded = said(folder.path(), &format!("{common} --no-pixels --no-mcap --threads 2 -o recorded-{place}"));
        for key in ["mean_return", "interval", "returns", "episodes", "given_control_steps"] {
            assert_eq!(alone[key], recorded[key], "{policy}: {key}");
        }
        assert_eq!(alone["returns"].as_array().unwrap().len(), 3);
        assert!(alone.get("recording").is_none() && recorded["recording"].is_string(), "{alone}");
    }
    let random =
        |seed: u32| said(folder.path(), &format!("{} --episodes 3 --steps 4 --no-record --seed {seed}", policies[0]));
    assert_ne!(random(5)["returns"], random(6)["returns"]);
    let line = works(folder.path(), "--policy blind --episodes 2 --steps 2 --no-record");
    assert!(line.starts_with("not recorded: 2 episodes, mean return ") && line.lines().count() == 1, "{line}");
    assert_eq!(works(folder.path(), "--episodes 1 --steps 2 --no-record -q"), "");
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 2 + policies.len(), "the runs and the recordings that were asked for");
}

#[test]
fn what_means_nothing_without_a_recording_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    link(folder.path(), "swimmer-100-online", "blind");
    let refused = |arguments: &str, says: &str| fails(folder.path(), &format!("--no-record {arguments}"), 2, says);
    refused("-o there", "--output has no effect: nothing is recorded; leave it out");
    for option in ["--no-mcap", "--no-pixels", "--size 32", "--render suite"] {
        let name = option.split(' ').next().unwrap();
        refused(option, &format!("{name} has no effect: nothing is recorded; leave it out, or leave out --no-record"));
    }
    refused("--grid 3x4", "ask for as many --episodes as it has rows");
    for option in ["--difficulty hard", "--distract none", "--static", "--video-set val", "--camera-seed 3"] {
        refused(&format!("--policy blind {option}"), "whoever acts sees no pictures");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the run alone");
}

#[test]
fn an_evaluation_tells_how_far_it_is_and_ends_when_it_is_stopped() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--policy random --grid 3x2 --steps 5 --seed 8 --no-pixels --no-mcap -o grid");
    let recording = Recording::open(&folder.path().join("grid")).unwrap();
    let options = options_of(&recording).unwrap();
    let evaluated = |stop: &AtomicBool, report: &(dyn Fn(Progress) + Sync)| {
        let run = RecordRun {
            options: &options,
            seed: recording.manifest().seed,
            threads: 2,
            with_mcap: false,
            source: Source::Simulation,
            turn: 0.0,
            policies: PolicyMaker::default(),
            stop,
        };
        evaluate(&run, recording.path(), report)
    };
    let told = std::sync::Mutex::new(Vec::new());
    let earned = evaluated(&AtomicBool::new(false), &|progress: Progress| told.lock().unwrap().push(progress)).unwrap();
    assert_eq!(earned, Returns::of(&recording), "a row of a grid counts once");
    let told = told.into_inner().unwrap();
    assert_eq!(told.iter().map(|progress| progress.episodes).max(), Some(3));
    assert_eq!(told.iter().map(|progress| (progress.wanted, progress.rows)).max(), Some((3, 18)));
    let stopped = evaluated(&AtomicBool::new(true), &|_: Progress| {});
    assert!(matches!(stopped, Err(Error::Stopped)), "{stopped:?}");
}

/// Two policies in one world must not be asked to share a folder.
#[test]
fn recordings_of_two_runs_have_two_folders() {
    let folder = tempfile::tempdir().unwrap();
    let record = "--steps 2 --no-pixels --no-mcap";
    for name in ["first", "swimmer-100-second"] {
        link(folder.path(), "swimmer-100-online", name);
        works(folder.path(), &format!("--policy {name} --episodes 2 {record}"));
    }
    works(folder.path(), &format!("--policy first --grid 2x1 {record}"));
    works(folder.path(), &format!("--task swimmer-100 --distract none --episodes 2 {record}"));
    let listed = std::fs::read_dir(folder.path().join("recordings")).unwrap();
    let mut names: Vec<String> = listed.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["swimmer-100-2", "swimmer-100-first-2", "swimmer-100-first-2x1", "swimmer-100-second-2"]);
    // Where another recording of the same run is, its folder and what differs are named.
    let other = format!("--policy first --episodes 2 --seed 3 {record}");
    fails(folder.path(), &other, 1, "its seed is 0, asked for was 3; name another folder with -o");
    fails(folder.path(), &other, 1, "recordings/swimmer-100-first-2");
}
