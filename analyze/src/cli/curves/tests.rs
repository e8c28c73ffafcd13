//! What is averaged, what an interval is over, and what a figure is called.

use super::groups::{columns, shown};
use super::*;
use crate::metrics::{DYNAMICS_GAP, HELD_OUT_RETURN};

/// A run of an objective on a task, whose objective is the same number all the way.
fn write(runs: &Path, name: &str, (objective, task): (&str, &str), value: f64) -> PathBuf {
    let path = runs.join(name);
    std::fs::create_dir_all(&path).expect("folder");
    let line = |update: u32| json!({ "update": update, "objective": value }).to_string();
    std::fs::write(path.join("metrics.jsonl"), (1..=9).map(|update| line(update) + "\n").collect::<String>())
        .expect("metrics");
    let info = json!({
        "format": "vibes-run/1", "options": { "objective": objective }, "model": { "task": task },
        "recordings": [], "episodes": 2, "steps": 250, "versions": {},
    });
    std::fs::write(path.join("run.json"), info.to_string()).expect("run.json");
    path
}

/// Two evaluations of returns; those on training videos are off by so much.
fn evaluate(run: &Path, off: f64) {
    let set = |mean: f64| json!({ "mean_return": mean, "interval": [mean - 5.0, mean + 5.0] });
    let line = |update: u32, mean: f64| {
        let training = set(mean + off);
        json!({ "update": update, "held_out": set(mean), "training_videos": training, "is_final": false }).to_string()
    };
    std::fs::write(run.join("evaluations.jsonl"), [line(3, 10.0), line(9, 20.0)].join("\n")).expect("evaluations");
}

/// Runs the verb and returns its document and the text of its figure.
fn curves_of(runs: Vec<PathBuf>, metrics: &[&str]) -> (Value, String) {
    let out = runs[0].join("figures");
    let metrics = metrics.iter().map(|name| (*name).to_string()).collect();
    let options = Options { metrics, ..Options::of(runs, &out, None) };
    let outcome = run(&options, &Globals { quiet: true, ..Globals::default() }).expect("curves");
    (outcome.json, std::fs::read_to_string(out.join("curves.svg")).expect("figure"))
}

#[test]
fn what_two_tasks_give_is_never_averaged() {
    let home = tempfile::tempdir().expect("folder");
    let of = |name: &str, task: &str, value: f64| write(home.path(), name, ("vibes", task), value);
    let runs = vec![of("a", "cartpole", -6.0), of("b", "reacher", 2.0), of("c", "reacher", 3.0)];
    let (document, _) = curves_of(runs, &[]);
    let table = document["table"].as_array().expect("rows");
    let row = |row: &Value| (row["row"].as_str().map(String::from), row["values"][0]["mean"].as_f64());
    let wanted = [("cartpole: objective (nats a row)", -6.0), ("reacher: objective (nats a row)", 2.5)];
    let wanted = wanted.map(|(name, mean)| (Some(name.to_string()), Some(mean)));
    assert_eq!(table.iter().map(row).collect::<Vec<_>>(), wanted, "{document}");
    let over = |row: usize| &table[row]["values"][0]["interval_over"];
    assert_eq!((over(0), over(1)), (&Value::Null, &json!("runs")));
    assert_eq!(document["groups"], json!(["vibes"]));
}

#[test]
fn a_column_of_panels_is_a_task() {
    let home = tempfile::tempdir().expect("folder");
    let paths = ["cartpole", "reacher"].map(|task| write(home.path(), task, ("vibes", task), 1.0));
    evaluate(&paths[1], 1.0);
    let runs = paths.map(|path| Run::read(&path).expect("run"));
    let metrics = [HELD_OUT_RETURN, "objective"].map(Metric::named);
    let panels = shown(&runs, &Groups::of(By::Auto, &runs), &metrics).expect("curves");
    let panel = |panel: &Shown<'_>| (panel.task.clone().unwrap_or_default(), panel.curves.len());
    let found: Vec<(String, usize)> = panels.iter().map(panel).collect();
    let wanted = [("cartpole", 0), ("reacher", 1), ("cartpole", 1), ("reacher", 1)];
    assert_eq!(found, wanted.map(|(task, curves)| (task.to_string(), curves)));
    assert_eq!((columns(&runs), columns(&runs[..1])), (Some(2), None));
    // Of one task, what has no curve takes no place.
    assert_eq!(shown(&runs[..1], &Groups::of(By::Auto, &runs[..1]), &metrics).expect("curves").len(), 1);
}

#[test]
fn a_single_runs_band_is_that_of_its_evaluations_and_says_so() {
    let home = tempfile::tempdir().expect("folder");
    let of = |name: &str| write(home.path(), name, ("vibes", "reacher"), 1.0);
    let (alone, other) = (of("alone"), of("other"));
    evaluate(&alone, 1.0);
    evaluate(&other, 2.0);
    let over = |document: &Value, metric: &str| {
        let all = document["curves"].as_array().expect("curves");
        all.iter().find(|curve| curve["metric"] == metric).map(|curve| curve["interval_over"].clone())
    };
    let words = "95% interval over the episodes of an evaluation";
    let (document, figure) = curves_of(vec![alone.clone()], &[HELD_OUT_RETURN, "objective"]);
    assert_eq!(over(&document, HELD_OUT_RETURN), Some(json!("episodes")));
    assert_eq!(over(&document, "objective"), Some(Value::Null));
    assert!(figure.contains(words) && !figure.contains("over runs"), "the foot says what bands are");
    let (document, figure) = curves_of(vec![alone, other], &[HELD_OUT_RETURN, "objective"]);
    assert_eq!(over(&document, HELD_OUT_RETURN), Some(json!("runs")));
    assert!(!figure.contains(words) && figure.contains("over runs"));
}

