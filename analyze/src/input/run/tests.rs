//! What a run's files say of it: curves, where they end, and what is left out.

use super::super::tests::writer;
use super::*;

const RUN_JSON: &str = r#"{"format":"vibes-run/1","options":{"objective":"vibes"},"model":{"task":"reacher-easy"},"recordings":[],
    "episodes":2,"steps":250,"versions":{}}"#;

#[test]
fn a_killed_runs_last_line_is_counted_not_fatal() {
    let dir = tempfile::tempdir().expect("folder");
    let text = "{\"update\":10,\"loss\":2.5,\"gap\":null}\n{\"update\":20,\"dynamics_log_likelihood\":2,\"loss\":1.5,\"gap\":0.5}\n{\"update\":30,\"gap\":9}\n{\"update\":40,\"lo";
    let write = writer(dir.path());
    write("metrics.jsonl", text);
    write("run.json", RUN_JSON);
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(run.series["loss"], vec![(10.0, 2.5), (20.0, 1.5)]);
    assert_eq!(run.series["adversary_minus_dynamics"], vec![(20.0, 0.5)], "as an older run calls it");
    assert_eq!(run.series["gap"], vec![(30.0, 9.0)], "as another program calls something else");
    assert_eq!((run.broken_lines, run.objective(), run.updates()), (1, Some("vibes"), Some(30.0)));
}

#[test]
fn single_checkpoints_are_in_the_order_of_their_updates_and_the_grids_number_goes_first() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write(
        "metrics.jsonl",
        "{\"update\":2000,\"dynamics_log_likelihood\":2,\"effective_rank\":10.5}\n{\"update\":10000,\"batch_effective_rank\":11.5}\n",
    );
    for (update, rank) in [(2000, 2.0), (10000, 3.0)] {
        let text = format!(
            "{{\"checkpoint\":\"checkpoints/{update:06}/model.safetensors\",\"report\":{{\"numbers\":{{\"effective_rank\":{{\"estimate\":{rank}}}}}}}}}"
        );
        write(&format!("evaluation-{update}.json"), &text);
    }
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(run.series["held_out.numbers.effective_rank.estimate"], vec![(2000.0, 2.0), (10000.0, 3.0)]);
    assert_eq!((run.final_value("effective_rank"), run.final_value("batch_effective_rank")), (Some(3.0), Some(11.5)));
}

#[test]
fn what_was_measured_on_a_held_out_grid_belongs_to_the_run() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n{\"update\":200,\"loss\":1.5}\n");
    write(
        "evaluations.jsonl",
        "{\"update\":150,\"numbers\":{\"retrieval_same_step@1\":{\"estimate\":0.5},\"state_share\":{\"estimate\":0.25}},\"fitted_on\":null}\n",
    );
    let gaps = |gap: f64, update: u32| {
        format!(
            "{{\"checkpoint\":\"runs/a/checkpoints/{update:06}/model.safetensors\",\"report\":{{\"numbers\":{{\"retrieval_same_step@1\":{{\"estimate\":0.9}}}}}},\"gaps\":{{\"dynamics_gap\":{gap}}}}}"
        )
    };
    write("evaluation.json", &gaps(1.5, 200));
    write("evaluation-early.json", &gaps(4.0, 100));
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(run.series["held_out.numbers.retrieval_same_step@1.estimate"], vec![(150.0, 0.5)]);
    assert_eq!(run.series["held_out.numbers.state_share.estimate"], vec![(150.0, 0.25)]);
    let mut gaps = run.series["held_out.gaps.dynamics_gap"].clone();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(gaps, vec![(100.0, 4.0), (200.0, 1.5)]);
    assert_eq!(run.series.len(), 4);
    assert_eq!(run.full_name("state_share"), Some("held_out.numbers.state_share.estimate"));
    assert_eq!((run.final_value("state_share"), run.final_value("loss")), (Some(0.25), Some(1.5)));
    assert_eq!(run.final_value("retrieval_same_step@1"), Some(0.9), "that of `evaluate`, of the newest checkpoint");
    assert_eq!((run.full_name("loss"), run.full_name("state")), (Some("loss"), None));
    write(
        "metrics.jsonl",
        "{\"env_step\":4000,\"update\":100,\"loss\":2.5}\n{\"env_step\":9000,\"update\":200,\"loss\":1.5}\n",
    );
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(
        run.series["held_out.numbers.retrieval_same_step@1.estimate"],
        vec![(9000.0, 0.5)],
        "in the metrics' own clock"
    );
}

