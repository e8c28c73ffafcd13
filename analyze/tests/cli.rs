//! `vibes-analyze` as a process: every verb end to end on a small synthetic recording, and what it says to bad input.

#[path = "cli/fixture.rs"]
mod fixture;

use std::path::Path;
use std::process::{Command, Output};
use std::sync::LazyLock;

use fixture::Fixture;
use serde_json::Value;

/// One recording for all tests that only read it.
static GRID: LazyLock<Fixture> = LazyLock::new(|| Fixture::grid(4, 5, 30));

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vibes-analyze")).args(args).current_dir(folder).output().expect("the program starts")
}

/// Runs a verb that must succeed and returns its standard output.
fn good(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {error}");
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a verb that must fail with this code and returns what it says.
fn bad(folder: &Path, args: &[&str], code: i32) -> String {
    let output = run(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {error}");
    assert!(!error.contains("panicked"), "{error}");
    error
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap_or_else(|e| panic!("{e}: {}", path.display()))).expect("JSON")
}

#[test]
fn nn_finds_the_newest_latents_and_writes_sheet_and_numbers() {
    let out = tempfile::tempdir().expect("folder");
    let said = good(GRID.path(), &["nn", "--queries", "6", "-o", out.path().to_str().expect("path")]);
    assert!(said.starts_with("nn: 6 queries, 5 neighbours each"), "{said}");
    for file in ["neighbours.json", "neighbours.arrow", "neighbours.png", "neighbours.svg"] {
        assert!(out.path().join(file).is_file(), "{file}");
    }
    let numbers = json(&out.path().join("neighbours.json"));
    assert_eq!(numbers["metric"], "standardized");
    for query in numbers["queries"].as_array().expect("queries") {
        let distances: Vec<f64> = query["distance"].as_array().expect("distances").iter().filter_map(Value::as_f64).collect();
        assert!(distances.len() == 5 && distances.windows(2).all(|d| d[0] <= d[1]), "{query}");
        let own = &query["query"][0];
        assert!(query["neighbours"].as_array().expect("neighbours").iter().all(|n| n[0] != *own), "{query}");
    }
}
