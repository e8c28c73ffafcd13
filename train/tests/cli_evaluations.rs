//! What `offline --eval` and `evaluate` say of what they do not do: a run that is done, a grid of another world, gaps that cannot be measured.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;
mod synthetic;

use std::path::Path;
use std::process::Output;

use process::{lines, program, text};
use serde_json::{Value, json};

fn vibes_train(folder: &Path, line: &str) -> Output {
    program().current_dir(folder).args(line.split_whitespace()).output().unwrap()
}

fn succeeds(folder: &Path, line: &str) -> Output {
    let output = vibes_train(folder, line);
    assert!(output.status.success(), "{line}: {}", text(&output));
    output
}

/// Recordings of coins, and a grid of them.
fn recorded(folder: &Path) {
    synthetic::recording(&folder.join("coins"), synthetic::SIDE, 4, 20, false);
    synthetic::recording(&folder.join("grid"), synthetic::SIDE, 6, 20, true);
}

/// Writes another value into the specification in a recording's manifest.
fn respecify(recording: &Path, key: &str, value: Value) {
    let file = recording.join("manifest.json");
    let mut manifest: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    manifest["spec"][key] = value;
    std::fs::write(&file, manifest.to_string()).unwrap();
}

#[test]
fn a_run_that_is_done_is_evaluated_once_and_then_says_what_would_do_it_anew() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let train = "offline coins --preset tiny --updates 2 -o run";
    let judged = format!("{train} --eval grid --gap-updates 0");
    let evaluations = || lines(&folder.path().join("run/evaluations.jsonl")).len();
    let note = "vibes-train evaluate run grid";
    succeeds(folder.path(), train);
    let said = text(&succeeds(folder.path(), &judged));
    assert!(evaluations() == 1 && said.contains("evaluating on grid") && !said.contains(note), "{said}");
    for more in ["", " --json"] {
        let said = text(&succeeds(folder.path(), &format!("{judged}{more}")));
        assert!(evaluations() == 1 && said.contains("the run is done") && said.contains(note), "{said}");
    }
    assert!(!text(&succeeds(folder.path(), train)).contains(note), "nobody asked for an evaluation");
    assert!(!text(&succeeds(folder.path(), &format!("{judged} -q"))).contains(note));
    // One of no updates has nothing to be evaluated.
    let nothing = "offline coins --preset tiny --updates 0 -o none --eval grid --gap-updates 0";
    assert!(text(&succeeds(folder.path(), nothing)).contains("no update was made"));
}

#[test]
fn a_grid_of_another_task_or_action_repeat_is_refused_and_only_told_by_encode() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let train = "offline coins --preset tiny --updates 1";
    succeeds(folder.path(), &format!("{train} -o run"));
    let grid = folder.path().join("grid");
    for (key, value, found, learned) in [
        ("task", json!("cups"), "cups with", "coins with"),
        ("action_repeat", json!(4), "held for 4 control steps", "held for 1 control steps"),
    ] {
        let before = std::fs::read(grid.join("manifest.json")).unwrap();
        respecify(&grid, key, value);
        for line in ["evaluate run grid --gap-updates 0".to_owned(), format!("{train} -o other --eval grid")] {
            let output = vibes_train(folder.path(), &line);
            let said = text(&output);
            assert!(
                output.status.code() == Some(1) && said.contains(found) && said.contains(learned),
                "{line}: {said}"
            );
        }
        assert!(!folder.path().join("other").exists(), "no run is begun that cannot be judged");
        let said = text(&succeeds(folder.path(), "encode run grid"));
        assert!(said.contains("note: the run was trained on") && said.contains(found), "{said}");
        std::fs::write(grid.join("manifest.json"), before).unwrap();
    }
    let said = text(&succeeds(folder.path(), "evaluate run grid --gap-updates 0"));
    assert!(!said.contains("the run has learned from"), "{said}");
    assert!(!text(&succeeds(folder.path(), "encode run grid")).contains("note:"));
}

#[test]
fn gaps_that_are_missing_have_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    succeeds(folder.path(), "offline coins --preset tiny --updates 1 -o run");
    let evaluated = |more: &str| -> Value {
        let output = succeeds(folder.path(), &format!("evaluate run grid --json {more}"));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let whole = evaluated("--gap-updates 2");
    assert!(whole["gaps"].is_object() && whole.get("gaps_missing").is_none(), "{whole}");
    assert_eq!(evaluated("--gap-updates 0")["gaps_missing"], "--gap-updates 0 leaves them out");
    std::fs::remove_dir_all(folder.path().join("coins")).unwrap();
    let without = evaluated("");
    let why = without["gaps_missing"].as_str().unwrap();
    assert!(without["gaps"].is_null() && why.contains("need the run's recordings") && why.contains("coins"), "{why}");
    let said = text(&succeeds(folder.path(), "evaluate run grid"));
    assert!(said.contains("without the gaps to a bisimulation, which need the run's recordings"), "{said}");
}
