//! The care verbs as a process, on recordings that were simulated: what they say, what they exit with, and that `verify` passes on what they make.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use vibes_data::Recording;

use run::{fails, works};

#[test]
fn what_care_makes_is_sound() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--grid 2x2 --steps 4 --size 32 -o grid");
    works(here, "--episodes 2 --steps 5 --size 32 --seed 4 --video-set val -o plain");
    assert!(works(here, "split grid --parts 0.5,0.5").contains("grid-train: 2 episodes"));
    works(here, "filter grid --states 1 --distractors 0-1 -o corner");
    let said = works(here, "merge plain corner grid -o all");
    assert!(said.contains("6 episodes") && said.contains("2 left out that are in an earlier one too"), "{said}");
    works(here, "merge grid-val grid-train -o again");
    for made in ["grid-train", "grid-val", "corner", "again"] {
        assert!(works(here, &format!("verify {made}")).contains("0 findings"), "{made}");
    }
    let said = works(here, "verify all");
    assert!(
        said.contains("sound: 6 episodes") && said.contains("18 pictures drawn again"),
        "every part is drawn again: {said}"
    );
    let manifest = |of: &str| std::fs::read(here.join(of).join("manifest.json")).unwrap();
    assert_eq!(manifest("again"), manifest("grid"));
    works(here, "export grid --format minari -o set-v0");
    works(here, "import --format minari set-v0 -o back");
    assert_eq!(manifest("back"), manifest("grid"));
    assert!(works(here, "verify back").contains("12 pictures drawn again"));
    let said: serde_json::Value = serde_json::from_str(&works(here, "verify grid-val --json")).unwrap();
    assert_eq!((&said["foreign"], &said["episodes_asked"], &said["undrawn"]), (&0.into(), &().into(), &0.into()));
    let said: serde_json::Value = serde_json::from_str(&works(here, "verify grid --json")).unwrap();
    assert_eq!(said["episodes_asked"], 4);
    // Every part has a seed and distractors of its own.
    let said = works(here, "info all");
    let in_words = "distractors background, camera, color; easy, dynamic";
    let plain = format!("plain: 2 episodes, seed 4, {in_words}");
    for wanted in [plain.as_str(), "corner: 2 episodes, seed 0", "grid: 2 episodes, seed 0"] {
        assert!(said.contains(wanted) && !said.contains("unknown"), "{wanted} in {said}");
    }
    for line in ["extend all --episodes 20", "render all --size 8 -o drawn"] {
        fails(here, line, 1, "merged of several recordings");
    }
    // A part is not an unfinished whole.
    fails(here, "--grid 2x2 --steps 4 --size 32 -o grid-train", 1, "subset");
    fails(here, "extend grid-train --grid 3x3", 1, "a part of another");
    assert_eq!(Recording::open(&here.join("grid-train")).unwrap().episodes().len(), 2);
}

#[test]
fn wrong_care_is_refused_with_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--grid 1x2 --steps 3 --no-pixels -o grid");
    works(here, "--episodes 1 --steps 3 --no-pixels --task cartpole-swingup -o cartpole");
    fails(here, "merge grid -o out", 2, "2 values required");
    fails(here, "merge grid cartpole -o out", 2, "recordings of one spec");
    fails(here, "merge grid nowhere -o out", 1, "no recording here");
    fails(here, "split grid", 2, "1 rows of states");
    fails(here, "split cartpole --by state", 2, "1 state trajectories");
    fails(here, "split cartpole --by distractor", 2, "--by episode");
    fails(here, "split grid --parts 0.5,0.7", 2, "sum to at most 1");
    fails(here, "split grid --by distractor --parts 0.5,0.5 --names a", 2, "a different name for each part");
    fails(here, "filter grid -o out", 2, "required");
    fails(here, "filter grid --policy planner -o out", 2, "policies random");
    fails(here, "filter grid --states 4-2 -o out", 2, "as in 0-4,7");
    fails(here, "filter grid --states 0 -o cartpole", 1, "name a new folder with -o");
    fails(here, "export grid --format minari --pictures png -o out", 2, "it knows raw");
    fails(here, "export grid --format hdf5 -o out", 2, "minari, lerobot, parquet");
    fails(here, "import --format dreamer grid -o out", 1, "no .npz file");
    fails(here, "import --format minari grid -o out", 1, "metadata.json");
    assert!(!here.join("out").exists() && !here.join(".out.making").exists(), "nothing is left behind");
    // Without pictures there is nothing to see, and still something to learn from.
    for format in ["minari", "lerobot", "parquet"] {
        works(here, &format!("export grid --format {format} -o {format}"));
    }
}

