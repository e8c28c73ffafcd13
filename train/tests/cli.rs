//! What needs a real process: exit codes, messages, and that what is written can be read.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use std::path::Path;
use std::process::{Command, Output};

use vibes_data::{Latents, Recording};

fn vibes_train(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vibes-train")).current_dir(folder).args(arguments).output().unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn assert_done(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", errors(output));
}

#[test]
fn a_missing_recording_is_named_and_nothing_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let output = vibes_train(folder.path(), &["offline", "nowhere"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        errors(&output).contains("no recording here") && errors(&output).contains("nowhere"),
        "{}",
        errors(&output)
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn wrong_arguments_exit_with_2_and_list_the_choices() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false);
    std::fs::write(folder.path().join("bad.toml"), "learning_rate = 1.0").unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["offline"], "<RECORDING>"),
        (&["offline", "coins", "--preset", "huge"], "tiny, small, base, paper"),
        (&["offline", "coins", "--objective", "dreamer"], "vibes"),
        (&["offline", "coins", "--config", "bad.toml"], "learning_rate"),
        (&["offline", "coins", "--batch", "0"], "above 0"),
        (&["offline", "coins", "--device", "tpu"], "flex"),
    ];
    for (arguments, expected) in cases {
        let output = vibes_train(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", errors(&output));
        assert!(errors(&output).contains(expected), "{arguments:?}: {}", errors(&output));
        assert!(!folder.path().join("runs").exists(), "{arguments:?}");
    }
}

#[test]
fn a_decoder_draws_what_latents_show_and_leaves_the_run_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let recording = synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 24, true);
    let offline = ["offline", "coins", "-o", "run", "--preset", "tiny", "--updates", "3", "--quiet"];
    assert_done(&vibes_train(folder.path(), &offline));
    let weights = folder.path().join("run/checkpoints/000003/model.safetensors");
    let before = std::fs::read(&weights).unwrap();
    let decode = ["decode", "run", "coins", "--updates", "150", "--strips", "2", "--horizon", "5", "--json"];
    let output = vibes_train(folder.path(), &decode);
    assert_done(&output);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(said["last_error"].as_f64() < said["first_error"].as_f64(), "{said}");
    assert_eq!(std::fs::read(&weights).unwrap(), before, "the encoder never learns from it");
    let path = folder.path().join("run/decoded.arrow");
    let decoded = vibes_data::Decoded::read(&path).unwrap();
    assert_eq!((decoded.recording.as_deref(), decoded.objective.as_deref()), (Some("../coins"), Some("vibes")));
    assert_eq!(decoded.rows.len(), 2 * (3 + 5 + 1));
    for row in &decoded.rows {
        assert_eq!(row.recorded, recording.episode(row.episode).unwrap().pixels(row.step as usize));
        assert_eq!(row.predicted.is_some(), row.step >= row.start);
        // Where prediction begins there is nothing to predict yet.
        assert!(row.step != row.start || row.predicted.as_ref() == Some(&row.shown));
    }
    let bytes = std::fs::read(&path).unwrap();
    assert_done(&vibes_train(folder.path(), &decode));
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "the same seed gives the same pictures");
    // Before anything is fitted: no episode long enough to be shown, and no place to write to.
    for (more, code, said) in [
        (["--horizon", "1000"], 1, "long enough"),
        (["--horizon", "18446744073709551615"], 1, "long enough"),
        (["-o", "nowhere/decoded.arrow"], 2, "not there"),
        (["-o", "same.safetensors"], 2, "must end in .arrow"),
        (["-o", "coins"], 2, "-o names a folder"),
        (["--strips", "0"], 2, "0 is not in 1.."),
    ] {
        let output =
            vibes_train(folder.path(), &[&["decode", "run", "coins", "--updates", "1000000"][..], &more].concat());
        assert!(output.status.code() == Some(code) && errors(&output).contains(said), "{}", errors(&output));
    }
    let output = vibes_train(folder.path(), &["decode", "run", "coins", "--updates", "0"]);
    assert!(output.status.code() == Some(2) && errors(&output).contains("0 is not in 1.."), "{}", errors(&output));
    // Where it was written elsewhere, that is what is to be drawn.
    let elsewhere = ["decode", "run", "coins", "--updates", "1", "--horizon", "5", "-o", "elsewhere.arrow"];
    let output = vibes_train(folder.path(), &elsewhere);
    assert_done(&output);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("vibes-analyze decode elsewhere.arrow"), "{said}");
    let output = vibes_train(folder.path(), &["decode", "run", "nowhere"]);
    assert!(output.status.code() == Some(1) && errors(&output).contains("nowhere"), "{}", errors(&output));
}

