//! Every example runs as its page says, on the programs that were just built.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::path::{Path, PathBuf};
use std::process::Command;

use vibes_tests::programs;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name).canonicalize().unwrap()
}

/// What a command says, with the programs on its path.
fn said(folder: &Path, program: impl AsRef<std::ffi::OsStr>, arguments: &[&str]) -> String {
    let path = format!("{}:{}", programs().display(), std::env::var("PATH").unwrap());
    let output = Command::new(program.as_ref()).args(arguments).current_dir(folder).env("PATH", path).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?} {arguments:?}\n{errors}", program.as_ref());
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_scripts_record_read_and_look_at_latents() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = said(folder.path(), "python3", &[example("record_and_read.py").to_str().unwrap(), "recording"]);
    assert!(recorded.contains("positions equal: True; pictures equal: False"), "{recorded}");
    let looked = said(folder.path(), "python3", &[example("own_latents.py").to_str().unwrap(), "recording"]);
    // The joint positions are the same under every distractor.
    assert!(looked.contains("retrieval_same_step@1"), "{looked}");
}

#[test]
fn a_policy_of_ones_own_is_recorded_by_its_actions() {
    let folder = tempfile::tempdir().unwrap();
    let actions = said(folder.path(), programs().join("examples/custom_policy"), &[]);
    let rows: Vec<Vec<f64>> = serde_json::from_str(&actions).unwrap();
    assert_eq!(rows.len(), 100);
    std::fs::write(folder.path().join("actions.json"), actions).unwrap();
    let line = "--policy actions:actions.json --episodes 1 --steps 100 --no-pixels --no-mcap -q -o mine";
    said(folder.path(), "vibes-collect", &line.split(' ').collect::<Vec<_>>());
    let recording = vibes_data::Recording::open(&folder.path().join("mine")).unwrap();
    assert_eq!(recording.episode(0).unwrap().action(7), [-0.5, -0.5]);
}

#[test]
fn the_plan_of_a_sweep_lists_its_runs() {
    let folder = tempfile::tempdir().unwrap();
    let listed = said(
        folder.path(),
        "vibes-train",
        &["sweep", example("table1-small.toml").to_str().unwrap(), "--list", "--json"],
    );
    let listed: serde_json::Value = serde_json::from_str(&listed).unwrap();
    assert_eq!(listed.as_array().map(Vec::len), Some(6), "{listed}");
}

/// The whole chain of stages, with fewer and smaller of everything: recordings, a run offline and online, both evaluations.
#[test]
fn the_plan_of_a_sweep_runs_scaled_down() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = std::fs::read_to_string(example("table1-small.toml")).unwrap();
    let tiny = "--steps 20 --size 32 --no-mcap";
    for (whole, scaled) in [
        ("--episodes 60", format!("--episodes 2 {tiny}")),
        ("--grid 8x8", format!("--grid 3x3 {tiny}")),
        ("--updates 5000", "--updates 3 --preset tiny --batch 2 --length 6".to_owned()),
        ("evaluate {run}/run {run}/grid", "evaluate {run}/run {run}/grid --gap-updates 2".to_owned()),
        (
            "--control-steps 100000",
            "--control-steps 1040 --rows-per-step 1 --first-updates 2 --evaluation-episodes 1 --final-episodes 1"
                .to_owned(),
        ),
        ("--episodes 100", "--episodes 2".to_owned()),
    ] {
        assert!(plan.contains(whole), "{whole} is not in the plan any more");
        plan = plan.replace(whole, &scaled);
    }
    std::fs::write(folder.path().join("plan.toml"), plan).unwrap();
    let sweep = |more: &[&str]| said(folder.path(), "vibes-train", &[&["sweep", "plan.toml"], more].concat());
    sweep(&["--index", "4", "--quiet"]);
    let status: serde_json::Value = serde_json::from_str(&sweep(&["--status", "--json"])).unwrap();
    assert_eq!((&status[4]["state"], &status[4]["stages"]), (&"done".into(), &serde_json::json!([6, 6])), "{status}");
    assert!(status[4]["update"].as_u64().is_some_and(|update| update > 0), "{status}");
    let run = folder.path().join("runs/table1-small/objective=reconstruction,seed=0");
    let acted = vibes_data::Recording::open(&run.join("final")).unwrap();
    assert_eq!(acted.episodes().len(), 2);
    assert!(acted.manifest().options["policy"].as_str().is_some_and(|policy| policy.contains("online")));
    for folder in ["run", "online"] {
        let table = said(&run, "vibes-analyze", &["table", folder, "-o", "tables"]);
        assert!(table.starts_with("table: "), "{table}");
    }
}