#[test]
fn what_is_not_held_out_is_left_out_and_named() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n");
    write(
        "evaluations.jsonl",
        "{\"update\":100,\"is_held_out\":false,\"numbers\":{\"state_share\":{\"estimate\":0.25}}}\n",
    );
    write("evaluation.json", "{\"is_held_out\":false,\"report\":{\"numbers\":{\"state_share\":{\"estimate\":0.5}}}}");
    let run = Run::read(dir.path()).expect("run");
    assert_eq!((run.full_name("state_share"), run.remarks().len()), (None, 2));
    assert!(run.remarks()[0].contains("/evaluation.json is left out"), "{:?}", run.remarks());
    write(
        "evaluations.jsonl",
        "{\"update\":100,\"is_final\":true,\"is_held_out\":false,\"held_out\":{\"mean_return\":70.5}}\n",
    );
    let seen = Run::read(dir.path()).expect("run");
    assert_eq!(seen.final_value("held_out.held_out.mean_return"), None, "of an online run under videos it had seen");
    // A grid that is held out counts beside one that is not.
    write(
        "evaluation-new.json",
        "{\"checkpoint\":\"checkpoints/000100/model.safetensors\",\"report\":{\"numbers\":{\"state_share\":{\"estimate\":0.5}}}}",
    );
    assert_eq!(Run::read(dir.path()).expect("run").final_value("state_share"), Some(0.5));
}

#[test]
fn several_grids_of_one_checkpoint_and_an_older_one_are_told() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n");
    write("evaluations.jsonl", "{\"update\":50,\"numbers\":{\"state_share\":{\"estimate\":0.25}}}\n");
    for (file, grid, update, name, share) in [
        ("evaluation-1000.json", "../new", 100, "probe_cross_validated/angle/s", 0.5),
        ("evaluation-200.json", "../old", 20, "state_share", 0.125),
        ("evaluation-final.json", "../final", 100, "state_share", 0.75),
    ] {
        let text = format!(
            "{{\"grid\":\"{grid}\",\"checkpoint\":\"checkpoints/{update:06}/model.safetensors\",\"report\":{{\"numbers\":{{\"{name}\":{{\"estimate\":{share}}}}}}}}}"
        );
        write(file, &text);
    }
    std::fs::create_dir_all(dir.path().join("checkpoints/000300")).expect("folder");
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(run.final_value("state_share"), Some(0.75), "of the newest checkpoint, whatever the files are called");
    let probe = "probe_cross_validated/angle/s";
    assert_eq!(run.final_value(probe), Some(0.5), "no point of a curve, and known by its name");
    assert!(run.full_name(probe).is_some() && run.names().any(|name| name.ends_with("angle/s.estimate")));
    let remarks = run.remarks().join("\n");
    assert!(remarks.contains("../final, ../new") && remarks.contains("gone on to 300"), "{remarks}");
}