#[test]
fn train_go_on_encode_and_info() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, true);
    let train = ["offline", "coins", "--preset", "tiny", "--updates"];
    let output = vibes_train(folder.path(), &[&train[..], &["4"]].concat());
    assert_done(&output);
    let again = vibes_train(folder.path(), &[&train[..], &["4"]].concat());
    assert_done(&again);
    assert!(String::from_utf8_lossy(&again.stdout).contains("already"));
    let more = vibes_train(folder.path(), &[&train[..], &["6"]].concat());
    assert_done(&more);
    assert!(errors(&more).contains("going on after 4 updates"), "{}", errors(&more));

    let page = std::fs::read_to_string(folder.path().join("runs/coins-vibes/summary.md")).unwrap();
    assert!(page.contains("After 6 of 6 updates") && page.contains("**vibes** on coins"), "{page}");
    let run = std::fs::read_dir(folder.path().join("runs/coins-vibes")).unwrap();
    let names = run.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    assert_eq!(
        names.filter(|name| name.starts_with("events.out.tfevents.")).count(),
        2,
        "one for each time it trained"
    );

    assert_done(&vibes_train(folder.path(), &["encode", "runs/coins-vibes", "coins"]));
    let elsewhere = ["encode", "runs/coins-vibes", "coins", "-o", "latents/of/coins.arrow"];
    assert_done(&vibes_train(folder.path(), &elsewhere));
    assert!(folder.path().join("latents/of/coins.arrow").is_file());
    let latents = Latents::read(&folder.path().join("runs/coins-vibes/latents.arrow")).unwrap();
    assert_eq!((latents.len(), latents.dims), (4 * 21, 8));
    assert_eq!(
        (latents.state[21], latents.distractor[21], latents.step[22], latents.episode[22]),
        (Some(0), Some(1), 1, 1)
    );
    assert!(latents.reward[20].is_none() && latents.reward[19].is_some());
    for row in 0..latents.len() {
        let norm: f32 = latents.row(row).iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-4, "row {row}: {norm}");
    }
    assert!(latents.source.recording.unwrap().ends_with("coins"));
    assert!(latents.source.checkpoint.unwrap().ends_with("000006/model.safetensors"));

    let info = vibes_train(folder.path(), &["info", "runs/coins-vibes", "--json"]);
    assert_done(&info);
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!(info["checkpoints"].as_array().unwrap().last().unwrap(), 6);
    assert!(info["goes_on_from"].is_null() && info["evaluation"].is_null(), "{info}");
    // As of a run that was killed after its seventh update.
    let metrics = folder.path().join("runs/coins-vibes/metrics.jsonl");
    let lines = std::fs::read_to_string(&metrics).unwrap();
    let last = lines.lines().last().unwrap().replacen("\"update\":6", "\"update\":7", 1);
    std::fs::write(&metrics, format!("{lines}{last}\n")).unwrap();
    let said = vibes_train(folder.path(), &["info", "runs/coins-vibes"]);
    assert!(String::from_utf8_lossy(&said.stdout).contains("from checkpoint 6"), "{}", errors(&said));
    std::fs::write(&metrics, lines).unwrap();
    // The saved configuration gives the same run again.
    let config = vibes_train(folder.path(), &["offline", "coins", "--config", "runs/coins-vibes/config.toml"]);
    assert_done(&config);
    assert!(String::from_utf8_lossy(&config.stdout).contains("already"), "{}", errors(&config));
}

