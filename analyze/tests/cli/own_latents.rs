//! Latents of a user's own, of whose rows the recording that is named knows more than their table.

use vibes_data::Latents;

use super::fixture::Fixture;
use super::{bad, good, json, text};

/// A grid of three states and three distractors, and its latents.
fn made() -> (Fixture, Latents) {
    let fixture = Fixture::grid(3, 3, 10);
    let latents = Latents::read(&fixture.latents()).expect("latents");
    (fixture, latents)
}

/// Keys and latents alone.
fn csv(l: &Latents) -> String {
    let names: String = (0..l.dims).map(|dim| format!(",latent_{dim}")).collect();
    let row = |row: usize| {
        let values: String = l.row(row).iter().map(|value| format!(",{value}")).collect();
        format!("{},{}{values}\n", l.episode[row], l.step[row])
    };
    format!("episode,step{names}\n{}", (0..l.len()).map(row).collect::<String>())
}

/// Latents alone, as `np.save` writes them.
fn npy(l: &Latents) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}\n", l.len(), l.dims);
    let length = (header.len() as u16).to_le_bytes();
    let values: Vec<u8> = l.latent.iter().flat_map(|value| value.to_le_bytes()).collect();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), &values].concat()
}

#[test]
fn cells_come_from_the_recording_that_is_named() {
    let (fixture, latents) = made();
    let folder = fixture.path();
    std::fs::write(folder.join("own.csv"), csv(&latents)).expect("CSV");
    let named = ["own.csv", "--recording", "recordings/discs"];
    good(folder, &["invariance", "-o", "usual"]);
    good(folder, &[&["invariance", "-o", "own"][..], &named].concat());
    let share = |of: &str| {
        let document = json(&folder.join(of).join("invariance.json"));
        document["numbers"]["state_share"]["estimate"].as_f64().expect("a share")
    };
    assert!((share("own") - share("usual")).abs() < 1e-9, "{} and {}", share("own"), share("usual"));
    let (line, _) = good(folder, &[&["grid", "-o", "own"][..], &named].concat());
    assert!(line.contains("3 of 3 state x 3 of 3 distractor"), "{line}");
    let some = ["nn", "-k", "2", "--queries", "2", "--where", "distractor < 2", "-o", "two"];
    let (_, said) = good(folder, &[&some[..], &named].concat());
    assert!(said.contains("66 of 99 rows are looked at"), "{said}");
    let other = Fixture::grid(2, 2, 3);
    let other = other.path().join("recordings/discs");
    let error = bad(folder, &["invariance", "own.csv", "--recording", text(&other)], 1);
    assert!(error.contains("not encoded from this recording"), "{error}");
}

#[test]
fn a_plain_array_has_the_keys_of_the_recording_that_is_named() {
    let (fixture, latents) = made();
    let folder = fixture.path();
    std::fs::write(folder.join("own.npy"), npy(&latents)).expect("array");
    let error = bad(folder, &["invariance", "own.npy"], 1);
    let said = "a plain array has no keys: 99 rows; name the recording whose rows they are, in order, with --recording";
    assert!(error.contains(said), "{error}");
    let other = Fixture::grid(2, 2, 3);
    let other = other.path().join("recordings/discs");
    let error = bad(folder, &["invariance", "own.npy", "--recording", text(&other)], 1);
    assert!(error.contains("99 rows, and ") && error.contains(" has 16; name the recording"), "{error}");
    let report = ["report", "own.npy", "--recording", "recordings/discs", "--points", "20", "-o", "page"];
    let (_, said) = good(folder, &report);
    assert!(said.contains("its 99 rows are taken for those of discs in order, 9 episodes"), "{said}");
    let page = std::fs::read_to_string(folder.join("page/report.html")).expect("page");
    assert!(page.contains("Same state found under another distractor"), "the grid is known");
}

#[test]
fn a_map_of_a_plain_array_takes_new_latents_if_it_is_of_all_rows() {
    let (fixture, latents) = made();
    let folder = fixture.path();
    std::fs::write(folder.join("own.npy"), npy(&latents)).expect("array");
    let own = ["umap", "own.npy", "--recording", "recordings/discs"];
    good(folder, &[&own[..], &["-o", "whole"]].concat());
    let (line, _) = good(folder, &[&own[..], &["--onto", "whole/map.arrow", "-o", "placed"]].concat());
    assert!(line.contains("placed on whole/map.arrow"), "{line}");
    // Without keys nobody knows which rows a map of some is of.
    good(folder, &[&own[..], &["--where", "step < 5", "-o", "part"]].concat());
    let error = bad(folder, &[&own[..], &["--onto", "part/map.arrow", "-o", "placed"]].concat(), 1);
    assert!(error.contains("99 rows, and the map is of 45") && error.contains("make the map of all rows"), "{error}");
    // Other rows under the same keys are other latents.
    let moved = Latents { latent: latents.latent.iter().map(|value| value + 1.0).collect(), ..latents };
    std::fs::write(folder.join("own.npy"), npy(&moved)).expect("array");
    let error = bad(folder, &[&own[..], &["--onto", "whole/map.arrow", "-o", "placed"]].concat(), 2);
    assert!(error.contains("the map is of other latents"), "{error}");
}
