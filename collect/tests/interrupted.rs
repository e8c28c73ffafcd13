//! What happens to a recording when it is interrupted: killed at any moment, or out of disk space.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod process;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use process::{assert_same_bytes, command, files, works};
use vibes_data::{Recording, verify_recording};

/// Kills a command with SIGKILL as soon as `moment` has come; false if it ended before.
fn killed(folder: &Path, arguments: &str, moment: impl Fn() -> bool) -> bool {
    let mut child = command(folder, arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    while !moment() {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "the moment never comes: {arguments}");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    true
}

/// Files in a folder by now, whole or not.
fn count(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, Iterator::count)
}

/// Opens whatever is there and checks all of it.
fn sound_episodes(path: &Path) -> usize {
    let recording = Recording::open(path).unwrap();
    assert_eq!(verify_recording(&recording), [], "every finished episode is whole");
    recording.episodes().len()
}

#[test]
fn killed_at_any_moment_a_recording_opens_and_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let options = "--grid 2x4 --steps 12 --size 48 --seed 3";
    works(folder, &format!("{options} -o undisturbed"));
    let mut kills = 0;
    for threads in [1, 2] {
        let (name, path) = (format!("killed-{threads}"), folder.join(format!("killed-{threads}")));
        // Two files an episode; a partial file counts as one, so these moments fall before, between and inside writes.
        for files in [0, 1, 2, 3, 6, 9, 11, 13, 15] {
            let has_come = || path.join("manifest.json").exists() && count(&path.join("episodes")) >= files;
            if killed(folder, &format!("{options} --threads {threads} -o {name}"), has_come) {
                kills += 1;
                assert!(
                    sound_episodes(&path) * 2 + 2 >= files.saturating_sub(2 * threads),
                    "finished episodes are kept"
                );
            }
        }
        works(folder, &format!("{options} -o {name}"));
        assert_same_bytes(&folder.join("undisturbed"), &path);
    }
    assert!(kills >= 8, "only {kills} kills came in time");
}

#[test]
fn a_killed_extension_leaves_the_old_recording_whole_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let options = "--steps 12 --size 48 --seed 3";
    works(folder, &format!("--grid 3x4 {options} -o fresh"));
    for larger in ["2x4", "3x4"] {
        let from = if larger == "3x4" { "2x4" } else { "2x2" };
        let (name, path) = (format!("from-{from}"), folder.join(format!("from-{from}")));
        works(folder, &format!("--grid {from} {options} -o {name}"));
        let old = Recording::open(&path).unwrap().episodes().len();
        let growing =
            if from == "2x2" { folder.join(format!(".{name}.extending/episodes")) } else { path.join("episodes") };
        let mut kills = 0;
        for files in [1, 3, 6, 11, 19, 21] {
            let has_come = || count(&growing) >= files;
            kills += usize::from(killed(folder, &format!("extend {name} --grid {larger}"), has_come));
            assert!(sound_episodes(&path) >= old, "what was there is there");
        }
        assert!(kills >= 2, "{larger}: only {kills} kills came in time");
        works(folder, &format!("extend {name} --grid {larger}"));
        works(folder, &format!("--grid {larger} {options} -o {name}"));
        assert!(!folder.join(format!(".{name}.extending")).exists(), "nothing is left beside it");
    }
    assert_same_bytes(&folder.join("fresh"), &folder.join("from-2x4"));
}

/// Runs a command that may write no file larger than `blocks` of 512 bytes; the system then refuses to write on, as it does on a full disk.
fn confined(folder: &Path, arguments: &str, blocks: u32) -> Output {
    let program = env!("CARGO_BIN_EXE_vibes-collect");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {program} {arguments}");
    Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
}

#[test]
fn without_space_it_stops_cleanly_and_keeps_what_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 4 --steps 10 --size 64 -o undisturbed");
    works(folder, "--episodes 2 --steps 10 --size 64 -o full");
    // Begun as four, of which two are there.
    works(folder, "--episodes 4 --steps 10 --size 64 -o begun");
    for file in ["000002.arrow", "000002.mcap", "000003.arrow", "000003.mcap"] {
        std::fs::remove_file(folder.join("begun/episodes").join(file)).unwrap();
    }
    let before = files(&folder.join("full"));
    // An episode's table has more than 11 pictures of 12 kB, the manifest less than 20 kB.
    for (name, arguments) in
        [("full", "extend full --episodes 4"), ("begun", "--episodes 4 --steps 10 --size 64 -o begun")]
    {
        let output = confined(folder, arguments, 100);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot write") && said.contains("2 finished episodes are kept"), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        assert_eq!(sound_episodes(&folder.join(name)), 2);
        let partial = files(&folder.join(name)).into_keys().find(|name| name.ends_with(".partial"));
        assert_eq!(partial, None, "what could not be finished takes no space");
    }
    assert_eq!(files(&folder.join("full")), before, "it asks for what it asked for before");
    works(folder, "--episodes 2 --steps 10 --size 64 -o full");
    works(folder, "extend full --episodes 4");
    works(folder, "--episodes 4 --steps 10 --size 64 -o begun");
    for name in ["full", "begun"] {
        assert_same_bytes(&folder.join("undisturbed"), &folder.join(name));
    }
}

#[test]
fn without_space_a_wider_grid_leaves_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--grid 1x2 --steps 10 --size 64 -o grid");
    let before = files(&folder.join("grid"));
    let output = confined(folder, "extend grid --grid 1x3", 100);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(files(&folder.join("grid")), before);
    works(folder, "extend grid --grid 1x3");
    works(folder, "--grid 1x3 --steps 10 --size 64 -o fresh");
    assert_same_bytes(&folder.join("grid"), &folder.join("fresh"));
}
