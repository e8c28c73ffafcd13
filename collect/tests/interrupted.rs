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
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" {arguments}");
    through_a_shell(folder, &script).output().unwrap()
}

/// The program begun by a shell, which knows it as `$0`.
fn through_a_shell(folder: &Path, script: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", script, env!("CARGO_BIN_EXE_vibes-collect")]).current_dir(folder);
    shell
}

/// Sends a signal as soon as `moment` has come, and waits for the end.
fn signalled(mut command: Command, signal: &str, moment: impl Fn() -> bool) -> Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let begin = Instant::now();
    while !moment() && child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(120), "the moment never comes: {command:?}");
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status().unwrap();
    assert!(sent.success(), "it ended before the moment came: {command:?}");
    child.wait_with_output().unwrap()
}

/// `nohup` has its program ignore the hang-up, which then is no reason to stop.
#[test]
fn a_hang_up_that_is_ignored_from_the_start_does_not_stop_it() {
    let folder = tempfile::tempdir().unwrap();
    let script =
        "trap '' HUP; exec \"$0\" --episodes 60 --steps 40 --size 48 --distract camera --threads 1 --no-mcap -o hung";
    let has_begun = || count(&folder.path().join("hung/episodes")) > 0;
    let output = signalled(through_a_shell(folder.path(), script), "HUP", has_begun);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(sound_episodes(&folder.path().join("hung")), 60);
}

/// Of videos that no earlier run has made it says so, and it stops between two of their frames.
#[test]
fn it_stops_while_videos_are_made_and_says_what_it_was_doing() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let videos = cache.join("vibes/videos");
    let begun = || {
        let mut command = command(folder.path(), "--episodes 1 --steps 2 --no-mcap --video-count 60 -o made");
        command.env("XDG_CACHE_HOME", &cache);
        signalled(command, "TERM", || count(&videos) > 0)
    };
    let output = begun();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(75), "{said}");
    assert_eq!(said.matches("preparing 60 videos (once)").count(), 1, "{said}");
    assert!(said.contains("stopped while background videos were made"), "{said}");
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
    let left = files(&videos).into_keys().filter(|name| !name.ends_with(".frames")).collect::<Vec<_>>();
    assert!(left.is_empty() && count(&videos) < 60, "{left:?}");
    assert!(!folder.path().join("made").exists(), "nothing was recorded");
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