/// A run goes on although its recording has more episodes than before, and says that what it draws is another thing now.
#[test]
fn a_recording_that_has_grown_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("coins");
    let train = |updates| vibes_train(folder.path(), &["offline", "coins", "--preset", "tiny", "--updates", updates]);
    synthetic::recording(&place, synthetic::SIDE, 4, 20, false);
    for (updates, episodes, told) in
        [("2", 4, None), ("3", 6, Some("6 episodes of 120 steps, and held 4 of 80")), ("4", 6, None)]
    {
        std::fs::remove_dir_all(&place).unwrap();
        synthetic::recording(&place, synthetic::SIDE, episodes, 20, false);
        let output = train(updates);
        assert_done(&output);
        assert_eq!(errors(&output).contains("and held"), told.is_some(), "{}", errors(&output));
        assert!(told.is_none_or(|told| errors(&output).contains(told)), "{}", errors(&output));
    }
}

/// Adam's moments of other weights would move some weights and leave the rest; recordings of another task have other rewards.
#[test]
fn what_is_of_another_run_or_task_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    let train = |hidden: &str, updates: &str| {
        let options = ["offline", "coins", "--preset", "tiny", "--hidden", hidden, "--updates", updates, "-o", hidden];
        vibes_train(folder.path(), &options)
    };
    assert_done(&train("16", "2"));
    assert_done(&train("24", "2"));
    let moments = |run: &str| folder.path().join(run).join("checkpoints/000002/optimizer.safetensors");
    let own = std::fs::read(moments("24")).unwrap();
    std::fs::copy(moments("16"), moments("24")).unwrap();
    let output = train("24", "3");
    assert!(output.status.code() == Some(1) && errors(&output).contains("moments of"), "{}", errors(&output));
    // A copy of a damaged checkpoint leaves nothing that would be in the way of the next.
    let model = folder.path().join("24/checkpoints/000002/model.safetensors");
    let whole = std::fs::read(&model).unwrap();
    std::fs::write(&model, &whole[..whole.len() / 2]).unwrap();
    let output = vibes_train(folder.path(), &["keep", "24", "-o", "kept"]);
    assert!(output.status.code() == Some(1) && !folder.path().join("kept").exists(), "{}", errors(&output));
    std::fs::write(&model, whole).unwrap();
    std::fs::write(moments("24"), own).unwrap();
    assert_done(&train("24", "3"));

    synthetic::recording(&folder.path().join("other"), synthetic::SIDE, 4, 20, false);
    let manifest = folder.path().join("other/manifest.json");
    let text = std::fs::read_to_string(&manifest).unwrap().replacen("\"coins\"", "\"cups\"", 1);
    std::fs::write(&manifest, text).unwrap();
    let output = vibes_train(folder.path(), &["offline", "coins", "other", "--preset", "tiny", "--updates", "1"]);
    assert!(output.status.code() == Some(1) && errors(&output).contains("cups with"), "{}", errors(&output));
}

/// The log of windows is what an undisturbed run has, also where lines were written that no checkpoint knows of.
#[test]
fn a_log_of_windows_goes_on_where_the_run_does() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    let train = |updates: &str, run: &str| {
        let options = ["offline", "coins", "--preset", "tiny", "--log-windows", "--updates", updates, "-o", run, "-q"];
        assert_done(&vibes_train(folder.path(), &options));
        std::fs::read_to_string(folder.path().join(run).join("windows.jsonl")).unwrap()
    };
    let (whole, part) = (train("4", "whole"), train("2", "part"));
    std::fs::write(folder.path().join("part/windows.jsonl"), part + "{\"update\":2}\n{\"upd").unwrap();
    assert_eq!(train("4", "part"), whole);
}

