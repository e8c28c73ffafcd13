//! What goes wrong around an online run, as processes: each time a clear error and the documented exit code, everything kept, and the same command goes on afterwards to the
//! bytes of a run that nothing happened to.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use process::{assert_same, program, signal, text};
use vibes_data::{Recording, RunFolder, verify_recording};

/// Episodes of 40 agent steps from vectors, three of them random; a checkpoint every 40 updates.
const VECTORS: &str = "online --task known-slide --no-pixels --distract none --preset tiny --steps 40 --rows-per-step 16 --prefill 3 --first-updates 20 \
                       --checkpoint-every 40 --evaluate-every 0 --final-episodes 2";
/// The same in pictures, without a world model.
const PICTURES: &str = "online --task known-slide --distract none --size 24 --agent sac --system sac-drq --transitions 4 --steps 12 --prefill 3 --save-every 2 \
                        --evaluate-every 0 --final-episodes 2";

fn command(line: &str, control_steps: u32, folder: &Path) -> Command {
    let mut command = program();
    command.args(line.split_whitespace()).args(["--control-steps", &control_steps.to_string(), "-o"]).arg(folder);
    command
}

fn succeeds(mut command: Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    output
}

/// The command fails with a message that holds these words.
fn fails(mut command: Command, code: i32, words: &[&str]) {
    let output = command.output().unwrap();
    let said = text(&output);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}

/// What was lived through is whole.
fn assert_sound(run: &Path, episodes: usize) {
    let replay = Recording::open(&run.join("replay")).unwrap();
    assert!(replay.episodes().len() >= episodes, "{} episodes", replay.episodes().len());
    assert!(verify_recording(&replay).is_empty());
}

#[test]
fn a_disk_that_takes_no_more_loses_nothing_that_was_written() {
    for (line, kilobytes) in [(VECTORS, 24), (PICTURES, 96)] {
        let folder = tempfile::tempdir().unwrap();
        let [undisturbed, full] = ["undisturbed", "full"].map(|name| folder.path().join(name));
        succeeds(command(line, 400, &undisturbed));
        // A limit on the size of a file, which the weights of a checkpoint pass and an episode does not; the signal that comes with it is ignored, so that writing fails.
        let limited = command(line, 400, &full);
        let mut shell = Command::new("bash");
        shell.args(["-c", &format!("trap '' XFSZ; ulimit -f {kilobytes}; exec \"$@\""), "bash"]);
        shell.arg(limited.get_program()).args(limited.get_args()).stdin(Stdio::null());
        fails(shell, 1, &["too large", "checkpoint"]);
        assert_eq!(RunFolder::at(&full).checkpoints(), [0_u64; 0], "no half checkpoint counts");
        assert!(full.join("replay/episodes/000002.arrow").is_file(), "the random episodes are kept");
        succeeds(command(line, 400, &full));
        assert_sound(&full, 5);
        assert_same(&undisturbed, &full, "after a full disk");
    }
}

#[test]
fn a_number_that_is_none_ends_the_run_and_keeps_what_was_lived_through() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let line = format!("{VECTORS} --lr 1e18 --lr-warmup 0");
    for _ in 0..2 {
        // The same command meets the same number again, and nothing else is wrong by then.
        fails(command(&line, 800, &run), 1, &["diverged", "lower step sizes (--lr, --actor-lr"]);
        assert!(run.join("replay/episodes/000002.arrow").is_file());
        let last = RunFolder::at(&run).newest_checkpoint().map(|at| at.join("model.safetensors"));
        let finite = |path: std::path::PathBuf| {
            let model = vibes_model::Model::load(&path, &vibes_model::cpu()).unwrap();
            model.first_not_finite().is_none()
        };
        assert!(last.is_err() || last.is_ok_and(finite), "no checkpoint holds what is no number");
    }
}

#[test]
fn a_thread_that_cannot_draw_any_more_is_an_error_and_the_run_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let [undisturbed, blind] = ["undisturbed", "blind"].map(|name| folder.path().join(name));
    for run in [&undisturbed, &blind] {
        succeeds(command(PICTURES, 120, run));
    }
    // No library that draws is found any more.
    let mut broken = command(PICTURES, 240, &blind);
    broken.env("__EGL_VENDOR_LIBRARY_FILENAMES", "/nothing-here.json");
    fails(broken, 1, &["cannot draw"]);
    for run in [&undisturbed, &blind] {
        succeeds(command(PICTURES, 240, run));
    }
    assert_sound(&blind, 10);
    assert_same(&undisturbed, &blind, "after a thread that could not draw");
}

