//! Traces that the simulator refuses, as processes: what is wrong names the file and the step.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::path::Path;

use serde_json::Value;

use run::fails;

/// Writes a golden trace with a change into the folder.
fn changed(folder: &Path, golden: &str, change: impl FnOnce(&mut Value)) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(golden);
    let mut trace: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    change(&mut trace);
    std::fs::write(folder.join("trace.json"), trace.to_string()).unwrap();
}

#[test]
fn a_step_or_an_override_that_does_not_fit_is_found_in_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let fails_with = |said: &str| {
        fails(folder, "replay trace.json", 1, said);
        fails(folder, "replay trace.json", 1, ": trace.json");
    };
    changed(folder, "physics/reacher-easy-0.json", |trace| {
        trace["actions"][3].as_array_mut().unwrap().push(0.into());
    });
    fails_with("control step 3: an action has 3 numbers");
    changed(folder, "physics/reacher-easy-0.json", |trace| {
        trace["qpos"].as_array_mut().unwrap().push(0.into());
    });
    fails_with("qpos has 3 numbers");
    changed(folder, "dcs/reacher-easy-easy-0.json", |trace| {
        trace["steps"][5]["qpos"].as_array_mut().unwrap().push(0.into());
    });
    fails_with("control step 5: cannot draw: 3 positions");
    changed(folder, "dcs/reacher-easy-easy-0.json", |trace| {
        trace["model_overrides"] = serde_json::json!({ "geom_pos": { "nothing": [0, 0, 0] } });
    });
    fails_with("no geom named nothing");
}