/// The configuration of a run of any preset and objective gives that run again, though the file says nothing of its preset.
#[test]
fn every_saved_configuration_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 60, true);
    for (preset, objective) in
        [("tiny", "reconstruction"), ("tiny", "no-adversary"), ("tiny", "vibes"), ("paper-small", "no-adversary")]
    {
        let run = format!("{preset}-{objective}");
        let config = format!("{run}/config.toml");
        let begin =
            ["offline", "coins", "--preset", preset, "--objective", objective, "--updates", "1", "-q", "-o", &run];
        assert_done(&vibes_train(folder.path(), &begin));
        let again = vibes_train(folder.path(), &["offline", "coins", "--config", &config, "-o", &run]);
        assert_done(&again);
        assert!(String::from_utf8_lossy(&again.stdout).contains("already"), "{run}: {}", errors(&again));
    }
}

#[test]
fn a_kept_run_is_small_has_the_same_latents_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = folder.path().join("recordings");
    synthetic::recording(&recordings.join("coins"), synthetic::SIDE, 4, 20, true);
    let train = ["offline", "recordings/coins", "--preset", "tiny", "-q", "--updates"];
    assert_done(&vibes_train(folder.path(), &[&train[..], &["8", "-o", "run"]].concat()));
    let keep = ["keep", "run", "-o", "checkpoints/coins", "--json"];
    let output = vibes_train(folder.path(), &keep);
    assert_done(&output);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["update"], 8);
    let weights = |run: &str| folder.path().join(run).join("checkpoints/000008/model.safetensors").metadata().unwrap();
    assert!(weights("checkpoints/coins").len() < weights("run").len() * 6 / 10);
    assert!(!folder.path().join("checkpoints/coins/checkpoints/000008/optimizer.safetensors").exists());

    let latents = |run: &str| {
        assert_done(&vibes_train(folder.path(), &["encode", run, "recordings/coins", "-q"]));
        Latents::read(&folder.path().join(run).join("latents.arrow")).unwrap().latent
    };
    let halves = latents("checkpoints/coins");
    let pairs = latents("run").into_iter().zip(&halves);
    let apart = pairs.map(|(whole, half)| (whole - *half).abs());
    let apart = apart.inspect(|apart| assert!(apart.is_finite(), "{apart}")).fold(0.0, f32::max);
    assert!(apart > 0.0 && apart < 5e-3, "{apart}");
    // The recordings are found beside the folder above, and the curves go on.
    assert_done(&vibes_train(folder.path(), &["info", "checkpoints/coins"]));
    let on = vibes_train(folder.path(), &[&train[..], &["12", "-o", "checkpoints/coins"]].concat());
    assert_done(&on);
    assert!(folder.path().join("checkpoints/coins/checkpoints/000012/optimizer.safetensors").exists());

    // Without its adversary the same latents, in fewer bytes.
    assert_done(&vibes_train(folder.path(), &["keep", "run", "--acting", "-o", "acting", "-q"]));
    assert!(weights("acting").len() < weights("checkpoints/coins").len() * 8 / 10);
    assert_eq!(latents("acting"), halves);
    for more in [&["12", "-o", "acting"][..], &["12", "--from", "acting", "-o", "on"]] {
        let refused = vibes_train(folder.path(), &[&train[..], more].concat());
        assert_eq!(refused.status.code(), Some(1), "{}", errors(&refused));
        assert!(errors(&refused).contains("no adversary (the copy was made with --acting)"), "{}", errors(&refused));
    }
    assert!(!folder.path().join("on").exists());

    let again = vibes_train(folder.path(), &keep);
    assert_eq!(again.status.code(), Some(2), "{}", errors(&again));
    assert!(errors(&again).contains("not there yet"), "{}", errors(&again));
}

