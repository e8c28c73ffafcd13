//! The golden traces of `tests/golden/physics`, written by `dm_control` itself: every observation, reward and position agrees to 1e-9.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::PathBuf;

use vibes_collect::Trace;
use vibes_env::{KNOWN_SLIDE, task_names};

const TOLERANCE: f64 = 1e-9;

fn golden() -> Vec<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/physics");
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut traces: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "json")).collect();
    traces.sort();
    traces
}

/// Without a trace nothing compares a task's physics, and a folder without traces would pass the test below. `known-slide` is this project's own: `dm_control` has nothing to compare it with.
#[test]
fn every_registered_task_has_a_golden_trace() {
    let traced: Vec<String> = golden().iter().map(|path| Trace::read(path).unwrap().task).collect();
    // `swimmer-N` stands for every number of links.
    let is_of = |name: &str, task: &str| match name.strip_suffix('N') {
        Some(stem) => task.starts_with(stem),
        None => task == name,
    };
    let registered: Vec<&str> = task_names().into_iter().filter(|name| *name != KNOWN_SLIDE).collect();
    assert!(!registered.is_empty());
    let missing: Vec<&str> =
        registered.into_iter().filter(|name| !traced.iter().any(|task| is_of(name, task))).collect();
    assert!(missing.is_empty(), "no trace of {missing:?} in tests/golden/physics");
}

#[test]
fn every_golden_trace_replays_to_1e_9() {
    let mut wrong = Vec::new();
    for path in golden() {
        let expected = Trace::read(&path).unwrap();
        let got = expected.replay().unwrap();
        let errors = expected.compare(&got);
        println!("{}: {errors:?}", path.file_name().unwrap().to_string_lossy());
        let is_complete = errors.observations.is_some() && errors.rewards.is_some() && errors.qpos.is_some();
        if !is_complete || errors.largest() > TOLERANCE {
            wrong.push(format!("{}: {errors:?}", path.display()));
        }
        assert_eq!(got.observation_names, expected.observation_names);
        assert_eq!((got.action_min, got.action_max), (expected.action_min, expected.action_max));
        assert!((got.control_timestep - expected.control_timestep).abs() < 1e-12);
        assert!((got.step_limit - expected.step_limit).abs() < 1e-6);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
