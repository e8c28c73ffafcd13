//! What is said of a grid whose background videos are those that a run was trained under: its states are new, its videos are not.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

fn vibes_train(folder: &Path, arguments: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_vibes-train")).current_dir(folder).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Writes into a recording's manifest that it is under these procedural videos.
fn put_under(recording: &Path, names: &[&str], set: &str) {
    let path = recording.join("manifest.json");
    let mut manifest: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    manifest["options"]["videos"] = json!("procedural");
    let videos = names.iter().map(|name| json!({ "name": name, "set": set, "frames": 8 }));
    manifest["videos"] = videos.collect();
    std::fs::write(&path, manifest.to_string()).unwrap();
}

#[test]
fn a_grid_under_videos_that_were_trained_under_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let [coins, grid] = ["coins", "grid"].map(|name| folder.path().join(name));
    synthetic::recording(&coins, synthetic::SIDE, 4, 40, false);
    synthetic::recording(&grid, synthetic::SIDE, 6, 40, true);
    put_under(&coins, &["leaves-000", "leaves-001", "tiles-000"], "train");
    put_under(&grid, &["leaves-000", "leaves-001"], "train");
    let train = ["offline", "coins", "--preset", "tiny", "--updates", "2", "--eval", "grid", "--gap-updates", "0"];
    let output = vibes_train(folder.path(), &[&train[..], &["-o", "run"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let note = "the grid's 2 background videos (leaves-000, leaves-001) are among those trained on";
    assert!(said.contains(note) && said.contains("record with --video-set val"), "{said}");
    assert!(said.contains("evaluating on grid"), "{said}");
    let line = said.lines().find(|line| line.starts_with("held-out grid (its videos were trained under): "));
    assert!(line.is_some_and(|line| line.contains("; took ")), "{said}");
    let lines = std::fs::read_to_string(folder.path().join("run/evaluations.jsonl")).unwrap();
    assert!(lines.contains("\"is_held_out\":true") && lines.contains("\"videos_are_held_out\":false"), "{lines}");
    let page = std::fs::read_to_string(folder.path().join("run/summary.md")).unwrap();
    assert!(page.contains("## On the held-out grid (its videos were trained under)"), "{page}");
    // The same of an evaluation afterwards, and of videos that are new, or none.
    let cases: [(&[&str], Value); 3] =
        [(&["leaves-000", "webs-009"], json!(false)), (&["webs-009"], json!(true)), (&[], Value::Null)];
    for (names, known) in cases {
        put_under(&grid, names, "val");
        let evaluate = ["evaluate", "run", "grid", "--gap-updates", "0", "--json"];
        let found: Value = serde_json::from_slice(&vibes_train(folder.path(), &evaluate).stdout).unwrap();
        assert_eq!((&found["is_held_out"], &found["videos_are_held_out"]), (&json!(true), &known), "{names:?}");
        assert_eq!(found.get("videos_are_held_out").is_some(), !known.is_null(), "absent where there are none");
    }
}
