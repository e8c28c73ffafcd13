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
    works(here, "merge plain corner grid -o all");
    works(here, "merge grid-val grid-train -o again");
    for made in ["grid-train", "grid-val", "corner", "again"] {
        assert!(works(here, &format!("verify {made}")).contains("0 findings"), "{made}");
    }
    let said = works(here, "verify all");
    assert!(
        said.contains("sound: 8 episodes") && said.contains("24 pictures drawn again"),
        "every part is drawn again: {said}"
    );
    let manifest = |of: &str| std::fs::read(here.join(of).join("manifest.json")).unwrap();
    assert_eq!(manifest("again"), manifest("grid"));
    works(here, "export grid --format minari -o set-v0");
    works(here, "import --format minari set-v0 -o back");
    assert_eq!(manifest("back"), manifest("grid"));
    assert!(works(here, "verify back").contains("12 pictures drawn again"));
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
    fails(here, "split cartpole --by state", 2, "--by episode");
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
    assert!(!here.join("out").exists() && !here.join("out.partial").exists(), "nothing is left behind");
    // Without pictures there is nothing to see, and still something to learn from.
    for format in ["minari", "lerobot", "parquet"] {
        works(here, &format!("export grid --format {format} -o {format}"));
    }
}