/// It has starts of its own, and evaluations know their own control steps.
#[test]
fn the_last_evaluation_is_where_a_run_ended_and_no_point_of_its_curve() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write(
        "metrics.jsonl",
        "{\"control_steps\":500,\"update\":5,\"loss\":2.5}\n{\"control_steps\":1000,\"update\":9,\"loss\":2}\n",
    );
    let line = |steps: u32, mean: f64, is_final: bool| {
        format!(
            "{{\"control_steps\":{steps},\"update\":6,\"held_out\":{{\"mean_return\":{mean:.1},\"interval\":[1.5,9.5]}},\"is_final\":{is_final}}}\n"
        )
    };
    write("evaluations.jsonl", &[line(600, 4.0, false), line(1000, 70.0, true)].concat());
    let run = Run::read(dir.path()).expect("run");
    assert_eq!(run.series["held_out.held_out.mean_return"], vec![(600.0, 4.0)]);
    assert_eq!(run.final_value("held_out.held_out.mean_return"), Some(70.0));
    let report = "{\"numbers\":{\"state_share\":{\"estimate\":0.75}}}";
    write(
        "evaluation.json",
        &format!("{{\"checkpoint\":\"checkpoints/000009/model.safetensors\",\"report\":{report}}}"),
    );
    let evaluated = Run::read(dir.path()).expect("run");
    assert_eq!(evaluated.series["held_out.numbers.state_share.estimate"], vec![(1000.0, 0.75)]);
    assert_eq!(evaluated.final_value("state_share"), Some(0.75), "of a grid, beside returns");
    assert_eq!((run.protocol(), run.remarks().len()), (None, 0));
    let published = line(1000, 70.0, true).replace("\"update\"", "\"protocol\":\"dcs-easy-dynamic-500k\",\"update\"");
    write("evaluations.jsonl", &[line(600, 4.0, false), published].concat());
    let under = Run::read(dir.path()).expect("run");
    assert_eq!(under.protocol(), Some("dcs-easy-dynamic-500k"));
    assert!(under.remarks()[0].ends_with("last evaluated under dcs-easy-dynamic-500k"), "{:?}", under.remarks());
    write("evaluations.jsonl", &line(1000, 70.0, true));
    let alone = Run::read(dir.path()).expect("run");
    assert_eq!(alone.series["held_out.held_out.mean_return"], vec![(1000.0, 70.0)], "rather than none");
}

/// A band of a single run is the interval of its own evaluation, or none: two at one place, one of a single episode, and metrics of training batches have none.
#[test]
fn evaluations_keep_their_intervals() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n");
    let of_returns = |update: u32, mean: f64, interval: &str| {
        format!("{{\"update\":{update},\"held_out\":{{\"mean_return\":{mean:.1}{interval}}}}}\n")
    };
    let number = |update: u32| {
        format!(
            "{{\"update\":{update},\"numbers\":{{\"state_share\":{{\"estimate\":0.5,\"low\":0.25,\"high\":0.75}}}},\"gaps\":{{\"dynamics_gap\":0.5,\"held_out\":{{\"dynamics\":{{\"gap\":{{\"low\":0.0,\"high\":1.0}}}}}}}}}}\n"
        )
    };
    let lines = [
        of_returns(10, 4.0, ",\"interval\":[1.5,6.5]"),
        of_returns(20, 5.0, ""),
        of_returns(30, 6.0, ",\"interval\":[5.0,7.0]"),
        of_returns(30, 8.0, ",\"interval\":[7.0,9.0]"),
        number(40),
    ];
    write("evaluations.jsonl", &lines.concat());
    let run = Run::read(dir.path()).expect("run");
    let returns = |x: f64, y: f64| run.own_interval(HELD_OUT_RETURN, (x, y));
    assert_eq!(returns(10.0, 4.0), Some(((1.5, 6.5), Over::Episodes)));
    assert_eq!([returns(10.0, 4.5), returns(20.0, 5.0), returns(30.0, 7.0), returns(30.0, 6.0)], [None; 4]);
    let share = run.own_interval("held_out.numbers.state_share.estimate", (40.0, 0.5));
    assert_eq!(share, Some(((0.25, 0.75), Over::Trajectories)));
    assert_eq!(run.own_interval("held_out.gaps.dynamics_gap", (40.0, 0.5)), Some(((0.0, 1.0), Over::Trajectories)));
    assert_eq!(run.own_interval("loss", (100.0, 2.5)), None);
}

#[test]
fn videos_are_seen_where_the_two_sets_differ_or_have_a_gap() {
    let dir = tempfile::tempdir().expect("folder");
    let write = writer(dir.path());
    write("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n");
    let sees = |training: f64, gap: &str| {
        let line = format!(
            "{{\"update\":10,\"held_out\":{{\"mean_return\":0.0}},\"training_videos\":{{\"mean_return\":{training:.1}}}{gap},\"is_final\":false}}\n"
        );
        write("evaluations.jsonl", &line);
        Run::read(dir.path()).expect("run").sees_videos()
    };
    assert!(!sees(0.0, ""), "an agent that sees numbers lives through the same episodes twice");
    assert!(sees(1.0, "") && sees(0.0, ",\"gap\":{\"mean\":0.0}"));
}

#[test]
fn a_folder_without_metrics_is_no_run() {
    let dir = tempfile::tempdir().expect("folder");
    assert!(matches!(Run::read(dir.path()), Err(InputError::NoRun { .. })));
}
