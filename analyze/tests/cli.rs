//! `vibes-analyze` as a process: every verb end to end on a small synthetic recording, and what it says to bad input.

#![allow(missing_docs, reason = "a test")]

#[path = "cli/browser.rs"]
mod browser;
#[path = "cli/fixture.rs"]
mod fixture;
#[path = "cli/own_latents.rs"]
mod own_latents;
#[path = "cli/shared_folders.rs"]
mod shared_folders;
#[path = "cli/sizes.rs"]
mod sizes;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use browser::Browser;
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

/// The rows of some latents that are wanted.
fn rows_of(l: &Latents, is_wanted: impl Fn(usize) -> bool) -> Latents {
    let keep: Vec<usize> = (0..l.len()).filter(|&row| is_wanted(row)).collect();
    let of = |values: &[Option<u32>]| keep.iter().map(|&row| values[row]).collect::<Vec<_>>();
    Latents {
        episode: keep.iter().map(|&row| l.episode[row]).collect(),
        step: keep.iter().map(|&row| l.step[row]).collect(),
        state: of(&l.state),
        distractor: of(&l.distractor),
        reward: keep.iter().map(|&row| l.reward[row]).collect(),
        latent: keep.iter().flat_map(|&row| l.row(row).to_vec()).collect(),
        ..l.clone()
    }
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
    let verbs: [(&[&str], &[&str]); 8] = [
        (
            &["clusters", "--clusters", "4"],
            &["clusters.json", "clusters.arrow", "clusters.csv", "map-by-cluster.png", "map-by-cluster.svg"],
        ),
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
        (&["curves", "runs/discs"], &["curves.png", "curves.svg", "curves-table.png", "curves.json", "curves.arrow"]),
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
    let (_, said) = good(fixture.path(), &["nn", "--rows", "0:1,1:2,0:1", "-k", "2"]);
    assert!(said.contains("count once: 0:1"), "{said}");
    let (_, said) = good(fixture.path(), &["nn", "--queries", "2", "-k", "2"]);
    assert!(said.contains("runs/other/latents-x.arrow (the newest latents*.arrow"), "{said}");
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
fn a_table_over_runs_and_results_is_written_in_every_form() {
    let fixture = Fixture::grid(2, 2, 6);
    for (name, shift) in [("a", 0.0), ("b", 0.1), ("c", 0.2)] {
        fixture::write_run(&fixture.path().join("runs").join(name), shift);
    }
    let metrics = "adversary_minus_dynamics,batch_effective_rank";
    let (said, _) = good(fixture.path(), &["table", "runs/a", "runs/b", "runs/c", "--metrics", metrics]);
    let named = "table: adversary_minus_dynamics, batch_effective_rank of 3 runs by objective";
    assert!(said.starts_with(named) && said.contains("vibes"), "{said}");
    let (said, _) = good(fixture.path(), &["table", "runs/a", "--metrics", "adversary_minus_dynamics", "-o", "one"]);
    assert!(said.starts_with("table: adversary_minus_dynamics of 1 run by objective"), "{said}");
    // `objective` is a metric as well as a key.
    let metrics = fixture.path().join("runs/c/metrics.jsonl");
    std::fs::write(&metrics, "{\"update\":10,\"objective\":2.5}\n").expect("metrics");
    let (said, _) = good(fixture.path(), &["table", "runs/c", "--metrics", "objective", "--by", "run", "-o", "one"]);
    assert!(said.contains("2.50") && !said.contains("vibes"), "{said}");
    std::fs::write(&metrics, "{\"control_steps\":10,\"objective\":2.5}\n").expect("metrics");
    assert!(bad(fixture.path(), &["curves", "runs/a", "runs/c"], 2).contains("by control_steps and by update"));
    fixture::write_run(&fixture.path().join("runs/c"), 0.2);
    let damaged = fixture.path().join("runs/c/evaluation.json");
    std::fs::write(&damaged, "{\"report\":").expect("evaluation");
    assert!(bad(fixture.path(), &["table", "runs/c"], 1).contains("as `vibes-train evaluate` writes it"));
    std::fs::remove_file(damaged).expect("evaluation");
    let out = fixture.path().join("runs/a/figures");
    for file in ["table.md", "table.tex", "table.csv", "table.parquet", "table.png", "table.json"] {
        assert!(out.join(file).is_file() && said.contains(file), "{file}");
    }
    // A table of anyone's results, chosen by an expression; the best and the tied are marked.
    let mut csv = String::from("method,task,seed,return\n");
    for (method, base) in [("ours", 900), ("theirs", 880), ("noise", 100)] {
        for seed in 0..4 {
            csv +=
                &format!("{method},reacher,{seed},{}\n{method},walker,{seed},{}\n", base + 10 * seed, base / 2 + seed);
        }
    }
    std::fs::write(fixture.path().join("results.csv"), csv).expect("results");
    let (said, _) = good(fixture.path(), &["table", "results.csv", "--where", "seed < 3", "-o", "out"]);
    assert!(said.contains("return of 18 runs by method"), "{said}");
    let markdown = std::fs::read_to_string(fixture.path().join("out/table.md")).expect("Markdown");
    assert!(markdown.starts_with("| method | reacher | walker | average |"), "{markdown}");
    assert!(
        markdown.contains("| ours | **910 ± 25** |") && markdown.contains("| theirs | <u>890 ± 25</u> |"),
        "{markdown}"
    );
    assert!(
        bad(fixture.path(), &["table", "results.csv", "--metrics", "speed"], 2)
            .contains("choose among method, return, seed, task")
    );
    assert!(bad(fixture.path(), &["table", "results.csv", "--where", "seed > 9"], 2).contains("no row is chosen"));
    // Who has no number, because it diverged or is still at it, is not left out in silence.
    std::fs::write(fixture.path().join("lacking.csv"), "method,return\na,1\na,2\nb,5\nb,nan\nb,\n").expect("results");
    let (said, remarks) = good(fixture.path(), &["table", "lacking.csv", "-o", "out"]);
    assert!((said + &remarks).contains("2 of 5 runs have no such number and are left out: 2 of b"), "{remarks}");
}

#[test]
fn rows_are_chosen_and_a_users_own_column_colours_the_map() {
    let fixture = Fixture::grid(3, 3, 12);
    let rows: String = (0..9)
        .map(|episode| format!("{episode},{},{episode}\n", if episode % 2 == 0 { "even" } else { "odd" }))
        .collect();
    std::fs::write(fixture.path().join("mine.csv"), format!("episode,parity,time\n{rows}")).expect("table");
    let words = [
        "umap",
        "--where",
        "step >= 2 and parity = 'even'",
        "--join",
        "mine.csv",
        "--color",
        "parity,time",
        "--neighbours",
        "5",
    ];
    let (said, told) = good(fixture.path(), &words);
    assert!(said.contains("map-by-parity.png") && told.contains("55 of 117 rows are looked at"), "{said} {told}");
    // A column of one's own may be called like one of ours.
    assert!(said.contains("map-by-time.png") && said.contains("map-by-time-2.png"), "{said}");
    // Steps are unsigned numbers, whose differences are not.
    let (_, told) = good(fixture.path(), &["nn", "--where", "step - 11 >= 0"]);
    assert!(told.contains("18 of 117 rows are looked at"), "{told}");
    assert!(
        bad(fixture.path(), &["umap", "--color", "weather"], 2).contains("no table has a column weather, choose among")
    );
    assert!(bad(fixture.path(), &["nn", "--where", "step >"], 2).contains("nothing where a value is expected"));
    let mut l = Latents::read(&fixture.latents()).expect("latents");
    l.source.recording = None;
    l.write(&fixture.latents()).expect("latents");
    assert!(bad(fixture.path(), &["nn", "--where", "step > 99"], 2).contains("no row is chosen"));
}

#[test]
fn a_users_own_columns_are_probed_and_colour_the_scene() {
    let out = folder();
    let l = Latents::read(&GRID.latents()).expect("latents");
    let line = |row: usize| {
        let (first, drawn) = (l.row(row)[0], fixture::noise(row as u32));
        let half = if first > 0.0 { "right" } else { "left" };
        format!("{},{},{first},{drawn},{half},7\n", l.episode[row], l.step[row])
    };
    // Two rows have no line.
    let lines: String = (2..l.len()).map(line).collect();
    let mine = out.path().join("mine.csv");
    std::fs::write(&mine, format!("episode,step,height,drawn,half,same\n{lines}")).expect("table");
    let target = ["probe", "-o", text(out.path()), "--join", text(&mine), "--target", "height,drawn,half,same"];
    let (said, told) = good(GRID.path(), &target);
    assert!(said.contains("of your columns a mean of"), "{said}");
    assert!(told.contains("2 rows have no value") && told.contains("same does not vary"), "{told}");
    let probes = json(&out.path().join("probes.json"));
    let linear = |quantity: &str| {
        let all = probes["latent"].as_array().expect("scores").iter();
        all.filter(|score| score["probe"] == "linear")
            .find(|score| score["quantity"] == quantity)
            .expect("score")
            .clone()
    };
    let score = |quantity: &str| linear(quantity)["score"]["estimate"].as_f64().expect("score");
    assert!(score("height") > 0.99 && score("drawn") < 0.1, "{probes}");
    assert!(linear("half")["measure"] == "accuracy" && score("half") > 0.9);
    let sections = probes["quantities"].as_array().expect("sections");
    assert!(sections.iter().any(|named| named["quantity"] == "half" && named["section"] == "target"), "{sections:?}");
    let svg = std::fs::read_to_string(out.path().join("probes.svg")).expect("figure");
    assert!(svg.contains("columns of your own") && svg.contains("R², cross-validated over the table"));
    assert_eq!(probes["fitted_on"]["numbers"], "cross-validation");
    let unknown = ["probe", "-o", text(out.path()), "--target", "weather"];
    assert!(bad(GRID.path(), &unknown, 2).contains("no table has a column weather"));
    let color = ["scene", "--episodes", "3", "-o", text(out.path()), "--join", text(&mine), "--color", "half"];
    good(GRID.path(), &color);
    let colored = std::fs::read(out.path().join("scene.rrd")).expect("scene");
    good(GRID.path(), &color[..5]);
    assert_ne!(colored, std::fs::read(out.path().join("scene.rrd")).expect("scene"));
}

/// A table beside the grid's latents: `height` by the row, and in which half it lies.
fn heights(folder: &Path, name: &str, height: impl Fn(f32) -> String) -> PathBuf {
    let l = Latents::read(&GRID.latents()).expect("latents");
    let line = |row: usize| {
        let first = l.row(row)[0];
        let half = if first > 0.0 { "right" } else { "left" };
        format!("{},{},{},{half}\n", l.episode[row], l.step[row], height(first))
    };
    let path = folder.join(name);
    let lines: String = (0..l.len()).map(line).collect();
    std::fs::write(&path, format!("episode,step,height,half\n{lines}")).expect("table");
    path
}

#[test]
fn a_users_own_columns_are_fitted_on_other_latents() {
    let out = folder();
    let judged = heights(out.path(), "judged.csv", |first| first.to_string());
    let fit = GRID.latents();
    let words =
        ["probe", "-o", text(out.path()), "--join", text(&judged), "--target", "height,half", "--fit", text(&fit)];
    let score = |quantity: &str| {
        let probes = json(&out.path().join("probes.json"));
        let all = probes["latent"].as_array().expect("scores").clone();
        let found = all.iter().find(|score| score["probe"] == "linear" && score["quantity"] == quantity);
        found.expect("score")["score"]["estimate"].as_f64().expect("number")
    };
    let fitted_on = |table: &Path| good(GRID.path(), &[&words[..], &["--fit-join", text(table)]].concat());
    let (told, remarks) = fitted_on(&judged);
    assert!((told + &remarks).contains("an episode that is judged is among those to fit on"), "{remarks}");
    assert!(score("height") > 0.99 && score("half") > 0.9);
    let probes = json(&out.path().join("probes.json"));
    let numbers = &probes["numbers"];
    assert!(numbers["probe/height/s"].is_object() && numbers["probe_cross_validated/half/s"].is_object(), "{numbers}");
    assert!(numbers["probe/half/s"].is_null() && numbers["probe_cross_validated/height/s"].is_null(), "{numbers}");
    assert_eq!(probes["fitted_on"]["numbers"]["episodes"], probes["fitted_on"]["numbers"]["of_episodes"], "{probes}");
    let svg = std::fs::read_to_string(out.path().join("probes.svg")).expect("figure");
    assert!(svg.contains("R², fitted on other recordings (classes cross-validated)"), "{svg:.3000}");
    // Where the other table says the opposite, so does the probe; classes are judged within the table.
    fitted_on(&heights(out.path(), "opposite.csv", |first| (-first).to_string()));
    assert!(score("height") < -1.0 && score("half") > 0.9, "{}", score("height"));

    let twice = [&words[..], &["--fit", text(&fit), "--fit-join", text(&judged)]].concat();
    assert!(bad(GRID.path(), &twice, 2).contains("1 of --fit-join and 2 of --fit"));
    good(GRID.path(), &[&twice[..], &["--fit-join", text(&judged), "--probe-episodes", "6"]].concat());
    let fitted = json(&out.path().join("probes.json"))["fitted_on"]["numbers"].clone();
    assert!(fitted["episodes"].as_u64().expect("number") <= 6 && score("height") > 0.9, "{fitted}");
    assert_eq!(fitted["latents"].as_array().map(Vec::len), Some(2), "{fitted}");

    assert!(bad(GRID.path(), &words, 2).contains("no table has a column height"));
    let texts = heights(out.path(), "texts.csv", |first| if first > 0.0 { "high".into() } else { "low".into() });
    let error = bad(GRID.path(), &[&words[..], &["--fit-join", text(&texts)]].concat(), 2);
    assert!(error.contains("--target height: it holds numbers"), "{error}");
    assert!(bad(GRID.path(), &[&words[..7], &["--fit-join", text(&judged)]].concat(), 2).contains("--fit"));
}

#[test]
fn a_column_colours_the_grid_and_the_map_of_clusters() {
    let out = folder();
    let mine = heights(out.path(), "mine.csv", |first| first.to_string());
    let words = |verb: &'static str, color: &'static str| {
        [verb, "-o", text(out.path()), "--join", text(&mine), "--color", color].map(String::from)
    };
    let run = |words: &[String]| good(GRID.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
    let picture = || std::fs::read_to_string(out.path().join("grid.svg")).expect("figure");
    good(GRID.path(), &["grid", "-o", text(out.path())]);
    let by_time = picture();
    run(&words("grid", "half"));
    assert!(picture().contains("left") && picture() != by_time);
    run(&words("grid", "height"));
    assert!(picture().contains("height") && picture() != by_time);
    let (said, _) = run(&words("clusters", "height,half"));
    assert!(said.contains("map-by-height.png") && said.contains("map-by-half.png"), "{said}");
    let table = std::fs::read_to_string(out.path().join("clusters.csv")).expect("table");
    assert!(table.contains("height") && table.contains("half,left") && table.contains("half,right"), "{table}");
    let groups = json(&out.path().join("clusters.json"))["clusters"].clone();
    let half = |group: &Value| {
        let all = group["quantities"].as_array().expect("quantities");
        all.iter().find(|typical| typical["quantity"] == "half").expect("half")["kind"].clone()
    };
    assert!(groups.as_array().expect("groups").iter().all(|group| half(group).is_string()), "{groups}");

    let other = out.path().join("other.csv");
    std::fs::write(&other, "episode,height\n999,1.5\n").expect("table");
    for verb in ["grid", "clusters", "umap"] {
        let words = [verb, "-o", text(out.path()), "--join", text(&other), "--color", "height"];
        assert!(bad(GRID.path(), &words, 2).contains("--color height: no row has a value of it"), "{verb}");
    }
}

#[test]
fn what_latents_show_is_drawn_side_by_side() {
    let fixture = Fixture::grid(2, 2, 30);
    let row = |step: u32, shade: u8| vibes_data::DecodedRow {
        strip: 0,
        episode: 1,
        step,
        start: 8,
        recorded: vec![200; 48],
        shown: vec![shade; 48],
        predicted: (step >= 8).then(|| vec![shade / 2; 48]),
    };
    for (run, shade, from) in [("a", 100, 5), ("b", 60, 5), ("c", 60, 6)] {
        let rows = (from..20).map(|step| row(step, shade)).collect();
        let decoded = vibes_data::Decoded { size: (4, 4), rows, explained: Some(0.5), ..Default::default() };
        let path = fixture.path().join("runs").join(run);
        std::fs::create_dir_all(&path).expect("run");
        decoded.write(&path.join("decoded.arrow")).expect("pictures");
    }
    let (said, _) = good(fixture.path(), &["decode", "runs/a", "runs/b"]);
    assert!(said.starts_with("decode: 1 strips; pixel variance that the latent shows: a 50%, b 50%"), "{said}");
    let svg = std::fs::read_to_string(fixture.path().join("runs/a/figures/decoded.svg")).expect("figure");
    assert!(svg.contains("b: predicted") && svg.contains("a: shown"));
    assert!(bad(fixture.path(), &["decode", "runs/a", "runs/c"], 2).contains("show different rows"));
    assert!(bad(fixture.path(), &["decode", "runs/discs"], 2).contains("vibes-train decode"));
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

/// Each state's cells hold the same values in the same order: shuffled from state to state, such a column would stay what it is.
#[test]
fn a_column_that_is_the_distractors_is_not_read_once_it_is_shuffled() {
    let out = folder();
    let l = Latents::read(&GRID.latents()).expect("latents");
    let shade = |row: usize| f64::from(l.distractor[row].unwrap_or_default()).sin();
    let line = |row: usize| format!("{},{},{}\n", l.episode[row], l.step[row], shade(row));
    let lines: String = (0..l.len()).map(line).collect();
    let mine = out.path().join("shades.csv");
    std::fs::write(&mine, format!("episode,step,shade\n{lines}")).expect("table");
    good(GRID.path(), &["probe", "-o", text(out.path()), "--join", text(&mine), "--target", "shade"]);
    let probes = json(&out.path().join("probes.json"));
    let all = probes["latent"].as_array().expect("scores").iter();
    for score in all.filter(|score| score["quantity"] == "shade") {
        let [read, shuffled] = ["score", "shuffled"].map(|what| score[what]["estimate"].as_f64().expect("number"));
        assert!(shuffled < 0.6 && (read > 0.9 || score["probe"] == "knn"), "{score}");
    }
}

/// A column of a grid has many states and one distractor: the task is probed, and what the distractor decides is named as left out.
#[test]
fn one_column_of_a_grid_is_probed_for_its_task() {
    let folder = folder();
    let out = ["-o", text(folder.path())];
    let (line, said) = good(GRID.path(), &[&["probe", "--where", "distractor = 0"][..], &out].concat());
    assert!(line.contains("read of the task a mean of"), "{line}");
    assert!(said.contains("video frame, self blue are of one trajectory here"), "{said}");
    assert!(line.contains("of the distractors nothing (none can be held out)"), "{line}");
    let l = Latents::read(&GRID.latents()).expect("latents");
    let column = rows_of(&l, |row| l.distractor[row] == Some(0));
    ["a.arrow", "b.arrow"].iter().for_each(|name| column.write(&folder.path().join(name)).expect("latents"));
    good(folder.path(), &["compare", "a.arrow", "b.arrow"]);
}

/// A row of a grid has one state and many distractors: the task varies, and has no other trajectory to be judged on.
#[test]
fn one_row_of_a_grid_is_probed_for_its_distractors() {
    let folder = folder();
    let (line, said) = good(GRID.path(), &["probe", "--where", "state = 0", "-o", text(folder.path())]);
    assert!(line.contains("read of the task nothing (none can be held out), of the distractors a mean of"), "{line}");
    assert!(said.contains("position[0], ") && said.contains("are of one trajectory here"), "{said}");
}

#[test]
fn wrong_arguments_say_what_would_be_right() {
    let here = GRID.path();
    assert!(bad(here, &["nn", "--metric", "manhattan"], 2).contains("standardized, euclidean, cosine"));
    assert!(bad(here, &["nn", "--rows", "3:999"], 2).contains("no row 3:999"));
    assert!(bad(here, &["nn", "--rows", "three"], 2).contains("EPISODE:STEP"));
    assert!(bad(here, &["nn", "--k", "0"], 2).contains("--k is 0"));
    assert!(bad(here, &["grid", "--panels", "4by4"], 2).contains("NxM"));
    assert!(bad(here, &["grid", "--states", "9"], 2).contains("choose among 0, 1, 2, 3"));
    assert!(bad(here, &["scene", "--episodes", "77"], 2).contains("no such episode"));
    assert!(bad(here, &["curves", "runs/discs", "--metrics", "sharpness"], 2).contains("choose among"));
    assert!(bad(here, &["umap", "--neighbours", "1"], 2).contains("at least 2"));
    assert!(bad(here, &["symmetry"], 2).contains("to_target"));
    assert!(bad(here, &["symmetry", "--pairs", "0"], 2).contains("--pairs is 0"));
    assert!(bad(here, &["invariance", "--queries", "0"], 2).contains("--queries"));
    assert!(bad(here, &["embed"], 2).contains("unrecognized subcommand"));
    assert!(bad(here, &["nn", "--config", "none.toml"], 2).contains("none.toml"));
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
    std::fs::write(&path, b"\x7fELF\x02\x01 and no table").expect("file");
    refused("a file of another kind", &["nn"]);
    std::fs::write(&path, b"episode,step,latents\n0,0,1.5\n").expect("file");
    refused("column latent (or latent_0, latent_1 and so on) is missing", &["nn"]);
    let mut nan = l.clone();
    nan.latent[7] = f32::NAN;
    nan.write(&path).expect("latents");
    refused("episode 0, step 1: dimension 2 of the latent is NaN", &["nn"]);
    Latents { latent: vec![0.25; l.latent.len()], ..l.clone() }.write(&path).expect("latents");
    refused("", &["nn", "--no-frames"]);
    l.write(&path).expect("latents");
    refused("only", &["nn", "-k", "500", "--no-frames"]);
    refused("", &["umap", "--neighbours", "500"]);
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
    assert!(error.contains("column latent: it holds f32; a list of numbers"), "{error}");
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
    good(fixture.path(), &["report", "runs/discs", "--recording", "moved/discs", "--points", "20", "-o", "page"]);
    let page = std::fs::read_to_string(fixture.path().join("page/report.html")).expect("page");
    assert!(page.contains("UMAP 1") && !page.contains("unexpected argument"));
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
    let holes = rows_of(&l, |row| l.episode[row] != 4);
    holes.write(&fixture.latents()).expect("latents");
    let (_, said) = good(fixture.path(), &["grid"]);
    assert!(said.contains("1 of 12 cells were not recorded"), "{said}");
    let (_, said) = good(fixture.path(), &["grid", "--where", "episode != 0", "-o", "chosen"]);
    assert!(said.contains("2 of 12 cells have no row that --where chooses"), "{said}");
    let svg = std::fs::read_to_string(fixture.path().join("chosen/grid.svg")).expect("figure");
    assert!(svg.contains("not chosen") && !svg.contains("not recorded"));
    let (_, said) = good(fixture.path(), &["invariance"]);
    assert!(said.contains("state trajectories [1] lack a cell"), "{said}");
    let short = rows_of(&l, |row| l.episode[row] != 4 || l.step[row] < 3);
    short.write(&fixture.latents()).expect("latents");
    std::fs::copy(fixture.latents(), fixture.path().join("copy.arrow")).expect("a copy");
    for verb in [&["invariance"][..], &["compare", text(&fixture.latents()), "copy.arrow"]] {
        let (_, said) = good(fixture.path(), verb);
        assert!(said.contains("not equally long") && said.contains("steps that some cell lacks"), "{verb:?}: {said}");
    }
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
    let whole = |run: &str| fixture.path().join(run);
    good(fixture.path(), &["compare", text(&whole("runs/discs")), text(&whole("runs/b"))]);
    let written = std::fs::read_to_string(whole("runs/discs/figures/compare.json")).expect("JSON");
    assert!(!written.contains(text(fixture.path())) && written.contains("past_actions\": {"), "{written}");
    let (said, _) = good(fixture.path(), &["curves", "runs/discs", "runs/b"]);
    assert!(said.starts_with("curves: 3 metrics of 2 runs"), "{said}");
    let twice = "batch_effective_rank,batch_effective_rank";
    let (said, _) = good(fixture.path(), &["curves", "runs/discs", "runs/b", "--metrics", twice]);
    assert!(said.starts_with("curves: 1 metrics of 2 runs"), "{said}");
    let (said, _) = good(fixture.path(), &["table", "runs/discs", "runs/b", "--metrics", twice, "--by", "objective"]);
    assert!(said.starts_with("table: batch_effective_rank of 2 runs by objective"), "{said}");
    for verb in ["curves", "table", "report"] {
        let said = bad(fixture.path(), &[verb, "runs/discs", "runs/b/../discs"], 2);
        assert!(said.contains("would count twice") && said.contains("runs/discs and runs/b/../discs"), "{said}");
    }
    l.reward[0] = l.reward[0].map(|reward| 1.0 - reward);
    l.write(&fixture.path().join("runs/b/latents.arrow")).expect("latents");
    let said = bad(fixture.path(), &["compare", "runs/discs", "runs/b"], 2);
    assert!(said.contains("at step 0 of episode 0"), "another recording of the same size: {said}");
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
fn a_scene_of_an_online_run_shows_its_episodes_as_the_policy_improved() {
    let fixture = Fixture::grid(2, 2, 10);
    let run = fixture.path().join("runs/online");
    fixture::write_run(&run, 0.0);
    let cells: Vec<vibes_data::Cell> = (0..30).map(|i| vibes_data::Cell { state: i, distractor: 0 }).collect();
    fixture::write_recording(&run.join("replay"), &cells, 8, None);
    let line = "{\"update\":100,\"control_steps\":400,\"held_out\":{\"mean_return\":5.5,\"interval\":[4.0,7.0],\"returns\":[5,6]}}\n";
    std::fs::write(run.join("evaluations.jsonl"), line).expect("evaluations");
    let (said, _) = good(fixture.path(), &["scene", "runs/online", "--json"]);
    let said: Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(
        (said["episodes"].as_array().map(Vec::len), &said["of"], &said["evaluations"]),
        (Some(12), &30.into(), &1.into())
    );
    assert!(run.join("figures/scene.rrd").metadata().is_ok_and(|m| m.len() > 10_000));
    assert!(bad(fixture.path(), &["scene", "runs/online", "--episodes", "99"], 2).contains("no such episode"));
    assert!(bad(fixture.path(), &["scene", "runs/discs", "--replay"], 2).contains("name its folder"));
}

#[test]
fn a_scene_is_right_to_reruns_own_tool() {
    let version =
        Command::new("rerun").arg("--version").output().map(|o| String::from_utf8_lossy(&o.stdout).into_owned());
    let version = version.ok().filter(|version| version.contains("0.36.")).expect(
        "Rerun 0.36 is on the PATH; run `make test`, or: setup/python.sh && export PATH=\"$(setup/python.sh --where)/bin:$PATH\"",
    );
    let out = folder();
    good(GRID.path(), &["scene", "--episodes", "3,7", "-o", text(out.path())]);
    let scene = out.path().join("scene.rrd");
    for words in [["rrd", "verify"], ["rrd", "stats"]] {
        let output = Command::new("rerun").args(words).arg(&scene).output().expect("Rerun starts");
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(output.status.success() && !said.contains("WARN") && !said.contains("ERROR"), "{version}: {said}");
    }
}

/// A report on the shared recording, made once.
static REPORT: LazyLock<PathBuf> = LazyLock::new(|| {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("analyze-report");
    let _ = std::fs::remove_dir_all(&out);
    let notes = out.join("notes.csv");
    std::fs::create_dir_all(&out).expect("folder");
    let lines: String = (0..20).map(|episode| format!("{episode},{}\n", ["calm", "windy"][episode % 2])).collect();
    std::fs::write(&notes, format!("episode,weather\n{lines}")).expect("notes");
    let words =
        ["report", "runs/discs", "--points", "60", "-o", text(&out), "--join", text(&notes), "--color", "weather"];
    good(GRID.path(), &words);
    out.join("report.html")
});

#[test]
fn a_report_is_one_whole_page_that_opens_with_the_verdict() {
    let page = std::fs::read_to_string(&*REPORT).expect("page");
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"), "the page refers to the network");
    assert!(page.contains("How did training go?") && !page.contains("not available"), "a section failed");
    let home = GRID.path().to_string_lossy().into_owned();
    assert!(!page.contains(&home), "a path of this machine is in the page");
    let verdict = page.find("<table class=\"verdict\">").expect("verdict");
    assert!(verdict < page.find("<h2").expect("chapters"), "the verdict comes first");
    let table = &page[verdict..verdict + page[verdict..].find("</table>").expect("end")];
    for part in [
        "What do the latents hold?",
        "What do they ignore?",
        "past actions alone",
        "chance:",
        "Variance that the state explains",
    ] {
        assert!(table.contains(part), "{part} is missing in {table}");
    }
    assert!(page.len() < 15_000_000);
}

/// A tenth of the rows that a report is to carry within its 15 MB, beside a report of few: what grows with the rows is their share of the map alone.
#[test]
fn a_table_of_one_episode_has_a_page_without_neighbours_and_runs_called_alike_have_pages_of_their_own() {
    let folder = folder();
    let rows: String = (0..40).map(|step| format!("0,{step},{},{}\n", step % 7, step * step % 11)).collect();
    for run in ["a/run", "b/run"] {
        std::fs::create_dir_all(folder.path().join(run)).expect("folder");
        std::fs::write(folder.path().join(run).join("latents.csv"), format!("episode,step,latent_0,latent_1\n{rows}"))
            .expect("CSV");
    }
    let (said, _) = good(folder.path(), &["report", "a/run/latents.csv", "-o", "one"]);
    assert!(said.contains("report:") && folder.path().join("one/report.html").is_file(), "{said}");
    good(folder.path(), &["report", "a/run/latents.csv", "b/run/latents.csv", "-o", "two"]);
    let (_, said) = good(folder.path(), &["scene", "a/run/latents.csv", "-o", "scene"]);
    assert!(said.contains("of one episode, so that its own rows count"), "{said}");
    let dense = ["clusters", "a/run/latents.csv", "--by", "dbscan", "--min-points", "1000000000000000000"];
    good(folder.path(), &dense);
    assert!(["run", "run-2"].iter().all(|name| folder.path().join("two").join(name).is_dir()));
}

#[test]
fn a_page_grows_little_with_the_rows() {
    let (mut rows, mut bytes) = (Vec::new(), Vec::new());
    for (states, steps) in [(2, 30), (8, 77)] {
        let fixture = Fixture::grid(states, 4, steps);
        let out = fixture.path().join("report");
        good(fixture.path(), &["report", "runs/discs", "--points", "60", "-o", text(&out)]);
        rows.push(f64::from(states * 4 * (steps + 1)));
        bytes.push(std::fs::metadata(out.join("report.html")).expect("page").len() as f64);
    }
    let of_a_row = (bytes[1] - bytes[0]) / (rows[1] - rows[0]);
    println!("{bytes:?} bytes for {rows:?} rows: {of_a_row:.0} a row");
    assert!(bytes[0] + 25_000.0 * of_a_row < 15e6, "{of_a_row} bytes a row");
}

/// The middle of an element, for a click.
fn middle(selector: &str) -> String {
    format!(
        "(e => {{ e.scrollIntoView({{ block: 'center' }}); const b = e.getBoundingClientRect(); \
         return [b.left + b.width / 2 + scrollX, b.top + b.height / 2 + scrollY]; }})(document.querySelector({selector:?}))"
    )
}

/// Where a point of the first map lies on the page; `of` says which.
fn point(of: &str) -> String {
    format!(
        "(() => {{ const m = maps[0], c = m.canvas; c.scrollIntoView({{ block: 'center' }}); const b = c.getBoundingClientRect(); \
         const [x, y] = m.place({of}); return [x + b.left + scrollX, y + b.top + scrollY]; }})()"
    )
}

#[test]
fn a_click_a_drag_and_a_key_on_the_map_are_answered() {
    let mut browser = Browser::open(&REPORT, (1280, 900), false);
    browser.keep("report-top.png");
    let painted = browser.read("performance.getEntriesByName('first-contentful-paint')[0].startTime").as_f64();
    println!("first paint after {painted:?} ms");
    // A second is the aim, on an idle machine and with 25,000 rows (docs/measurements.md); tests run beside each other.
    assert!(painted.is_some_and(|milliseconds| milliseconds < 5000.0), "{painted:?}");
    // A click on a point shows its row, its frame and its neighbours' frames.
    browser.click(&point("m.alive[17]"));
    let row = browser.read("maps[0].chosen");
    assert!(row.is_u64() && browser.text(".card").contains("episode "), "no row was chosen: {row}");
    browser.read("new Promise(done => setTimeout(done, 300))");
    let neighbours = browser.read("document.querySelectorAll('.card .strip button').length");
    assert_eq!(neighbours, 5);
    let inked = "[...document.querySelectorAll('.card canvas')].every(c => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v, i) => i % 4 < 3 && v > 0 && v < 255))";
    assert_eq!(browser.read(inked), true, "frames are drawn");
    browser.keep("report-chosen.png");
    // A click on a neighbour goes there.
    browser.click(&middle(".card .strip button"));
    assert_ne!(browser.read("maps[0].chosen"), row);
    // The slider and the keys run through the episode.
    let before = browser.read("maps[0].step[maps[0].chosen]").as_u64().expect("step");
    browser.read("document.querySelector('canvas.cloud').focus()");
    let (key, later) = if before < 15 { ("ArrowRight", true) } else { ("ArrowLeft", false) };
    browser.key(key);
    let after = browser.read("maps[0].step[maps[0].chosen]").as_u64().expect("step");
    assert!((after > before) == later && after != before, "{before} and {after}");
    browser.read("(s => { s.value = 0; s.dispatchEvent(new Event('input')); })(document.querySelector('.time'))");
    assert_eq!(browser.read("maps[0].chosen === maps[0].film()[0]"), true);
    // Zooming and dragging move the view.
    browser.wheel(&middle("canvas.cloud"), -300.0);
    browser.read("new Promise(done => setTimeout(done, 100))");
    assert!(browser.read("maps[0].view.zoom").as_f64().expect("zoom") > 1.5);
    let view = browser.read("[maps[0].view.x, maps[0].view.y]");
    let shifted = format!("(([x, y]) => [x + 90, y + 40])({})", middle("canvas.cloud"));
    browser.drag(&middle("canvas.cloud"), &shifted, false);
    assert_ne!(browser.read("[maps[0].view.x, maps[0].view.y]"), view);
    browser.click(&middle(".whole"));
    // Shift and a drag over everything choose everything, and a column of the user's own colours it.
    let corner = |x: f64, y: f64| {
        format!(
            "(b => [b.left + b.width * {x} + scrollX, b.top + b.height * {y} + scrollY])((c => (c.scrollIntoView({{ block: 'center' }}), c.getBoundingClientRect()))(document.querySelector('canvas.cloud')))"
        )
    };
    browser.read("(s => { s.value = [...s.options].findIndex(o => o.textContent === 'weather'); s.dispatchEvent(new Event('change')); })(document.querySelector('.tools select'))");
    assert!(browser.text(".legend").contains("windy"));
    browser.drag(&corner(0.01, 0.01), &corner(0.99, 0.99), true);
    let rows = browser.read("maps[0].x.length").as_u64().expect("rows");
    assert_eq!(browser.read("Number(document.querySelector('.live').dataset.selected)").as_u64(), Some(rows));
    assert!(
        browser.text(".chosen").contains(&format!("{rows} rows in the region"))
            && browser.text(".chosen").contains("calm:")
    );
    browser.read("new Promise(done => setTimeout(done, 300))");
    browser.keep("report-region.png");
    // Every control has a name, every picture says what it shows.
    let nameless = "[...document.querySelectorAll('button, select, input')].filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)).length";
    assert_eq!(browser.read(nameless), 0);
    assert_eq!(browser.read("[...document.images].filter(i => i.alt.length < 10).length"), 0);
}

#[test]
fn the_report_fits_a_phone() {
    let mut browser = Browser::open(&REPORT, (390, 844), true);
    browser.keep("report-phone.png");
    let wider = "[...document.querySelectorAll('main *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1 && !e.closest('pre, .wide')).map(e => e.tagName + '.' + e.className).slice(0, 5).join()";
    assert_eq!(browser.read(wider), "", "these are wider than the window");
    assert!(browser.read("document.documentElement.scrollWidth").as_f64().expect("width") <= 391.0);
    let small = "[...document.querySelectorAll('.tools button, .tools select')].filter(e => e.getBoundingClientRect().height < 32).length";
    assert_eq!(browser.read(small), 0, "too small for a finger");
    browser.click(&point("m.alive[5]"));
    assert!(browser.text(".card").contains("episode "));
    browser.keep("report-phone-map.png");
}
