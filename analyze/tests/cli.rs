//! `vibes-analyze` as a process: every verb end to end on a small synthetic recording, and what it says to bad input.

#![allow(missing_docs, clippy::print_stdout, reason = "a test, which says what it skips")]

#[path = "cli/fixture.rs"]
mod fixture;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use fixture::Fixture;
use serde_json::Value;
use vibes_data::Latents;

/// One recording for all tests that only read it.
static GRID: LazyLock<Fixture> =
    LazyLock::new(|| Fixture::at(Path::new(env!("CARGO_TARGET_TMPDIR")).join("analyze-grid"), 4, 5, 30));

const PROGRAM: &str = env!("CARGO_BIN_EXE_vibes-analyze");

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::new(PROGRAM).args(args).current_dir(folder).output().expect("the program starts")
}

/// Runs a verb that must succeed and returns what it prints and what it says beside it.
fn good(folder: &Path, args: &[&str]) -> (String, String) {
    let output = run(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {error}");
    (String::from_utf8(output.stdout).expect("text"), error)
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

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("temporary folder")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of text")
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(if name == "neighbours.json" { "../measure/tests/golden" } else { "tests/golden" })
        .join(name)
}

#[test]
fn every_verb_writes_its_files_and_one_line_of_result() {
    let out = folder();
    let o = text(out.path());
    let verbs: [(&[&str], &[&str]); 7] = [
        (&["nn", "--queries", "6"], &["neighbours.json", "neighbours.arrow", "neighbours.png", "neighbours.svg"]),
        (
            &["umap"],
            &[
                "map.arrow",
                "map.json",
                "map-by-time.png",
                "map-by-state.svg",
                "map-by-distractor.png",
                "map-by-reward.png",
            ],
        ),
        (&["grid", "--panels", "3x5"], &["grid.png", "grid.svg", "grid.json"]),
        (&["invariance"], &["invariance.png", "invariance.svg", "invariance.json", "invariance.arrow"]),
        (&["probe"], &["probes.png", "probes.svg", "probes.json", "probes.arrow"]),
        (&["scene", "--episodes", "3,7"], &["scene.rrd", "scene.json"]),
        (&["curves", "runs/discs"], &["curves.png", "curves.svg", "table.png", "curves.json", "curves.arrow"]),
    ];
    for (verb, files) in verbs {
        let (said, _) = good(GRID.path(), &[verb, &["-o", o, "--note", "a synthetic recording"]].concat());
        assert!(said.starts_with(&format!("{}: ", verb[0])), "{said}");
        assert!(said.lines().skip(1).all(|l| l.starts_with("  ")), "{said}");
        for file in files {
            let path = out.path().join(file);
            assert!(path.metadata().is_ok_and(|m| m.len() > 100), "{file} after {verb:?}");
            assert!(said.contains(file), "{file} is not named in {said}");
        }
    }
    let leftovers: Vec<_> = std::fs::read_dir(out.path())
        .expect("folder")
        .flatten()
        .filter(|f| f.path().to_string_lossy().contains("partial"))
        .collect();
    assert!(leftovers.is_empty(), "{leftovers:?}");
}

#[test]
fn the_newest_latents_are_found_and_named() {
    let fixture = Fixture::grid(2, 2, 8);
    let newer = fixture.path().join("runs/other/latents-x.arrow");
    std::fs::create_dir_all(newer.parent().expect("parent")).expect("folder");
    std::thread::sleep(std::time::Duration::from_millis(20));
    std::fs::copy(fixture.latents(), &newer).expect("copy");
    let (_, said) = good(fixture.path(), &["nn", "--queries", "2", "-k", "2"]);
    assert!(said.contains("runs/other/latents-x.arrow (the newest"), "{said}");
    assert!(fixture.path().join("runs/other/figures/neighbours.json").is_file());
    let empty = folder();
    assert!(bad(empty.path(), &["nn"], 1).contains("no latents found"));
}

#[test]
fn neighbours_agree_with_the_golden_numbers_whoever_wrote_the_latents() {
    let want = json(&golden("neighbours.json"));
    let queries = want["queries"].as_array().expect("queries");
    let rows: Vec<String> = queries.iter().map(|q| format!("{}:{}", q["query"][0], q["query"][1])).collect();
    let arrow = golden_as_arrow(&want);
    for file in [
        arrow.path().join("latents.arrow"),
        golden("neighbours.npz"),
        golden("neighbours.npy"),
        golden("neighbours.parquet"),
    ] {
        let out = folder();
        let (_, said) =
            good(out.path(), &["nn", "--latents", text(&file), "--rows", &rows.join(","), "-o", text(out.path())]);
        assert!(said.contains("name no recording"), "{said}");
        let got = json(&out.path().join("neighbours.json"));
        assert_eq!(got["queries"].as_array().expect("queries").len(), queries.len());
        for (got, want) in got["queries"].as_array().expect("queries").iter().zip(queries) {
            assert_eq!(got["query"], want["query"], "{}", file.display());
            assert_eq!(got["neighbours"], want["neighbours"], "{}", file.display());
            for (a, b) in got["distance"]
                .as_array()
                .expect("distances")
                .iter()
                .zip(want["distance"].as_array().expect("distances"))
            {
                assert!((a.as_f64().expect("number") - b.as_f64().expect("number")).abs() < 1e-6, "{a} {b}");
            }
        }
    }
}

fn golden_as_arrow(want: &Value) -> tempfile::TempDir {
    let dir = folder();
    let ints = |key: &str| -> Vec<u32> {
        want[key].as_array().expect("list").iter().map(|v| v.as_u64().expect("number") as u32).collect()
    };
    let episode = ints("episode");
    let rows = episode.len();
    let latent = want["latent"]
        .as_array()
        .expect("rows")
        .iter()
        .flat_map(|r| r.as_array().expect("row").iter().map(|v| v.as_f64().expect("number") as f32));
    let l = Latents {
        step: ints("step"),
        state: vec![None; rows],
        distractor: vec![None; rows],
        reward: vec![None; rows],
        dims: 8,
        latent: latent.collect(),
        episode,
        ..Latents::default()
    };
    l.write(&dir.path().join("latents.arrow")).expect("latents");
    dir
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_threads() {
    let outputs: Vec<tempfile::TempDir> = ["1", "2"]
        .iter()
        .map(|threads| {
            let out = folder();
            for verb in [&["nn", "--select", "mix"][..], &["umap"], &["invariance"], &["probe"]] {
                let mut command = Command::new(PROGRAM);
                command
                    .args(verb)
                    .args(["--seed", "7", "-o", text(out.path())])
                    .current_dir(GRID.path())
                    .env("RAYON_NUM_THREADS", threads);
                assert!(command.output().expect("runs").status.success());
            }
            out
        })
        .collect();
    for file in [
        "neighbours.json",
        "neighbours.svg",
        "map.arrow",
        "map-by-state.png",
        "invariance.json",
        "probes.arrow",
        "probes.svg",
    ] {
        let read = |at: usize| std::fs::read(outputs[at].path().join(file)).expect(file);
        assert_eq!(read(0), read(1), "{file}");
    }
    let out = folder();
    good(GRID.path(), &["nn", "--select", "mix", "--seed", "8", "-o", text(out.path())]);
    assert_ne!(
        json(&out.path().join("neighbours.json"))["queries"],
        json(&outputs[0].path().join("neighbours.json"))["queries"]
    );
}

#[test]
fn a_map_is_used_again_only_while_latents_and_options_stay() {
    let fixture = Fixture::grid(2, 3, 20);
    good(fixture.path(), &["umap"]);
    let again = |args: &[&str]| good(fixture.path(), args).1.contains("still right");
    assert!(again(&["grid"]));
    assert!(!again(&["grid", "--neighbours", "9"]));
    assert!(!again(&["grid", "--seed", "3", "--neighbours", "9"]));
    let mut l = Latents::read(&fixture.latents()).expect("latents");
    l.latent[3] += 0.5;
    l.write(&fixture.latents()).expect("latents");
    assert!(!again(&["grid", "--seed", "3", "--neighbours", "9"]));
}

#[test]
fn another_layout_uses_the_neighbour_graph_again_and_gives_the_same_map_as_without() {
    let (once, twice) = (folder(), folder());
    let umap =
        |out: &Path, more: &[&str]| good(GRID.path(), &[&["umap", "-o", text(out), "--epochs", "40"], more].concat());
    umap(once.path(), &["--neighbours", "20"]);
    for more in [&["--min-dist", "0.6"][..], &["--seed", "4", "--neighbours", "8"]] {
        let (said, errors) = umap(once.path(), more);
        assert!(said.contains("neighbour graph used again") && errors.contains("graph.arrow"), "{said} {errors}");
        let (said, _) = umap(twice.path(), more);
        let _ = std::fs::remove_file(twice.path().join("graph.arrow"));
        assert!(!said.contains("used again"), "{said}");
        let map = |out: &Path| std::fs::read(out.join("map.arrow")).expect("map");
        assert_eq!(map(once.path()), map(twice.path()), "{more:?}");
    }
    let (said, _) = umap(once.path(), &["--metric", "cosine"]);
    assert!(!said.contains("used again"), "another metric has another graph: {said}");
    let (said, _) = umap(once.path(), &["--metric", "cosine", "--neighbours", "30"]);
    assert!(!said.contains("used again"), "more neighbours than the graph has: {said}");
}

#[test]
fn large_tables_are_laid_out_in_part_and_the_rest_placed_among_it() {
    let out = folder();
    let (said, errors) = good(GRID.path(), &["umap", "-o", text(out.path()), "--fit-rows", "200"]);
    assert!(errors.contains("200 rows drawn from the 620 were laid out"), "{errors}");
    let quality = json(&out.path().join("map.json"));
    // The state is a circle: the placed points lie on it as the laid out ones do.
    assert!(quality["quality"]["trustworthiness"].as_f64().expect("number") > 0.95, "{said} {quality}");
    good(GRID.path(), &["umap", "-o", text(out.path()), "--fit-rows", "200", "--method", "tsne", "--perplexity", "10"]);
    let quality = json(&out.path().join("map.json"));
    assert!(quality["quality"]["trustworthiness"].as_f64().expect("number") > 0.9, "{quality}");
}

#[test]
fn new_latents_are_placed_on_an_old_map_of_the_same_model() {
    let fixture = Fixture::grid(4, 3, 20);
    let (old, new) = (fixture.path().join("old"), fixture.path().join("new"));
    good(fixture.path(), &["umap", "-o", text(&old)]);
    let l = Latents::read(&fixture.latents()).expect("latents");
    let later = fixture.path().join("later.arrow");
    l.write(&later).expect("latents");
    let map = old.join("map.arrow");
    let onto = |verb: &[&str], out: &Path| -> Vec<String> {
        [verb, &["--latents", text(&later), "--onto", text(&map), "-o", text(out)]]
            .concat()
            .into_iter()
            .map(String::from)
            .collect()
    };
    let words = onto(&["umap"], &new);
    let (said, _) = good(fixture.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(said.contains("placed on"), "{said}");
    let read = |folder: &Path| vibes_analyze::output::MapTable::read(&folder.join("map.arrow")).expect("map").positions;
    let (before, after) = (read(&old), read(&new));
    let moved = |(a, b): (&[f32; 2], &[f32; 2])| f64::from((a[0] - b[0]).hypot(a[1] - b[1]));
    let mean = before.iter().zip(&after).map(moved).sum::<f64>() / before.len() as f64;
    assert!(mean < 1.0, "the same latents land near where they were, not {mean} away");
    good(fixture.path(), &onto(&["grid"], &new).iter().map(String::as_str).collect::<Vec<_>>());
    // The old map is never overwritten, other latents and other models are refused.
    let refused = |words: Vec<String>, code: i32| {
        bad(fixture.path(), &words.iter().map(String::as_str).collect::<Vec<_>>(), code)
    };
    assert!(refused(onto(&["umap"], &old), 2).contains("would take the place of the old one"));
    let mut wide = l.clone();
    (wide.dims, wide.latent) = (10, l.latent.iter().flat_map(|&x| [x, 1.0 - x]).collect());
    wide.write(&later).expect("latents");
    assert!(refused(onto(&["umap"], &new), 2).contains("have 10 dimensions, those of the map 5"));
    l.write(&later).expect("latents");
    let mut changed = l.clone();
    changed.latent[0] += 0.5;
    changed.write(&fixture.latents()).expect("latents");
    assert!(refused(onto(&["umap"], &new), 2).contains("the map is of other latents"));
    std::fs::remove_file(fixture.latents()).expect("removed");
    assert!(refused(onto(&["umap"], &new), 1).contains("--onto-latents"));
}

#[test]
fn held_out_gaps_are_drawn_with_the_curves() {
    let fixture = Fixture::grid(2, 2, 6);
    let run = fixture.path().join("runs/discs");
    let (_, said) = good(fixture.path(), &["curves", "runs/discs"]);
    assert!(said.contains("vibes-train evaluate RUN GRID"), "{said}");
    for (update, gap) in [(100, 2.0), (300, 0.5)] {
        let text = format!(
            "{{\"checkpoint\":\"runs/discs/checkpoints/{update:06}/model.safetensors\",\"report\":{{}},\"gaps\":{{\"dynamics_gap\":{gap},\"reward_gap\":0.1}}}}"
        );
        std::fs::write(run.join(format!("evaluation-{update}.json")), text).expect("evaluation");
    }
    let (_, said) = good(fixture.path(), &["curves", "runs/discs", "--table", "held_out.gaps.dynamics_gap"]);
    assert!(!said.contains("vibes-train evaluate"), "{said}");
    assert!(std::fs::read_to_string(run.join("figures/curves.svg")).expect("curves").contains("held-out dynamics gap"));
    let table = json(&run.join("figures/curves.json"))["table"].clone();
    assert_eq!(table[0]["values"][0]["mean"].as_f64(), Some(0.5), "{table}");
}

#[test]
fn the_numbers_of_a_known_latent_are_right() {
    let out = folder();
    good(GRID.path(), &["invariance", "-o", text(out.path())]);
    let numbers = json(&out.path().join("invariance.json"));
    let share = |what: &str| numbers["numbers"][what]["estimate"].as_f64().expect("share");
    // The latent is the state on a circle of radius 1 and a tenth of the distractor's sine.
    assert!(share("state_share") > 0.97 && share("distractor_share") < 0.03, "{numbers}");
    assert!(share("retrieval_any_step@1") > 0.9 && share("retrieval_same_step@1") > 0.99);
    good(GRID.path(), &["probe", "-o", text(out.path())]);
    let probes = json(&out.path().join("probes.json"));
    let score = |source: &str, quantity: &str| {
        let all = probes[source].as_array().expect("scores").iter();
        all.filter(|s| s["quantity"] == quantity && s["probe"] == "linear")
            .find_map(|s| s["score"]["estimate"].as_f64())
            .expect("score")
    };
    assert!(score("latent", "position[0]") > 0.95 && score("latent", "position[1]") > 0.95);
    assert!(score("latent", "unseen") < 0.1 && score("past_actions", "position[0]") < 0.5);
    good(GRID.path(), &["nn", "-o", text(out.path())]);
    let ratio = &json(&out.path().join("neighbours.json"))["state_error"]["ratio"];
    assert!(ratio["high"].as_f64().expect("ratio") < 0.9, "{ratio}");
}

#[test]
fn wrong_arguments_say_what_would_be_right() {
    let here = GRID.path();
    assert!(bad(here, &["nn", "--metric", "manhattan"], 2).contains("standardized, euclidean, cosine"));
    assert!(bad(here, &["nn", "--rows", "3:999"], 2).contains("no row 3:999"));
    assert!(bad(here, &["nn", "--rows", "three"], 2).contains("EPISODE:STEP"));
    assert!(bad(here, &["grid", "--panels", "4by4"], 2).contains("NxM"));
    assert!(bad(here, &["grid", "--states", "9"], 2).contains("choose among 0, 1, 2, 3"));
    assert!(bad(here, &["scene", "--episodes", "77"], 2).contains("no such episode"));
    assert!(bad(here, &["curves", "runs/discs", "--metrics", "sharpness"], 2).contains("choose among"));
    assert!(bad(here, &["umap", "--neighbours", "1"], 2).contains("at least 2"));
    assert!(bad(here, &["symmetry"], 2).contains("to_target"));
    assert!(bad(here, &["embed"], 2).contains("unrecognized subcommand"));
    assert!(bad(here, &["nn", "--config", "none.toml"], 1).contains("none.toml"));
}

#[test]
fn bad_latents_give_a_clear_error_and_leave_nothing() {
    let fixture = Fixture::grid(2, 2, 6);
    let l = Latents::read(&fixture.latents()).expect("latents");
    let path = fixture.path().join("bad.arrow");
    let out = fixture.path().join("out");
    let refused = |said: &str, verb: &[&str]| {
        let error = bad(fixture.path(), &[verb, &["--latents", text(&path), "-o", text(&out)]].concat(), 1);
        assert!(error.contains(said), "{error}");
        assert!(!out.join("neighbours.json").exists() && !out.join("map.arrow").exists());
    };
    refused("cannot read", &["nn"]);
    std::fs::write(&path, b"").expect("file");
    refused("an empty file", &["nn"]);
    std::fs::write(&path, b"episode,step,latent\n0,0,1.5\n").expect("file");
    refused("a file of another kind", &["nn"]);
    let mut nan = l.clone();
    nan.latent[7] = f32::NAN;
    nan.write(&path).expect("latents");
    refused("episode 0, step 1: dimension 2 of the latent is NaN", &["nn"]);
    Latents { latent: vec![0.25; l.latent.len()], ..l.clone() }.write(&path).expect("latents");
    refused("", &["nn", "--no-frames"]);
    l.write(&path).expect("latents");
    refused("only", &["nn", "-k", "500", "--no-frames"]);
    refused("", &["umap", "--neighbours", "500", "--no-frames"]);
    let whole = std::fs::read(&path).expect("file");
    std::fs::write(&path, &whole[..whole.len() / 2]).expect("file");
    refused("damaged", &["nn"]);
    let mut twice = l.clone();
    twice.step[1] = 0;
    twice.write(&path).expect("latents");
    refused("episode 0, step 0 occurs twice", &["nn"]);
}

#[test]
fn missing_columns_are_named() {
    use arrow::array::{ArrayRef, Float32Array, RecordBatch, UInt32Array};
    let dir = folder();
    let path = dir.path().join("table.arrow");
    let write = |columns: Vec<(&str, ArrayRef)>| {
        let batch = RecordBatch::try_from_iter(columns).expect("batch");
        let file = std::fs::File::create(&path).expect("file");
        let mut writer = arrow::ipc::writer::FileWriter::try_new(file, &batch.schema()).expect("writer");
        writer.write(&batch).expect("written");
        writer.finish().expect("finished");
    };
    let keys = || std::sync::Arc::new(UInt32Array::from(vec![0, 1])) as ArrayRef;
    write(vec![("episode", keys()), ("t", keys())]);
    let error = bad(dir.path(), &["nn", text(&path)], 1);
    assert!(
        error.contains("column step is missing (found: episode, t)")
            && error.contains("episode, step (integers) and latent"),
        "{error}"
    );
    let flat = std::sync::Arc::new(Float32Array::from(vec![0.5, 1.5])) as ArrayRef;
    write(vec![("episode", keys()), ("step", keys()), ("latent", flat)]);
    let error = bad(dir.path(), &["nn", text(&path)], 1);
    assert!(error.contains("column latent: it holds Float32; a list of floats"), "{error}");
}

#[test]
fn a_recording_that_is_gone_or_another_is_not_passed_over_silently() {
    let fixture = Fixture::grid(2, 3, 6);
    std::fs::rename(fixture.path().join("recordings"), fixture.path().join("moved")).expect("moved");
    let error = bad(fixture.path(), &["nn", "-k", "2"], 1);
    assert!(
        error.contains("recordings/discs") && error.contains("--recording") && error.contains("--no-frames"),
        "{error}"
    );
    good(fixture.path(), &["nn", "-k", "2", "--recording", "moved/discs"]);
    good(fixture.path(), &["nn", "-k", "2", "--no-frames"]);
    assert!(bad(fixture.path(), &["nn", "--recording", "nowhere"], 1).contains("no recording here"));
    assert!(bad(fixture.path(), &["probe", "--no-frames"], 2).contains("needs the recording"));
    let mut l = Latents::read(&fixture.latents()).expect("latents");
    l.reward[3] = l.reward[3].map(|reward| 1.0 - reward);
    l.write(&fixture.path().join("other.arrow")).expect("latents");
    let error = bad(fixture.path(), &["nn", "--recording", "moved/discs", "--latents", "other.arrow"], 1);
    assert!(error.contains("step 3 of episode 0 earned"), "two recordings of one size: {error}");
    let other = Fixture::grid(2, 2, 3);
    let error = bad(fixture.path(), &["nn", "--recording", text(&other.path().join("recordings/discs"))], 1);
    assert!(error.contains("not encoded from this recording"), "{error}");
}

#[test]
fn a_grid_with_holes_is_drawn_and_measured_as_one() {
    let fixture = Fixture::grid(4, 3, 10);
    let l = Latents::read(&fixture.latents()).expect("latents");
    // Episode 4 is state 1 under distractor 1.
    let keep: Vec<usize> = (0..l.len()).filter(|&r| l.episode[r] != 4).collect();
    let of = |v: &[Option<u32>]| keep.iter().map(|&r| v[r]).collect::<Vec<_>>();
    let holes = Latents {
        episode: keep.iter().map(|&r| l.episode[r]).collect(),
        step: keep.iter().map(|&r| l.step[r]).collect(),
        state: of(&l.state),
        distractor: of(&l.distractor),
        reward: keep.iter().map(|&r| l.reward[r]).collect(),
        latent: keep.iter().flat_map(|&r| l.row(r).to_vec()).collect(),
        ..l.clone()
    };
    holes.write(&fixture.latents()).expect("latents");
    let (_, said) = good(fixture.path(), &["grid"]);
    assert!(said.contains("1 of 12 cells were not recorded"), "{said}");
    let (_, said) = good(fixture.path(), &["invariance"]);
    assert!(said.contains("state trajectories [1] lack a cell"), "{said}");
    let flat = Latents { state: vec![None; holes.len()], distractor: vec![None; holes.len()], ..holes };
    flat.write(&fixture.latents()).expect("latents");
    assert!(bad(fixture.path(), &["grid"], 2).contains("not of a grid"));
    bad(fixture.path(), &["invariance"], 1);
}

#[test]
fn runs_without_metrics_and_tables_of_other_rows_are_refused() {
    let fixture = Fixture::grid(2, 2, 6);
    assert!(bad(fixture.path(), &["curves", "recordings"], 1).contains("metrics.jsonl"));
    let mut l = Latents::read(&fixture.latents()).expect("latents");
    l.write(&fixture.path().join("runs/b/latents.arrow")).expect("latents");
    fixture::write_run(&fixture.path().join("runs/b"), 0.3);
    good(fixture.path(), &["compare", "runs/discs", "runs/b"]);
    let (said, _) = good(fixture.path(), &["curves", "runs/discs", "runs/b"]);
    assert!(said.starts_with("curves: 3 metrics of 2 runs"), "{said}");
    l.step[0] = 999;
    l.write(&fixture.path().join("runs/b/latents.arrow")).expect("latents");
    assert!(bad(fixture.path(), &["compare", "runs/discs", "runs/b"], 2).contains("not of the same rows"));
}

#[test]
fn results_can_be_had_as_json_and_options_from_a_file() {
    let fixture = Fixture::grid(2, 3, 8);
    std::fs::write(fixture.path().join("options.toml"), "seed = 5\n[nn]\nk = 2\nqueries = 3\n").expect("file");
    let (said, _) = good(fixture.path(), &["nn", "--json", "--quiet", "--config", "options.toml", "--queries", "4"]);
    let document: Value = serde_json::from_str(&said).expect("JSON on standard output");
    assert_eq!((&document["k"], &document["about"]["seed"]), (&Value::from(2), &Value::from(5)));
    assert_eq!(document["queries"].as_array().expect("queries").len(), 4);
}

#[test]
fn a_scene_is_right_to_reruns_own_tool() {
    let version =
        Command::new("rerun").arg("--version").output().map(|o| String::from_utf8_lossy(&o.stdout).into_owned());
    let Some(version) = version.ok().filter(|version| version.contains("0.36.")) else {
        println!("skipped: no Rerun 0.36 on this machine, the scene was not opened");
        return;
    };
    let out = folder();
    good(GRID.path(), &["scene", "--episodes", "3,7", "-o", text(out.path())]);
    let scene = out.path().join("scene.rrd");
    for words in [["rrd", "verify"], ["rrd", "stats"]] {
        let output = Command::new("rerun").args(words).arg(&scene).output().expect("Rerun starts");
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(output.status.success() && !said.contains("WARN") && !said.contains("ERROR"), "{version}: {said}");
    }
}

#[test]
fn a_report_is_one_whole_page_and_comes_alive_in_a_browser() {
    let out = folder();
    good(GRID.path(), &["report", "runs/discs", "--points", "60", "-o", text(out.path())]);
    let page = std::fs::read_to_string(out.path().join("report.html")).expect("page");
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"), "the page refers to the network");
    assert!(page.contains("How did training go?") && !page.contains("not available"), "a section failed");
    let Some(browser) = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|b| Command::new(b).arg("--version").output().is_ok())
    else {
        println!("skipped: no Chromium on this machine, the page was not opened");
        return;
    };
    // A mouse that moves to the place of point 17, as a hand would.
    let hover = "<script>addEventListener('load', () => { const live = document.querySelector('.live'), canvas = live.querySelector('canvas.cloud'); \
                 const [x, y] = live.place(17), box = canvas.getBoundingClientRect(); canvas.dispatchEvent(new MouseEvent('mousemove', \
                 {clientX: box.left + x * box.width / canvas.width, clientY: box.top + y * box.height / canvas.height})); });</script></body>";
    std::fs::write(out.path().join("hover.html"), page.replace("</body>", hover)).expect("page");
    let profile = folder();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
        ])
        .args(["--disable-component-update", "--disable-sync", "--virtual-time-budget=4000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", out.path().join("hover.html").display()))
        .output()
        .expect("the browser starts");
    let dom = String::from_utf8_lossy(&output.stdout);
    let card = dom.split("class=\"card\"").nth(1).and_then(|rest| rest.split("<img").next()).unwrap_or_default();
    assert!(dom.contains("data-point=\""), "hovering chose no point: {}", String::from_utf8_lossy(&output.stderr));
    assert!(card.contains("episode ") && card.contains("state "), "{card}");
    assert_eq!(card.matches("data-frame=").count(), 6, "the row and its five neighbours: {card}");
}