#[test]
fn holes_are_recorded_again_and_files_that_are_no_episodes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let record = "--grid 2x2 --steps 4 --no-pixels -o grid";
    works(here, record);
    let file = |index: u32| here.join(format!("grid/episodes/{index:06}.arrow"));
    let whole = std::fs::read(file(2)).unwrap();
    for damaged in [None, Some(&whole[..500])] {
        std::fs::remove_file(file(2)).unwrap();
        if let Some(bytes) = damaged {
            std::fs::write(file(2), bytes).unwrap();
        }
        works(here, record);
        assert_eq!(std::fs::read(file(2)).unwrap(), whole);
    }
    // Another episode under a number of its own, and no episode at all.
    std::fs::copy(file(0), file(9)).unwrap();
    std::fs::write(file(8), "notes").unwrap();
    assert!(works(here, "info grid").contains('4'));
    let verified = run::collect(here, "verify grid");
    let said = String::from_utf8_lossy(&verified.stdout).into_owned() + &String::from_utf8_lossy(&verified.stderr);
    assert_eq!(verified.status.code(), Some(3), "{said}");
    assert!(said.contains("000009.arrow") && said.contains("000008.arrow") && said.contains("2 findings"), "{said}");
}

#[test]
fn a_recording_grows_without_losing_what_lies_beside_its_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let options = "--steps 3 --size 16 --seed 5";
    works(here, &format!("--grid 2x2 {options} -o grid"));
    std::fs::write(here.join("grid/NOTES.md"), "mine").unwrap();
    // Begun for another size and stopped.
    works(here, &format!("--grid 2x5 {options} -o .grid.extending"));
    // Behind a link it is the recording that grows, and the link stays one.
    std::os::unix::fs::symlink("grid", here.join("linked")).unwrap();
    works(here, "extend linked --grid 2x3");
    assert!(here.join("linked").is_symlink() && here.join("grid").is_dir() && !here.join("grid").is_symlink());
    assert_eq!(std::fs::read_to_string(here.join("grid/NOTES.md")).unwrap(), "mine");
    assert_eq!(Recording::open(&here.join("grid")).unwrap().episodes().len(), 6);
    assert!(!here.join(".grid.extending").exists());
    // What is drawn again of one that was not finished has no more than that.
    works(here, &format!("--episodes 2 {options} -o list"));
    let place = here.join("list/manifest.json");
    let manifest = std::fs::read_to_string(&place).unwrap().replacen("\"episodes\": 2", "\"episodes\": 3", 1);
    std::fs::write(&place, manifest).unwrap();
    works(here, "render list --size 8 -o drawn");
    assert!(works(here, "info drawn").contains("2 of 3 (if it was stopped, the same command goes on)"));
    // A part stays one when it is drawn again.
    works(here, "filter grid --states 0 -o part");
    works(here, "render part --size 8 -o small");
    fails(here, "extend small --grid 2x3", 1, "a part of another");
}

