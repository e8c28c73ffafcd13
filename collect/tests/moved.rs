//! Recordings can be moved together with what they name: no path in a manifest is absolute, and each is found again from the recording's own folder.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::fs;
use std::path::Path;

use run::works;

/// Videos of six frames each, as pictures that differ: two to record under, and as many that are held out.
fn write_videos(folder: &Path) {
    for (video, green) in [("a", 40), ("b", 200), ("c", 90), ("d", 140)] {
        fs::create_dir_all(folder.join(video)).unwrap();
        for frame in 0..6_u8 {
            let picture = image::RgbImage::from_pixel(32, 32, image::Rgb([frame * 40, green, 90]));
            picture.save(folder.join(video).join(format!("{frame}.png"))).unwrap();
        }
    }
}

/// Every manifest below a folder, none of which names a path that would be another on another machine.
fn no_path_is_absolute(folder: &Path, home: &Path) {
    let mut manifests = 0;
    for (name, bytes) in run::files(folder) {
        if name.ends_with("manifest.json") || name.ends_with("metadata.json") || name.ends_with("recording.json") {
            let text = String::from_utf8(bytes).unwrap();
            assert!(!text.contains(home.to_str().unwrap()), "{name}: {text}");
            manifests += 1;
        }
    }
    assert!(manifests > 0);
}

#[test]
fn a_recording_moves_with_its_videos_and_its_actions() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().canonicalize().unwrap();
    let here = home.join("here");
    write_videos(&here.join("sets/films"));
    fs::write(here.join("actions.json"), "[[0.5, -0.5], [0.1, 0.2], [0.0, 0.0]]").unwrap();
    let videos = here.join("sets/films");
    let common = format!("--videos {} --video-count 2 --steps 3 --size 24 --no-mcap -q", videos.display());
    let actions = here.join("actions.json");
    works(&here, &format!("--policy actions:{} --episodes 2 {common} -o recordings/r", actions.display()));
    works(&here, &format!("--policy random --episodes 2 --seed 3 {common} -o plain"));
    // Taken to other depths, and put together.
    works(&here, "filter recordings/r --max-return 1000 -o deep/er/part");
    works(&here, "merge recordings/r plain -o merged");
    works(&here, "filter merged --episodes 1-2 -o deep/er/less");
    works(&here, "export recordings/r --format minari -o sets/deep/r-v0");
    works(&here, "import sets/deep/r-v0 --format minari -o back");
    works(&here, "export plain --format parquet -o tables");
    no_path_is_absolute(&here, &home);

    let there = home.join("far/away");
    fs::create_dir_all(home.join("far")).unwrap();
    fs::rename(&here, &there).unwrap();
    for recording in ["recordings/r", "plain", "deep/er/part", "merged", "deep/er/less", "back"] {
        let said = works(&home, &format!("verify far/away/{recording}"));
        assert!(said.contains("0 findings") && !said.contains("recorded elsewhere"), "{recording}: {said}");
    }
    works(&home, "extend far/away/recordings/r --episodes 3");
    works(&home, "render far/away/recordings/r --size 16 -o elsewhere");
    assert!(works(&home, "verify elsewhere").contains("0 findings"));
    no_path_is_absolute(&there, &home);
    no_path_is_absolute(&home.join("elsewhere"), &home);
}

/// A part that went to another machine, where its videos are not, is checked as far as it can be there, and is still a part when it comes back.
#[test]
fn parts_of_two_machines_come_together() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().canonicalize().unwrap();
    let here = home.join("here");
    write_videos(&here.join("films"));
    works(&here, "--grid 2x2 --videos films --video-count 2 --steps 3 --size 24 --no-mcap -q -o vg");
    works(&here, "split vg --parts 0.5,0.5");
    fs::create_dir_all(home.join("other/machine")).unwrap();
    fs::rename(here.join("vg-val"), home.join("other/machine/vg-val")).unwrap();

    let said = works(&home, "verify other/machine/vg-val");
    assert!(said.starts_with("sound: 2 episodes, 0 findings; 2 simulated again"), "{said}");
    assert!(said.contains("pictures of 2 episodes not drawn again") && said.contains("films"), "{said}");
    let said: serde_json::Value = serde_json::from_str(&works(&home, "verify other/machine/vg-val --json")).unwrap();
    assert_eq!((&said["undrawn"], &said["pictures"]), (&2.into(), &0.into()), "{said}");
    assert_eq!(said["absent_videos"].as_array().unwrap().len(), 1, "{said}");

    let said = works(&here, "merge vg-train ../other/machine/vg-val -o again");
    assert!(said.contains("4 episodes, parts of one recording"), "{said}");
    let manifest = |name: &str| fs::read_to_string(here.join(name).join("manifest.json")).unwrap();
    assert_eq!(manifest("again"), manifest("vg"));
    let said = works(&here, "verify again");
    assert!(said.contains("0 findings") && said.contains("12 pictures drawn again"), "{said}");
    // In the other order the videos are still those that are there.
    works(&here, "merge ../other/machine/vg-val vg-train -o swapped");
    assert_eq!(manifest("swapped"), manifest("vg"));
}

/// Films and actions of the same names in two folders that are both there need not be the same.
#[test]
fn parts_that_name_other_films_or_actions_are_no_parts_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().canonicalize().unwrap();
    for (films, grid) in [("fa", "ga"), ("fb", "gb")] {
        write_videos(&home.join(films));
        works(
            &home,
            &format!("--grid 2x2 --videos {films} --video-count 2 --steps 3 --size 24 --no-mcap -q -o {grid}"),
        );
        works(&home, &format!("split {grid} --parts 0.5,0.5"));
    }
    let said = works(&home, "merge ga-train gb-val -o mixed");
    assert!(!said.contains("parts of one recording"), "{said}");
    assert!(works(&home, "verify mixed").contains("0 findings"));
    for (name, action) in [("A", 0.5), ("B", -0.5)] {
        fs::create_dir_all(home.join(name)).unwrap();
        fs::write(home.join(name).join("acts.json"), format!("[[{action}],[{action}],[{action}]]")).unwrap();
        let acts = format!("--policy actions:{name}/acts.json --task cartpole-swingup --episodes 4 --steps 3");
        works(&home, &format!("{acts} --no-pixels --no-mcap -q -o r{name}"));
        let kept = if name == "A" { "0-1" } else { "2-3" };
        works(&home, &format!("filter r{name} --episodes {kept} -o part{name}"));
    }
    let said = works(&home, "merge partA partB -o both");
    assert!(!said.contains("parts of one recording"), "{said}");
}