/// No update, no checkpoint, in words and in JSON.
#[test]
fn a_run_of_no_updates_has_no_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false);
    let train = ["offline", "coins", "--preset", "tiny", "--updates", "0", "-o", "run"];
    assert_done(&vibes_train(folder.path(), &train));
    let output = vibes_train(folder.path(), &[&train[..], &["--json"]].concat());
    assert_done(&output);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(said["checkpoint"].is_null() && said["updates"] == 0, "{said}");
}

/// Timed updates are of pictures that are made up.
#[test]
fn what_no_timed_update_looks_at_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let vectors: &[&str] = &["bench", "--observations", "vectors"];
    for more in [&[][..], &["--online", "known-slide"]] {
        let output = vibes_train(folder.path(), &[vectors, more].concat());
        let said = errors(&output);
        assert!(output.status.code() == Some(2) && said.contains("--observations has no effect"), "{said}");
    }
}

#[test]
fn a_checkpoint_of_another_shape_is_refused_and_leaves_no_table() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false);
    synthetic::recording(&folder.path().join("larger"), 24, 2, 20, false);
    assert_done(&vibes_train(
        folder.path(),
        &["offline", "coins", "--preset", "tiny", "--updates", "1", "-o", "run", "-q"],
    ));
    let output = vibes_train(folder.path(), &["encode", "run", "larger"]);
    assert_eq!(output.status.code(), Some(1));
    let message = errors(&output);
    assert!(message.contains("24×24") && message.contains("16×16") && message.contains("larger"), "{message}");
    assert!(!folder.path().join("run/latents.arrow").exists());
}