#[test]
fn a_run_that_sees_no_video_has_one_panel_of_returns() {
    let home = tempfile::tempdir().expect("folder");
    let path = write(home.path(), "vectors", ("vibes", "swimmer"), 1.0);
    let metrics = |document: &Value| document["about"]["metrics"].clone();
    evaluate(&path, 0.0);
    let (document, figure) = curves_of(vec![path.clone()], &[]);
    assert_eq!(metrics(&document), json!([HELD_OUT_RETURN, "objective"]));
    assert!(figure.contains("return at evaluations") && !figure.contains("videos"));
    let both = [HELD_OUT_RETURN, TRAINING_VIDEOS_RETURN];
    assert_eq!(metrics(&curves_of(vec![path.clone()], &both).0), json!(both), "asked for by name");
    evaluate(&path, 1.0);
    let (document, figure) = curves_of(vec![path], &[]);
    assert_eq!(metrics(&document), json!([HELD_OUT_RETURN, TRAINING_VIDEOS_RETURN, "objective"]));
    assert!(figure.contains("return, held-out videos"));
}

/// What `vibes-train evaluate` found of a run: a gap below 0, after so many updates of the critic.
fn judge(run: &Path, updates: u32) {
    let document = json!({
        "checkpoint": "checkpoints/000009/model.safetensors", "gap_updates": updates, "report": {}, "gaps": { "dynamics_gap": -0.25 },
    });
    std::fs::write(run.join("evaluation.json"), document.to_string()).expect("evaluation");
}

#[test]
fn what_curves_lack_and_what_gaps_are_worth_is_said_beside_them() {
    let home = tempfile::tempdir().expect("folder");
    let runs = ["a", "b", "c"].map(|name| write(home.path(), name, ("vibes", "reacher"), 1.0));
    evaluate(&runs[0], 1.0);
    evaluate(&runs[1], 2.0);
    judge(&runs[0], 500);
    judge(&runs[1], 200);
    // The third run stopped early, and nobody evaluated it.
    let line = |update: u32| json!({ "update": update, "objective": 1.0 }).to_string() + "\n";
    std::fs::write(runs[2].join("metrics.jsonl"), (1..=4).map(line).collect::<String>()).expect("metrics");
    let said = |metrics: &[&str]| {
        let metrics = metrics.iter().map(|name| (*name).to_string()).collect();
        let options = Options { metrics, ..Options::of(runs.to_vec(), &home.path().join("figures"), None) };
        run(&options, &Globals { quiet: true, ..Globals::default() }).expect("curves").remarks.join("\n")
    };
    let of_objective = said(&["objective"]);
    assert!(of_objective.contains("a line is broken, and drawn thinner, where fewer runs"), "{of_objective}");
    assert!(!of_objective.contains("no such curve") && !of_objective.contains("critic"), "{of_objective}");
    let of_return = said(&[HELD_OUT_RETURN]);
    let lacking = "return, held-out videos: 1 of 3 runs of vibes have no such curve and are left out";
    assert!(of_return.contains(lacking) && !of_return.contains("broken"), "{of_return}");
    let of_gap = said(&[DYNAMICS_GAP]);
    assert!(of_gap.contains("a after 500, b after 200") && of_gap.contains("below 0 the critic overfits"), "{of_gap}");
}

/// A group that has no curve at all is missing from the figure, which says nothing of it.
#[test]
fn a_group_of_which_no_run_has_a_curve_is_named() {
    let home = tempfile::tempdir().expect("folder");
    let of = |name: &str, objective: &str| write(home.path(), name, (objective, "reacher"), 1.0);
    let runs = vec![of("a", "vibes"), of("b", "vibes"), of("c", "dreamer"), of("d", "dreamer")];
    evaluate(&runs[0], 1.0);
    evaluate(&runs[1], 2.0);
    let said = |metrics: Vec<String>| {
        let options = Options { metrics, ..Options::of(runs.clone(), &home.path().join("figures"), None) };
        run(&options, &Globals { quiet: true, ..Globals::default() }).expect("curves").remarks.join("\n")
    };
    assert!(said(Vec::new()).contains("no held-out gaps to a bisimulation"), "they are among what nobody chose");
    let said = said(vec![HELD_OUT_RETURN.to_string()]);
    let lacking = "return, held-out videos: 2 of 2 runs of dreamer have no such curve and are left out";
    assert!(said.contains(lacking) && !said.contains("of vibes have") && !said.contains("bisimulation"), "{said}");
}

#[test]
fn many_groups_stand_below_each_other_and_numbers_keep_their_form() {
    let home = tempfile::tempdir().expect("folder");
    let of = |count: usize| -> Table {
        let run = |at: usize| write(home.path(), &format!("run-{at}"), ("vibes", "reacher"), at as f64);
        let runs: Vec<Run> = (0..count).map(|at| Run::read(&run(at)).expect("run")).collect();
        ended::by_metric(Heading::default(), &runs, &Groups::of(By::Run, &runs), &[Metric::named("objective")])
    };
    let few = of(5);
    assert_eq!(ended::as_drawn(few.clone()), few);
    let many = of(12);
    assert_eq!(ended::numbers(&many)[0]["columns"].as_array().map(Vec::len), Some(12));
    let drawn = ended::as_drawn(many);
    assert_eq!((drawn.rows.len(), drawn.columns.len(), drawn.corner.as_str()), (12, 1, "group"));
}
