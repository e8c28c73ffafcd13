//! Verbs that write into one folder, and maps that lie there from before.

use std::path::Path;

use serde_json::Value;
use vibes_analyze::output::{GraphTable, MapTable};
use vibes_data::Latents;

use super::fixture::Fixture;
use super::{good, json, text};

/// Runs a verb with its output in the folder `shared` and returns what it says beside its result.
fn shared(fixture: &Fixture, words: &[&str]) -> String {
    good(fixture.path(), &[words, &["-o", "shared"]].concat()).1
}

#[test]
fn verbs_that_are_asked_for_no_map_draw_on_the_one_that_is_there() {
    let fixture = Fixture::grid(3, 3, 10);
    let folder = fixture.path().join("shared");
    let map = || std::fs::read(folder.join("map.arrow")).expect("map");
    shared(&fixture, &["umap", "--min-dist", "0.5", "--seed", "3"]);
    let made = map();
    let report = ["report", "runs/discs", "--points", "20"];
    for verb in [&["clusters"][..], &["grid"], &["scene", "--episodes", "3"], &report] {
        let said = shared(&fixture, verb);
        assert!(said.contains("min_dist 0.5") && said.contains("seed 3"), "{verb:?}: {said}");
        assert_eq!(map(), made, "{verb:?} replaced the map");
    }
    for file in ["map.json", "clusters.json", "grid.json", "scene.json"] {
        let how = &json(&folder.join(file))["about"]["map"];
        assert_eq!((how["options"]["min_dist"].as_f64(), how["seed"].as_u64()), (Some(0.5), Some(3)), "{file}: {how}");
    }
}

#[test]
fn a_map_that_takes_the_place_of_another_one_says_so() {
    let fixture = Fixture::grid(3, 3, 10);
    assert!(!shared(&fixture, &["umap", "--min-dist", "0.5"]).contains("replaced"));
    for verb in [&["grid", "--min-dist", "0.3"][..], &["clusters", "--seed", "4"], &["umap"]] {
        let said = shared(&fixture, verb);
        assert!(said.contains("made with other options was there and was replaced"), "{verb:?}: {said}");
    }
    let said = shared(&fixture, &["clusters", "--where", "step > 1"]);
    assert!(said.contains("of other latents or rows was there and was replaced"), "{said}");
}

#[test]
fn the_table_of_curves_and_that_of_runs_are_two_files() {
    let fixture = Fixture::grid(2, 2, 6);
    let folder = fixture.path().join("shared");
    let metric = ["--metrics", "batch_effective_rank"];
    shared(&fixture, &[&["table", "runs/discs"][..], &metric].concat());
    let written = std::fs::read(folder.join("table.png")).expect("table");
    shared(&fixture, &["curves", "runs/discs"]);
    assert_eq!(std::fs::read(folder.join("table.png")).expect("table"), written);
    assert!(folder.join("curves-table.png").is_file() && folder.join("curves-table.svg").is_file());
}

/// A recipe as an older program wrote it.
fn without(recipe: &str, version: &str) -> String {
    let mut recipe: Value = serde_json::from_str(recipe).expect("a recipe");
    recipe.as_object_mut().expect("fields").remove(version).expect("a version");
    recipe.to_string()
}

#[test]
fn maps_and_graphs_of_an_older_program_are_made_anew() {
    let fixture = Fixture::grid(3, 3, 10);
    let folder = fixture.path().join("shared");
    shared(&fixture, &["umap"]);
    assert!(shared(&fixture, &["umap"]).contains("still right"));
    let (map, graph) = (folder.join("map.arrow"), folder.join("graph.arrow"));
    let older = MapTable::read(&map).expect("map");
    MapTable { recipe: without(&older.recipe, "layout"), ..older }.write(&map).expect("written");
    let said = shared(&fixture, &["grid"]);
    assert!(!said.contains("still right") && said.contains("by another version of this program"), "{said}");
    assert!(said.contains("neighbour graph used again"), "{said}");
    let older = GraphTable::read(&graph).expect("graph");
    GraphTable { recipe: without(&older.recipe, "graph"), ..older }.write(&graph).expect("written");
    assert!(!shared(&fixture, &["umap", "--min-dist", "0.4"]).contains("neighbour graph used again"));
}

#[test]
fn new_latents_are_placed_on_a_map_of_some_rows() {
    let fixture = Fixture::grid(3, 3, 20);
    let later = fixture.path().join("later.arrow");
    Latents::read(&fixture.latents()).expect("latents").write(&later).expect("latents");
    good(fixture.path(), &["umap", "--latents", "runs/discs/latents.arrow", "--where", "step >= 5", "-o", "old"]);
    let words = ["umap", "--latents", text(&later), "--onto", "old/map.arrow", "-o", "shared"];
    let (said, _) = good(fixture.path(), &words);
    assert!(said.contains("placed on"), "{said}");
    let named = ["--onto-latents", "runs/discs/latents.arrow"];
    good(fixture.path(), &[&words[..], &named].concat());
    let options = &json(&fixture.path().join("shared/map.json"))["about"]["options"];
    let place = options["onto_latents"].as_str().expect("the old latents").to_owned();
    assert!(place.ends_with("runs/discs/latents.arrow") && Path::new(&place).is_relative(), "{place}");
}

/// Latents in double precision, as close together as this and as far from the origin.
fn far_latents(fixture: &Fixture, name: &str, from: f64) {
    let line = |row: u32| {
        let x = from + 1e-7 * f64::from(row * 37 % 41);
        format!("{},{},{x},{}\n", row / 20, row % 20, -x)
    };
    let lines: String = (0..40).map(line).collect();
    std::fs::write(fixture.path().join(name), format!("episode,step,latent_0,latent_1\n{lines}")).expect("CSV");
}

/// To be placed on an old map they are moved, and are the same latents all the same.
#[test]
fn latents_that_were_moved_onto_an_old_map_are_known_by_the_verbs_that_follow() {
    let fixture = Fixture::grid(2, 2, 6);
    far_latents(&fixture, "first.csv", 1000.0);
    far_latents(&fixture, "later.csv", 1_000.000_005);
    good(fixture.path(), &["umap", "first.csv", "-o", "old"]);
    let words = ["umap", "later.csv", "--onto", "old/map.arrow"];
    assert!(shared(&fixture, &words).contains("were put about the origin of the others"));
    let map = || std::fs::read(fixture.path().join("shared/map.arrow")).expect("map");
    let placed = map();
    assert!(shared(&fixture, &words).contains("still right"));
    let said = shared(&fixture, &["clusters", "later.csv"]);
    assert!(said.contains("is drawn on, which has onto another") && !said.contains("replaced"), "{said}");
    assert_eq!(map(), placed, "clusters replaced the map");
    let said = shared(&fixture, &["umap", "later.csv"]);
    assert!(said.contains("made with other options was there and was replaced"), "{said}");
}