#[test]
fn damaged_and_missing_runs_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false);
    let output = vibes_train(folder.path(), &["encode", "nowhere", "coins"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(errors(&output).contains("no run here"), "{}", errors(&output));
    assert_done(&vibes_train(
        folder.path(),
        &["offline", "coins", "--preset", "tiny", "--updates", "1", "-o", "run", "-q"],
    ));
    let model = folder.path().join("run/checkpoints/000001/model.safetensors");
    let bytes = std::fs::read(&model).unwrap();
    std::fs::write(&model, &bytes[..bytes.len() / 2]).unwrap();
    let output = vibes_train(folder.path(), &["encode", "run", "coins"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(errors(&output).contains("not a checkpoint"), "{}", errors(&output));
}

#[test]
fn evaluate_on_a_grid_while_training_and_after() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 40, false);
    synthetic::recording(&folder.path().join("grid"), synthetic::SIDE, 6, 40, true);
    let options = ["--preset", "tiny", "--updates", "4", "-o", "run", "--eval-every", "2"];
    assert_done(&vibes_train(folder.path(), &[&["offline", "coins", "--eval", "grid"][..], &options[..]].concat()));
    let lines = std::fs::read_to_string(folder.path().join("run/evaluations.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), 2);
    // What a policy needs can be followed while training.
    for line in lines.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()) {
        for name in ["open_loop_reward_r2@10", "open_loop_reward_r2_shuffled@10", "probe/coin[0]/h", "probe/coin[0]/hs"]
        {
            assert!(line["numbers"][name]["estimate"].is_f64(), "{name}: {line}");
        }
    }
    let output = vibes_train(folder.path(), &["evaluate", "run", "grid", "--gap-updates", "3", "--json"]);
    assert_done(&output);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let numbers = found["report"]["numbers"].as_object().unwrap();
    for name in ["retrieval_same_step@1", "retrieval_any_step@1", "distractor_share", "state_share", "denoising_factor"]
    {
        let number = &numbers[name];
        let [low, estimate, high] = ["low", "estimate", "high"].map(|part| number[part].as_f64());
        // What compares cells with each other has an interval where there are three distractors, and the grid has two.
        assert!(estimate.is_some() && low.is_none() && high.is_none(), "{name}: {number}");
        assert!(number["past_actions"]["estimate"].is_f64() && number["chance"].is_f64(), "{name}: {number}");
    }
    assert!(numbers["probe/coin[0]/s"]["estimate"].is_f64() && numbers["probe_knn/coin[1]/s"]["estimate"].is_f64());
    assert!(!numbers.contains_key("probe/camera roll/s"), "what never changes cannot be read");
    assert_eq!((&found["report"]["quantities"]["coin[0]"], &found["report"]["fitted_on"]), (&"task".into(), &4.into()));
    assert_eq!(found["report"]["left_out"], serde_json::json!([]));
    let grid = &found["report"]["grid"];
    assert_eq!(
        (&grid["states"], &grid["distractors"], &grid["dropped"]["states"]),
        (&3.into(), &2.into(), &serde_json::json!([]))
    );
    let of = |path: &str| found["gaps"].pointer(path).and_then(serde_json::Value::as_f64).unwrap();
    let difference = of("/held_out/dynamics/critic") - of("/held_out/dynamics/refitted");
    assert!((of("/dynamics_gap") - difference).abs() < 1e-9);
    assert!(of("/training/reward/gap/low") <= of("/training/reward/gap/high"));
    // What the training recordings do not name is said, as where an older collector made them.
    let manifest = folder.path().join("coins/manifest.json");
    let renamed = std::fs::read_to_string(&manifest).unwrap().replacen("\"coin\"", "\"side\"", 1);
    std::fs::write(&manifest, renamed).unwrap();
    let output = vibes_train(folder.path(), &["evaluate", "run", "grid", "--gap-updates", "0"]);
    assert_done(&output);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("do not name them") && text.contains(": coin[0], coin[1]\n"), "{text}");
    // Other recordings do, where they are named.
    synthetic::recording(&folder.path().join("others"), synthetic::SIDE, 3, 40, false);
    let others = ["evaluate", "run", "grid", "--fit-on", "others", "--gap-updates", "3", "--json"];
    let output = vibes_train(folder.path(), &others);
    assert_done(&output);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&found["report"]["fitted_on"], &found["gap_updates"]), (&3.into(), &3.into()));
    assert_eq!(
        (&found["fit_on"], &found["report"]["left_out"]),
        (&serde_json::json!(["../others"]), &serde_json::json!([]))
    );
    assert_eq!(found["is_held_out"], true);
    // A grid that the probes are fitted on too is named, under whatever path.
    let known = ["evaluate", "run", "grid", "--fit-on", "others", "./grid", "--gap-updates", "0", "--json"];
    let output = vibes_train(folder.path(), &known);
    assert_done(&output);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        found["is_held_out"] == false && errors(&output).contains("is among the recordings"),
        "{}",
        errors(&output)
    );
    // So is one of which a copy lies elsewhere.
    let copy = folder.path().join("copy");
    std::fs::create_dir_all(copy.join("episodes")).unwrap();
    for entry in Recording::open(&folder.path().join("grid")).unwrap().episodes() {
        std::fs::copy(folder.path().join("grid").join(&entry.arrow.path), copy.join(&entry.arrow.path)).unwrap();
    }
    std::fs::copy(folder.path().join("grid/manifest.json"), copy.join("manifest.json")).unwrap();
    let known = ["evaluate", "run", "grid", "--fit-on", "copy", "--gap-updates", "0", "--json"];
    let output = vibes_train(folder.path(), &known);
    assert_done(&output);
    assert!(errors(&output).contains("is among the recordings"), "{}", errors(&output));
    let trained = ["offline", "grid", "--eval", "./grid", "--preset", "tiny", "--updates", "1", "-o", "known"];
    assert!(errors(&vibes_train(folder.path(), &trained)).contains("is among the recordings"));
    let lines = std::fs::read_to_string(folder.path().join("known/evaluations.jsonl")).unwrap();
    assert!(lines.contains("\"is_held_out\":false"), "{lines}");
    // What a run was trained on is not held out either where nothing is fitted.
    let unfitted = ["evaluate", "known", "copy", "--probe-episodes", "0", "--gap-updates", "0", "--json"];
    let output = vibes_train(folder.path(), &unfitted);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["is_held_out"], false, "{}", errors(&output));
    // A recording that is no grid cannot be evaluated on.
    synthetic::recording(&folder.path().join("plain"), synthetic::SIDE, 3, 40, false);
    let output = vibes_train(folder.path(), &["evaluate", "run", "plain"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(errors(&output).contains("two distractors"), "{}", errors(&output));
    let output =
        vibes_train(folder.path(), &["offline", "coins", "--eval", "plain", "--preset", "tiny", "-o", "judged"]);
    assert!(errors(&output).contains("two distractors"), "{}", errors(&output));
    assert!(!folder.path().join("judged").exists(), "no run is begun that cannot be judged");
    let output = vibes_train(folder.path(), &["encode", "run", "grid", "-o", "latents.csv"]);
    assert!(errors(&output).contains("must end in .arrow"), "{}", errors(&output));
}

#[test]
fn an_evaluation_on_the_way_tells_what_its_grid_has_room_for() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 40, false);
    for (grid, steps, has_room) in [("long", 40, true), ("brief", 8, false)] {
        synthetic::recording(&folder.path().join(grid), synthetic::SIDE, 6, steps, true);
        let run = format!("run-{grid}");
        let options = ["offline", "coins", "--preset", "tiny", "--updates", "2", "--eval", grid, "-o", &run];
        let output = vibes_train(folder.path(), &options);
        assert_done(&output);
        let told = errors(&output);
        let line = told.lines().find(|line| line.starts_with("held-out grid: retrieval_same_step@1 "));
        let line = line.unwrap_or_else(|| panic!("{told}"));
        assert_eq!(line.contains("open_loop_reward_r2_persistence@10 "), has_room, "{line}");
        assert!(!line.contains("NaN"), "{line}");
    }
}

