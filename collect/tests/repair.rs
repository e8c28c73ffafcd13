//! Recordings that are damaged, lack something, or lie beside something of another, as processes: what is said of them, what is refused, and what the same command mends.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::path::Path;

use vibes_data::Recording;

use run::{assert_same_bytes, collect, fails, works};

/// Turns a bit in the middle of a file.
fn damage(file: &Path) {
    let mut bytes = std::fs::read(file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(file, bytes).unwrap();
}

/// What `verify` says of a recording in which something is wrong.
fn verified(folder: &Path, name: &str) -> String {
    let output = collect(folder, &format!("verify {name} --no-simulation"));
    assert_eq!(output.status.code(), Some(3), "{name}");
    String::from_utf8(output.stdout).unwrap()
}

/// Videos of one frame each, every one of its own grey.
fn write_videos(folder: &Path, names: &[&str]) {
    for (place, name) in names.iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        let picture = image::RgbImage::from_pixel(16, 16, image::Rgb([40 * place as u8; 3]));
        picture.save(folder.join(name).join("0.png")).unwrap();
    }
}

#[test]
fn a_damaged_episode_is_not_drawn_anew_and_its_command_mends_it() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let record = "--episodes 2 --steps 3 --size 16 --no-mcap";
    works(here, &format!("{record} -o r"));
    works(here, &format!("{record} -o whole"));
    damage(&here.join("r/episodes/000001.arrow"));
    for line in ["render r --size 20 -o larger", "render r --seed 4 -o other", "export r --format parquet -o tables"] {
        fails(here, line, 1, "its checksum differs from the manifest's; to mend it, remove the file and repeat");
    }
    let said = verified(here, "r");
    assert!(said.contains("000001.arrow") && said.contains("remove these files and repeat the recording's"), "{said}");
    std::fs::remove_file(here.join("r/episodes/000001.arrow")).unwrap();
    let said = works(here, "info r");
    assert!(said.contains("files        1 of 2 has no whole file; verify says which"), "{said}");
    works(here, &format!("{record} -o r"));
    assert_same_bytes(&here.join("r"), &here.join("whole"));
    assert!(!works(here, "info r").contains("whole file"));
    let sound: serde_json::Value = serde_json::from_str(&works(here, "verify r --json")).unwrap();
    assert!(sound["mend"].is_null(), "{sound}");
}

/// Under its number an episode of another seed would pass for one of the recording, and so would one beyond the last.
#[test]
fn episodes_that_were_not_asked_for_are_no_part_of_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let record = |seed: u32, count: u32, name: &str| {
        format!("--episodes {count} --seed {seed} --steps 3 --no-pixels --no-mcap -o {name}")
    };
    works(here, &record(1, 2, "r"));
    works(here, &record(2, 4, "other"));
    let file = |name: &str, index: u32| here.join(name).join(format!("episodes/{index:06}.arrow"));
    std::fs::copy(file("other", 3), file("r", 3)).unwrap();
    let said = verified(here, "r");
    assert!(said.contains("000003.arrow: episode 3 is beyond the 2 that were asked for"), "{said}");
    assert!(works(here, "info r").contains("1 of 3 episodes are not what its options ask for"));
    std::fs::remove_file(file("r", 3)).unwrap();
    // The manifest of what was killed at its beginning lists nothing.
    let place = here.join("r/manifest.json");
    let text = std::fs::read_to_string(&place).unwrap();
    let mut manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    manifest["episodes"] = serde_json::json!([]);
    std::fs::write(&place, manifest.to_string()).unwrap();
    std::fs::copy(file("other", 1), file("r", 1)).unwrap();
    let said = verified(here, "r");
    assert!(said.contains("000001.arrow: episode 1 is not the one that its options make"), "{said}");
    fails(here, &record(1, 2, "r"), 1, "remove episodes/000001.arrow");
    std::fs::remove_file(file("r", 1)).unwrap();
    works(here, &record(1, 2, "r"));
    assert!(works(here, "verify r").starts_with("sound: 2 episodes, 0 findings"));
    std::fs::remove_file(place).unwrap();
    fails(here, &record(2, 2, "r"), 1, "episodes of another recording lie here");
}

#[test]
fn logs_are_written_when_they_are_asked_for_and_counted_where_some_lack_them() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let record = "--episodes 3 --steps 3 --size 16";
    works(here, &format!("{record} -o at-once"));
    works(here, &format!("{record} --no-mcap -o later"));
    assert!(works(here, "info later").contains("logs         none"));
    works(here, &format!("{record} -o later"));
    assert_same_bytes(&here.join("later"), &here.join("at-once"));
    assert!(works(here, "info later").contains("logs         of every episode"));
    std::fs::remove_file(here.join("later/episodes/000002.arrow")).unwrap();
    let said = works(here, &format!("{record} --no-mcap -o later"));
    assert!(said.contains("1 of 3 episodes have no log"), "{said}");
    assert!(!here.join("later/episodes/000002.mcap").exists(), "a log of rows that are gone");
    assert!(works(here, "info later").contains("logs         of 2 of 3 episodes"));
    works(here, "verify later");
    std::fs::copy(here.join("later/episodes/000000.mcap"), here.join("later/episodes/000008.mcap")).unwrap();
    assert!(verified(here, "later").contains("000008.mcap: not in the manifest: the log of an episode"));
}