#[test]
fn actions_of_a_file_are_checked_before_anything_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let record = |steps: u32| format!("--policy actions:mine.json --no-pixels --episodes 1 --steps {steps} -o acted");
    for (text, says) in [
        ("[[0, 0], [0, null]]", "row 1 has null"),
        ("{\"rows\": 1}", "neither a list nor"),
        ("[[0, 0], [0, 5]]", "episode of 3 steps"),
        ("[[0, 0], [0], [0, 0]]", "row 1 has 1 numbers"),
    ] {
        std::fs::write(here.join("mine.json"), text).unwrap();
        fails(here, &record(3), 1, says);
        assert!(!here.join("acted").exists(), "{text}");
    }
    std::fs::write(here.join("mine.json"), "[[0, 0], [0, 5]]").unwrap();
    let output = run::collect(here, &record(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("1 number is beyond the bounds"), "{said}");
    let recording = Recording::open(&here.join("acted")).unwrap();
    // What is kept is what the actuators can do.
    assert_eq!(recording.episode(0).unwrap().action(1), [0.0, 1.0]);
    assert!(works(here, "verify acted").contains("0 findings"));
    // A trace has a row a control step, of what every actuator was given.
    works(here, "replay acted --out trace.json");
    let traced = "--policy actions:trace.json --no-pixels --episodes 1 -o traced";
    fails(here, &format!("{traced} --steps 2"), 1, "--action-repeat 1");
    fails(here, &format!("{traced} --task finger-spin --action-repeat 1 --steps 2"), 1, "a trace of reacher-easy");
    assert!(!here.join("traced").exists());
    works(here, &format!("{traced} --action-repeat 1 --steps 8"));
    assert_eq!(Recording::open(&here.join("traced")).unwrap().episode(0).unwrap().action(7), [0.0, 1.0]);
    works(here, "--task swimmer-5 --no-pixels --episodes 1 --steps 1 -o swum");
    works(here, "replay swum --out swum.json");
    let swum = "--task swimmer-5 --action-repeat 1 --policy actions:swum.json --no-pixels --episodes 1 --steps 10";
    fails(here, &format!("{swum} -o again"), 1, "--raw-torques");
    works(here, &format!("{swum} --raw-torques -o again"));
    fails(here, "preview --task foo -o sheets", 2, "reacher-easy");
    assert!(!here.join("sheets").exists());
}

/// What is made has a name of its own beside its place: nobody's folder is removed for it, whatever it is called.
#[test]
fn nothing_that_lies_beside_the_new_folder_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--episodes 3 --steps 2 --no-pixels --no-mcap -o cart.partial");
    let before = run::files(&here.join("cart.partial"));
    works(here, "filter cart.partial --episodes 0-1 -o cart");
    assert_eq!(Recording::open(&here.join("cart")).unwrap().episodes().len(), 2);
    std::fs::remove_dir_all(here.join("cart")).unwrap();
    works(here, "export cart.partial --format minari -o cart");
    assert_eq!(run::files(&here.join("cart.partial")), before);
    std::fs::rename(here.join("cart.partial"), here.join(".other.making")).unwrap();
    fails(here, "filter .other.making --episodes 0-1 -o other", 1, "the new folder would be made where this lies");
    assert_eq!(run::files(&here.join(".other.making")), before);
}

#[test]
fn a_split_makes_every_part_or_none_and_each_beside_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    works(here, "--episodes 4 --steps 2 --no-pixels --no-mcap -o q4");
    std::fs::create_dir(here.join("q4-val")).unwrap();
    std::fs::write(here.join("q4-val/notes"), "mine").unwrap();
    fails(here, "split q4 --parts 0.5,0.5", 1, "something is here already");
    assert!(!here.join("q4-train").exists());
    fails(here, "split q4 --parts 0.5,0.5 --names a,", 2, "not empty");
    std::fs::remove_dir_all(here.join("q4-val")).unwrap();
    works(&here.join("q4"), "split . --parts 0.5,0.5");
    for part in ["q4-train", "q4-val"] {
        assert_eq!(Recording::open(&here.join(part)).unwrap().episodes().len(), 2);
    }
    assert!(works(here, "verify q4").contains("0 findings"));
    assert_eq!(std::fs::read_dir(here.join("q4")).unwrap().count(), 2, "the recording holds what it held");
}