#[test]
fn what_cannot_be_evaluated_is_said_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    synthetic::recording(&folder.path().join("grid"), synthetic::SIDE, 6, 20, true);
    let fails = |arguments: &[&str], says: &str| {
        let output = vibes_train(folder.path(), arguments);
        assert!(!output.status.success() && errors(&output).contains(says), "{arguments:?}: {}", errors(&output));
    };
    let train = ["offline", "coins", "--preset", "tiny", "--updates", "2", "-o", "run"];
    fails(&[&train[..], &["--eval", "coins"]].concat(), "two distractors");
    assert!(!folder.path().join("run/metrics.jsonl").exists(), "no update was made");
    assert_done(&vibes_train(folder.path(), &train));
    fails(&["evaluate", "run", "grid", "-o", "coins/manifest.json/numbers.json"], "cannot make the folder");
    fails(&["evaluate", "run", "grid", "-o", "grid"], "-o names a folder");
    // A grid without a window has no gaps, and everything else.
    synthetic::recording(&folder.path().join("brief"), synthetic::SIDE, 6, 7, true);
    let judged = ["offline", "coins", "--preset", "tiny", "--updates", "2", "--eval", "brief", "-o", "judged"];
    fails(&judged, "no episode of more than 7 steps");
    assert!(!folder.path().join("judged").exists(), "no run is begun that cannot be judged");
    assert_done(&vibes_train(folder.path(), &[&judged[..], &["--gap-updates", "0"]].concat()));
    fails(&["evaluate", "run", "brief"], "--gap-updates 0");
    // The folder that a file is to lie in is made, as by the other programs.
    let elsewhere = ["evaluate", "run", "brief", "--gap-updates", "0", "-o", "numbers/of/brief.json"];
    assert_done(&vibes_train(folder.path(), &elsewhere));
    assert!(folder.path().join("numbers/of/brief.json").is_file());
    synthetic::recording(&folder.path().join("short"), synthetic::SIDE, 3, 4, false);
    fails(&["evaluate", "run", "grid", "--fit-on", "short"], "short");
    fails(
        &["evaluate", "run", "grid", "--fit-on", "coins", "--probe-episodes", "0", "--gap-updates", "0"],
        "nothing is fitted",
    );
    assert!(!folder.path().join("run/evaluation.json").exists());
    // Without its recordings a run has no gaps, which is an error only for those who ask for them.
    std::fs::remove_dir_all(folder.path().join("coins")).unwrap();
    fails(&["evaluate", "run", "grid", "--gap-updates", "3"], "the gaps need the run's recordings");
    fails(&["evaluate", "run", "grid", "--fit-on", "coins"], "coins");
    let output = vibes_train(folder.path(), &["evaluate", "run", "grid"]);
    assert_done(&output);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("without the gaps"), "{text}");
    let ahead = |steps: usize| text.contains(&format!("open_loop_reward_r2_persistence@{steps} "));
    assert!(ahead(10) && !ahead(15), "20 steps have room for ten after their first quarter: {text}");
    let text = std::fs::read_to_string(folder.path().join("run/evaluation.json")).unwrap();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(found["gaps"].is_null() && found["gap_updates"] == 0 && found["report"]["fitted_on"].is_null());
}