/// Puts a number that is none in the place of one of an episode's: what damage leaves, or a program that does not check.
fn poison(file: &Path, numbers: &[f32], place: usize) {
    let mut bytes = std::fs::read(file).unwrap();
    let column: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let at = bytes.windows(column.len()).position(|found| found == column).unwrap();
    bytes[at + 4 * place..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn a_recording_with_numbers_that_are_none_is_refused_by_name_before_anything_is_learned_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let [run, offline, other, online] = ["run", "offline", "other", "online"].map(|name| folder.path().join(name));
    let recording = run.join("replay");
    succeeds(command(VECTORS, 400, &run));
    let learn = |output: &Path| {
        let mut command = program();
        command.arg("offline").arg(&recording).args(["--preset", "tiny", "--updates", "2", "-o"]).arg(output);
        command
    };
    succeeds(learn(&offline));
    let go_on = || {
        let mut command = program();
        command.arg("online").arg(&offline).args(["--no-pixels", "--distract", "none", "-o"]).arg(&online);
        command
    };
    let file = recording.join("episodes/000001.arrow");
    let whole = std::fs::read(&file).unwrap();
    let episode = Recording::open(&recording).unwrap().episode(1).unwrap().to_episode();
    let width = episode.observations.len() / episode.rows();
    let columns = [("reward", &episode.rewards, 1), ("observation", &episode.observations, width)];
    for (column, numbers, width) in columns {
        poison(&file, numbers, 7 * width);
        let said = format!("the {column} of step 7 is NaN");
        for command in [learn(&other), go_on(), command(VECTORS, 800, &run)] {
            fails(command, 1, &[&said, "000001.arrow"]);
        }
        std::fs::write(&file, &whole).unwrap();
    }
    succeeds(command(VECTORS, 480, &run));
}

fn wait_until(process: &mut std::process::Child, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() && process.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(300), "nothing happened");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_folder_of_videos_that_is_gone_is_an_error_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let lines = [VECTORS.replace("--no-pixels --distract none", "--size 24"), PICTURES.replace("--distract none", "")];
    for (number, line) in lines.iter().enumerate() {
        let run = folder.path().join(format!("run-{number}"));
        let videos = folder.path().join("videos");
        fails(command(&format!("{line} --videos {}", videos.display()), 240, &run), 1, &["videos"]);
        assert!(!run.join("replay/episodes/000000.arrow").exists(), "nothing was lived through");
    }
}

#[test]
fn a_second_process_is_refused_with_the_owners_name_and_the_first_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let long = || command(VECTORS, 1_000_000, &run);
    let mut first = long().stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    wait_until(&mut first, || run.join("replay/episodes").exists());
    let owner = format!("process {}", first.id());
    fails(long(), 75, &[&owner]);
    signal(&first, "TERM");
    assert_eq!(first.wait().unwrap().code(), Some(75), "saved, to be started again");
    succeeds(command(VECTORS, 240, &run));
    assert_sound(&run, 3);
}

/// Of videos that no earlier run has made it says so, and it stops between two of their frames.
#[test]
fn it_stops_while_videos_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, run) = (folder.path().join("cache"), folder.path().join("run"));
    let line = "online --task cartpole-swingup --preset tiny --size 24 --video-count 60";
    let mut command = command(line, 20_000, &run);
    command.env("XDG_CACHE_HOME", &cache).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    let videos = cache.join("vibes/videos");
    let begun = Instant::now();
    while std::fs::read_dir(&videos).map_or(0, Iterator::count) == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no video was begun");
        std::thread::sleep(Duration::from_millis(5));
    }
    let signalled = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let said = text(&output);
    assert!(signalled.success() && output.status.code() == Some(75), "{said}");
    assert_eq!(said.matches("preparing 60 videos of the set train (once)").count(), 1, "{said}");
    assert!(said.contains("stopped while background videos were made"), "{said}");
}