/// What a shell stands in must not be taken away under it.
#[test]
fn a_recording_is_widened_from_outside() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--grid 1x1 --steps 2 --no-pixels --no-mcap -o grid");
    fails(&here.join("grid"), "extend . --grid 1x2", 1, "run it from outside");
    fails(&here.join("grid/episodes"), "extend .. --grid 1x2", 1, "run it from outside");
    assert_eq!(Recording::open(&here.join("grid")).unwrap().episodes().len(), 1);
    assert_eq!(std::fs::read_dir(here).unwrap().count(), 1, "nothing was begun");
    // New rows are added where it lies.
    works(&here.join("grid"), "extend . --grid 2x1");
    works(here, "extend grid/manifest.json --grid 2x2");
    works(here, "--grid 2x2 --steps 2 --no-pixels --no-mcap -o fresh");
    assert_same_bytes(&here.join("grid"), &here.join("fresh"));
}

/// The videos of a recording are those that it names, and one that is new in their folder is no reason to refuse it.
#[test]
fn a_film_more_leaves_recordings_what_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_videos(&here.join("films"), &["b", "c", "d", "e"]);
    let common = "--steps 2 --size 16 --no-mcap --videos films --video-count 2";
    for (name, size) in [("grid", "--grid 1x1"), ("list", "--episodes 1"), ("grid-then", "--grid 2x2")] {
        works(here, &format!("{size} {common} -o {name}"));
    }
    works(here, &format!("--episodes 2 {common} -o list-then"));
    let more = "--episodes 1 --steps 2 --size 16 --no-mcap --videos films";
    fails(here, &format!("{more} -o many"), 1, "2 train videos (the first half of the folder); 4 are needed");
    fails(here, &format!("{more} -o many"), 1, "--video-count 2 takes those that are there");
    write_videos(&here.join("films"), &["a", "b"]);
    fails(here, &format!("--episodes 1 {common} -o list"), 1, "its videos were b, c; this folder now gives a, b;");
    std::fs::remove_dir_all(here.join("films/a")).unwrap();
    write_videos(&here.join("films"), &["b", "c", "d", "e"]);
    std::fs::rename(here.join("films"), here.join("kept")).unwrap();
    fails(here, "extend list --episodes 2", 1, "its background videos are no longer in films; put those back");
    fails(here, "render list --size 20 -o again", 1, "draw it with other videos (--videos, --distract)");
    std::fs::rename(here.join("kept"), here.join("films")).unwrap();
    // Now another one comes first.
    std::fs::create_dir(here.join("films/a")).unwrap();
    std::fs::copy(here.join("films/e/0.png"), here.join("films/a/0.png")).unwrap();
    works(here, "extend list --episodes 2");
    works(here, "extend grid --grid 2x2");
    for name in ["grid", "list"] {
        assert_same_bytes(&here.join(name), &here.join(format!("{name}-then")));
    }
}

#[test]
fn info_says_in_words_what_a_part_is_of() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--grid 2x3 --steps 2 --size 16 --no-mcap --difficulty hard --static --video-count 2 -o grid");
    works(here, "filter grid --states 1 --distractors 0,2 -o part");
    let said = works(here, "info part/manifest.json");
    for line in [
        "part of      a recording of 6 episodes; filter: distractors 0,2, states 1\n",
        "cells        2 of 6\n",
        "pixels       16 x 16 RGB, fast look\n",
        "distractors  background, camera, color; hard, static\n",
        "videos       train: ",
    ] {
        assert!(said.contains(line), "{line} in {said}");
    }
    let whole = works(here, "info grid");
    assert!(!whole.contains("part of") && !whole.contains("cells"), "{whole}");
}

/// Rows of a longer episode that stay behind would be taken for the shorter one's.
#[test]
fn frames_of_another_episode_are_not_mixed_in() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (name, steps) in [("long", 5), ("short", 2)] {
        works(here, &format!("--episodes 1 --steps {steps} --no-pixels --no-mcap -o {name}"));
    }
    works(here, "replay long/manifest.json --frames rows --size 16 --quiet");
    works(here, "replay long --frames rows --size 16 --quiet");
    fails(here, "replay short --frames rows --size 16", 1, "of another episode lies here, and this one has 3 rows");
    assert_eq!(std::fs::read_dir(here.join("rows")).unwrap().count(), 6);
}

#[test]
fn a_merged_recording_of_views_is_split_by_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--episodes 4 --steps 3 --size 16 --no-mcap -o one");
    works(here, "render one --seed 5 --no-mcap -o view");
    works(here, "merge one view -o both");
    let returns = |name: &str| {
        let said = works(here, &format!("info {name}"));
        said.lines().find(|line| line.starts_with("returns")).unwrap().to_owned()
    };
    assert_eq!(returns("both"), returns("one"), "each trajectory once");
    works(here, "split both --parts 0.5,0.5");
    let numbers = |name: &str| -> Vec<u32> {
        Recording::open(&here.join(name)).unwrap().episodes().iter().map(|entry| entry.index % 4).collect()
    };
    let (train, val) = (numbers("both-train"), numbers("both-val"));
    assert!(train.len() == 4 && val.iter().all(|trajectory| !train.contains(trajectory)), "{train:?} {val:?}");
    let said = works(here, "split both --by episode --parts 0.375,0.625 -o mixed");
    assert!(said.contains("state trajectories are in more than one part; --by state"), "{said}");
}