/// What says the same again as the run that is gone on from stands; another unit of reward would have no effect.
#[test]
fn the_configuration_of_the_run_before_is_given_back_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    let first = ["offline", "coins", "--preset", "tiny", "--updates", "1", "--reward-scale", "2", "-q", "-o", "first"];
    assert_done(&vibes_train(folder.path(), &first));
    let on = ["offline", "coins", "--from", "first", "--updates", "2", "-o", "second", "--config"];
    // Its own configuration is that of the run before, and gives the same run again.
    for (config, said) in [("first/config.toml", "2 updates made"), ("second/config.toml", "already")] {
        let output = vibes_train(folder.path(), &[&on[..], &[config]].concat());
        assert_done(&output);
        assert!(String::from_utf8_lossy(&output.stdout).contains(said), "{config}: {}", errors(&output));
    }
    let config = |run: &str| std::fs::read_to_string(folder.path().join(run).join("config.toml")).unwrap();
    assert_eq!(config("second"), config("first").replace("updates = 1\n", "updates = 2\n"));
    let output = vibes_train(folder.path(), &[&on[..], &["first/config.toml", "--reward-scale", "3"]].concat());
    assert!(output.status.code() == Some(2) && errors(&output).contains("--reward-scale"), "{}", errors(&output));
}

/// A table beside a checkpoint's weights would be taken for a part of it, and kept.
#[test]
fn latents_of_a_model_file_lie_in_its_run_and_are_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    let train = ["offline", "coins", "--preset", "tiny", "--updates", "1", "-q", "-o", "run"];
    assert_done(&vibes_train(folder.path(), &train));
    let file = "run/checkpoints/000001/model.safetensors";
    assert_done(&vibes_train(folder.path(), &["encode", file, "coins"]));
    let [of_run, beside] =
        ["run/latents.arrow", "run/checkpoints/000001/latents.arrow"].map(|at| folder.path().join(at));
    assert!(of_run.is_file() && !beside.exists());
    // Of a file that lies elsewhere they lie beside it, as they did.
    std::fs::create_dir(folder.path().join("copy")).unwrap();
    std::fs::copy(folder.path().join(file), folder.path().join("copy/model.safetensors")).unwrap();
    assert_done(&vibes_train(folder.path(), &["encode", "copy/model.safetensors", "coins"]));
    assert!(folder.path().join("copy/latents.arrow").is_file());
    // Where a table was written beside a checkpoint all the same, it is not kept.
    assert_done(&vibes_train(folder.path(), &["encode", "run", "coins", "-o", beside.to_str().unwrap()]));
    assert_done(&vibes_train(folder.path(), &["keep", "run", "-o", "kept"]));
    let kept = folder.path().join("kept/checkpoints/000001");
    assert!(kept.join("model.safetensors").is_file() && !kept.join("latents.arrow").exists());
}
