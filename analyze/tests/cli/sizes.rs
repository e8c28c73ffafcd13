//! Inputs that are much larger or smaller than those that figures and numbers are made for.

use std::process::Command;

use arrow::array::AsArray as _;
use serde_json::Value;

use super::fixture::{self, Fixture};
use super::{GRID, PROGRAM, folder, good, json, text};

#[test]
fn numbers_of_very_many_runs_are_there_without_the_figures_that_are_too_large() {
    let folder = folder();
    let runs: Vec<String> = (0..201).map(|run| format!("runs/run-{run}")).collect();
    for (at, run) in runs.iter().enumerate() {
        fixture::write_run(&folder.path().join(run), 0.001 * at as f64);
    }
    let out = folder.path().join("out");
    std::fs::create_dir_all(&out).expect("folder");
    std::fs::write(out.join("curves-table.png"), "of fewer runs").expect("figure");
    let runs = runs.iter().map(String::as_str);
    let words: Vec<&str> = ["curves", "--by", "run", "-o", "out"].into_iter().chain(runs).collect();
    let (said, told) = good(folder.path(), &words);
    assert!(told.contains("the figure curves-table is not drawn"), "{told}");
    assert!(said.contains("curves.json") && said.contains("curves.arrow") && !said.contains("curves-table"), "{said}");
    assert!(!out.join("curves-table.png").exists(), "the table of other runs is still there");
    assert_eq!(json(&out.join("curves.json"))["groups"].as_array().map(Vec::len), Some(201));
}

#[test]
fn a_wide_table_is_drawn_in_parts_and_a_very_wide_one_is_there_without_its_figure() {
    let folder = folder();
    let table_of = |tasks: usize| {
        let rows: String = (0..tasks).map(|task| format!("ours,task-{task},{task}\n")).collect();
        std::fs::write(folder.path().join("wide.csv"), format!("method,task,return\n{rows}")).expect("results");
        let words = good(folder.path(), &["table", "wide.csv", "-o", "out"]);
        let table = std::fs::read_to_string(folder.path().join("out/table.csv")).expect("table");
        assert_eq!(table.lines().count(), tasks + 1);
        words
    };
    let (said, told) = table_of(300);
    assert!(said.contains("table.png") && !told.contains("not drawn"), "{told}");
    let (width, _) = image::image_dimensions(folder.path().join("out/table.png")).expect("figure");
    assert!(f64::from(width) <= 6.9 * 300.0 + 1.0, "{width} pixels are wider than a page");
    let (said, told) = table_of(2000);
    assert!(told.contains("the figure table is not drawn"), "{told}");
    assert!(said.contains("table.csv") && !folder.path().join("out/table.png").exists(), "{said}");
}

#[test]
fn small_tables_are_compared_by_the_neighbours_that_they_have() {
    let folder = folder();
    let write = |episodes: u32| {
        let row = |row: u32| format!("{},{},{},{}\n", row / 3, row % 3, row * row % 7, row * 5 % 11);
        let rows: String = (0..3 * episodes).map(row).collect();
        for name in ["a.csv", "b.csv"] {
            std::fs::write(folder.path().join(name), format!("episode,step,latent_0,latent_1\n{rows}")).expect("CSV");
        }
    };
    let shared = |out: &str| {
        let compared = json(&folder.path().join(out).join("compare.json"));
        (compared["tables"][1]["neighbours_shared_with_first"].as_f64(), compared["k"].as_u64())
    };
    write(2);
    let (_, told) = good(folder.path(), &["compare", "a.csv", "b.csv", "-o", "two"]);
    assert!(told.contains("is of 3 neighbours rather than 10"), "{told}");
    assert_eq!(shared("two"), (Some(1.0), Some(3)));
    let batches = vibes_data::read_table(&folder.path().join("two/compare.arrow")).expect("table");
    let measures = batches[0].column_by_name("measure").expect("column").as_string::<i32>();
    assert!(measures.iter().flatten().all(|measure| measure == "neighbours_shared_with_first"), "{measures:?}");
    write(1);
    let (_, told) = good(folder.path(), &["compare", "a.csv", "b.csv", "-o", "one"]);
    assert!(told.contains("neighbours_shared_with_first is left out: these latents are of one episode"), "{told}");
    assert_eq!(shared("one"), (None, None));
}

#[test]
fn groups_without_task_quantities_have_a_row_each() {
    let out = folder();
    good(GRID.path(), &["clusters", "--clusters", "3", "--no-frames", "-o", text(out.path())]);
    let table = std::fs::read_to_string(out.path().join("clusters.csv")).expect("table");
    let rows = table.lines().skip(1).map(|line| line.split(',').nth(1).and_then(|rows| rows.parse::<usize>().ok()));
    let rows: Vec<usize> = rows.collect::<Option<_>>().expect("numbers of rows");
    assert_eq!((rows.len(), rows.iter().sum::<usize>()), (3, 620), "{table}");
    let options = &json(&out.path().join("clusters.json"))["about"]["options"];
    assert_eq!((options["by"].as_str(), options["clusters"].as_u64()), (Some("kmeans"), Some(3)), "{options}");
}

#[test]
fn every_retrieval_that_a_small_grid_lacks_is_named() {
    let fixture = Fixture::grid(2, 2, 6);
    let (_, told) = good(fixture.path(), &["invariance", "-k", "1,15"]);
    for measure in ["retrieval_same_step", "retrieval_any_step"] {
        assert!(told.contains(&format!("{measure}@15 is left out")), "{told}");
        assert!(!told.contains(&format!("{measure}@1 is left out")), "{told}");
    }
}

#[test]
fn a_report_passes_on_what_opening_the_latents_said() {
    let fixture = Fixture::grid(2, 3, 6);
    std::fs::write(fixture.path().join("notes.csv"), "episode,weather\n0,calm\n1,windy\n2,calm\n").expect("table");
    let notes = fixture.path().join("notes.csv");
    let words = ["report", "runs/discs", "--points", "20", "--join", text(&notes), "--color", "weather", "-o", "page"];
    let (_, told) = good(fixture.path(), &words);
    let page = std::fs::read_to_string(fixture.path().join("page/report.html")).expect("page");
    for text in [&told, &page] {
        assert!(text.contains("21 of 42 rows have no row in notes.csv"), "{told}");
    }
}

#[test]
fn a_rate_card_names_the_threads_that_it_used() {
    let mut command = Command::new(PROGRAM);
    let output = command.args(["bench", "--quick", "--json"]).env("RAYON_NUM_THREADS", "1").output().expect("runs");
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(said["threads"], 1);
}
