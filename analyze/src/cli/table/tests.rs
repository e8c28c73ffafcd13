//! What a table says of intervals, marks and videos.

use super::*;
use serde_json::Value;

/// A run of an objective with an evaluation; that on training videos is off by so much.
fn write(runs: &Path, name: &str, objective: &str, (mean, off): (f64, f64)) -> PathBuf {
    let path = runs.join(name);
    std::fs::create_dir_all(&path).expect("folder");
    std::fs::write(path.join("metrics.jsonl"), "{\"update\":1,\"objective\":1}\n").expect("metrics");
    let set = |mean: f64| json!({ "mean_return": mean });
    let line = json!({ "update": 1, "held_out": set(mean), "training_videos": set(mean + off), "is_final": false });
    std::fs::write(path.join("evaluations.jsonl"), line.to_string()).expect("evaluations");
    let info = json!({
        "format": "vibes-run/1", "options": { "objective": objective }, "model": { "task": "reacher" },
        "recordings": [], "episodes": 2, "steps": 250, "versions": {},
    });
    std::fs::write(path.join("run.json"), info.to_string()).expect("run.json");
    path
}

/// The line of result and the text of the figure.
fn table_of(runs: &[PathBuf]) -> (String, String) {
    let out = runs[0].join("figures");
    let options = Options {
        runs: runs.to_vec(),
        metrics: Vec::new(),
        by: Vec::new(),
        columns: None,
        rows: None,
        lower: Vec::new(),
        output: Some(out.clone()),
        note: None,
    };
    // As JSON, so that a terminal's codes are not in the text.
    let outcome = run(&options, &Globals { quiet: true, json: true, ..Globals::default() }).expect("table");
    assert!(matches!(outcome.json["methods"], Value::Array(_)), "{}", outcome.json);
    (outcome.line, std::fs::read_to_string(out.join("table.svg")).expect("figure"))
}

#[test]
fn a_table_of_single_runs_speaks_of_no_interval_and_of_no_mark() {
    let home = tempfile::tempdir().expect("folder");
    let of = |name: &str, objective: &str, mean: f64| write(home.path(), name, objective, (mean, 1.0));
    let runs = [of("a", "vibes", 10.0), of("b", "no-adversary", 20.0), of("c", "vibes", 12.0)];
    let (line, figure) = table_of(&runs[..2]);
    assert!(!line.contains("best") && line.contains("2 runs by objective\n"), "{line}");
    assert!(!figure.contains("interval") && !figure.contains("bold") && figure.contains("return, held-out videos"));
    let (line, figure) = table_of(&runs);
    assert!(line.contains("(*: best; ~: its 95% interval overlaps with the best"), "{line}");
    assert!(figure.contains("95% interval over runs") && figure.contains("bold:"));
}

#[test]
fn nothing_is_called_held_out_where_nobody_sees_a_video() {
    let home = tempfile::tempdir().expect("folder");
    let of = |name: &str, off: f64| write(home.path(), name, "vibes", (10.0, off));
    let (vectors, eyes) = (of("vectors", 0.0), of("eyes", 1.0));
    let (_, figure) = table_of(std::slice::from_ref(&vectors));
    assert!(figure.contains("return at evaluations") && !figure.contains("videos"));
    assert!(table_of(&[vectors, eyes]).1.contains("return, held-out videos"));
}
