//! `vibes-collect` as a process: what it records, how it goes on, what it says and exits with when something is wrong.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::path::Path;
use std::process::Command;

use vibes_data::{EpisodeView, Recording};

use run::{collect, command, fails, works};

/// Videos of one frame each, every one of its own grey.
fn write_videos(folder: &Path, names: &[&str]) {
    for (place, name) in names.iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        let picture = image::RgbImage::from_pixel(16, 16, image::Rgb([40 * place as u8; 3]));
        picture.save(folder.join(name).join("0.png")).unwrap();
    }
}

/// The names of a recording's videos.
fn videos_of(recording: &Recording) -> Vec<&str> {
    recording.manifest().videos.iter().map(|video| video.name.as_str()).collect()
}

#[test]
fn a_grid_simulates_each_state_once_and_draws_it_under_every_distractor() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--grid 2x3 --steps 6 --seed 5");
    let recording = Recording::open(&folder.path().join("recordings/reacher-easy-2x3")).unwrap();
    let view = |state: u32, distractor: u32| -> EpisodeView { recording.episode(state * 3 + distractor).unwrap() };
    for state in 0..2 {
        for row in 0..7 {
            for distractor in 1..3 {
                assert_eq!(view(state, 0).qpos(row), view(state, distractor).qpos(row), "the same state along a row");
                assert_ne!(view(state, 0).pixels(row), view(state, distractor).pixels(row), "another picture");
            }
        }
    }
    for distractor in 0..3 {
        for row in 0..7 {
            let (one, other) = (view(0, distractor), view(1, distractor));
            assert_eq!((one.camera(row), one.background(row)), (other.camera(row), other.background(row)));
            assert_eq!(one.colors(row), other.colors(row), "the same distractor down a column");
        }
    }
    assert_ne!(view(0, 0).qpos(0), view(1, 0).qpos(0), "states start differently");
    assert_ne!(view(0, 0).camera(0), view(0, 1).camera(0), "distractors start differently");
}

#[test]
fn a_recording_goes_on_with_the_same_command_and_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--episodes 4 --steps 4 -o whole");
    works(folder.path(), "--episodes 4 --steps 4 -o parts --threads 1");
    let parts = folder.path().join("parts");
    std::fs::remove_file(parts.join("episodes/000002.arrow")).unwrap();
    let manifest = std::fs::read_to_string(parts.join("manifest.json")).unwrap();
    let mut manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    manifest["episodes"] = serde_json::json!([]);
    std::fs::write(parts.join("manifest.json"), manifest.to_string()).unwrap();
    works(folder.path(), "--episodes 4 --steps 4 -o parts");
    for index in 0..4 {
        let file = |of: &str| std::fs::read(folder.path().join(of).join(format!("episodes/{index:06}.arrow"))).unwrap();
        assert_eq!(file("whole"), file("parts"), "episode {index}");
    }
    let manifest = |of: &str| std::fs::read(folder.path().join(of).join("manifest.json")).unwrap();
    assert_eq!(manifest("whole"), manifest("parts"));
    fails(folder.path(), "--episodes 4 --steps 5 -o whole", 1, "options.steps is 4, asked for was 5");
}

/// A run in a mix acts in its own world too, and two of different worlds need a word.
#[test]
fn a_run_in_a_mix_acts_in_the_world_that_it_was_trained_in() {
    let folder = tempfile::tempdir().unwrap();
    let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/../checkpoints/swimmer-100-online");
    std::os::unix::fs::symlink(kept, folder.path().join("kept")).unwrap();
    works(folder.path(), "--mix kept:0.5,random:0.5 --episodes 2 --steps 2 --no-pixels --no-mcap -o mixed");
    let recording = Recording::open(&folder.path().join("mixed")).unwrap();
    let (spec, options) = (&recording.manifest().spec, &recording.manifest().options);
    assert_eq!((spec.task.as_str(), spec.action_repeat, &options["protocol"]), ("swimmer-100", 50, &().into()));
    let axes = &options["distractors"]["axes"];
    assert!(axes.as_object().unwrap().values().all(|is_there| is_there == false), "{axes}");
    let other = folder.path().join("other");
    std::fs::create_dir_all(&other).unwrap();
    std::fs::write(other.join("online.json"), r#"{"world": {"action_repeat": 10}}"#).unwrap();
    let two = "--mix kept:0.5,other:0.5 --episodes 2 --steps 2 --no-pixels --no-mcap -o two";
    fails(folder.path(), two, 1, "for 10 and 50 control steps");
}

/// Neither command knows the other's number, and what is held out of one must not be trained under by the other.
#[test]
fn a_folder_of_films_holds_out_the_same_half_whatever_two_commands_ask_for() {
    let folder = tempfile::tempdir().unwrap();
    let films = ["f1", "f2", "f3", "f4", "f5", "f6"];
    write_videos(&folder.path().join("films"), &films);
    let record = |arguments: &str, name: &str| {
        let common = "--videos films --episodes 1 --steps 2 --size 16 --no-mcap";
        works(folder.path(), &format!("{common} {arguments} -o {name}"));
        Recording::open(&folder.path().join(name)).unwrap()
    };
    assert_eq!(videos_of(&record("--video-count 3", "train")), films[..3]);
    assert_eq!(videos_of(&record("--video-set val --video-count 2", "val")), films[3..5]);
    assert_eq!(videos_of(&record("--difficulty hard", "all")), films[..3]);
    assert_eq!(videos_of(&record("--difficulty hard --video-set val", "all-val")), films[3..]);
    let more = "--videos films --episodes 1 --steps 2 --size 16 --video-count 4 -o more";
    fails(folder.path(), more, 1, "3 train videos (the first half of the folder); 4 are needed");
    let more = format!("{more} --video-set val");
    fails(folder.path(), &more, 1, "3 val videos (the second half of the folder); 4 are needed");
    // The videos of a recording are those that it names, though the folder has come to be divided otherwise.
    write_videos(&folder.path().join("films"), &["f01", "f02", "f03", "f04"]);
    for name in ["train", "val", "all", "all-val"] {
        assert!(works(folder.path(), &format!("verify {name}")).starts_with("sound: 1 episodes, 0 findings"), "{name}");
        works(folder.path(), &format!("render {name} --size 20 -o {name}-20"));
    }
}

/// A folder of DAVIS with one of its two sets serves whoever asks for that one.
#[test]
fn a_set_of_davis_alone_is_enough_to_record_under_it() {
    let folder = tempfile::tempdir().unwrap();
    write_videos(&folder.path().join("DAVIS/train"), &["bear", "boat"]);
    write_videos(&folder.path().join("DAVIS/val"), &["blackswan"]);
    let common = "--episodes 1 --steps 2 --size 16 --no-mcap --difficulty hard";
    for (set, other, videos) in [("train", "val", &["bear", "boat"][..]), ("val", "train", &["blackswan"][..])] {
        works(folder.path(), &format!("{common} --videos DAVIS/{set} --video-set {set} -o {set}"));
        assert_eq!(videos_of(&Recording::open(&folder.path().join(set)).unwrap()), videos);
        let missing = format!("no official {other} video of DAVIS");
        fails(folder.path(), &format!("{common} --videos DAVIS/{set} --video-set {other} -o missing"), 1, &missing);
    }
}

/// A process may have only so many files open, and its videos be more.
#[test]
fn more_videos_than_files_may_be_open_are_recorded_under() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..140).map(|number| format!("film-{number}")).collect();
    for name in &names {
        write_videos(&folder.path().join("films"), &[name]);
    }
    let script = "ulimit -n 60; exec \"$0\" --videos films --video-count 70 --episodes 2 --steps 3 --size 16 --no-mcap --threads 1 -o many";
    let mut shell = Command::new("sh");
    shell.args(["-c", script, env!("CARGO_BIN_EXE_vibes-collect")]).current_dir(folder.path());
    shell.env("XDG_CACHE_HOME", folder.path().join("cache")).env("RAYON_NUM_THREADS", "2");
    let output = shell.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(videos_of(&Recording::open(&folder.path().join("many")).unwrap()).len(), 70);
}

#[test]
fn rewards_are_those_of_their_own_row() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--task known-slide --episodes 2 --steps 30 --no-pixels -o known");
    let recording = Recording::open(&folder.path().join("known")).unwrap();
    let repeat = recording.manifest().spec.action_repeat;
    for entry in recording.episodes() {
        let view = recording.episode(entry.index).unwrap();
        for step in 0..view.steps() {
            let observation = [0, 1].map(|i| f64::from(view.observation(step)[i]));
            let expected = vibes_env::known_reward(observation, f64::from(view.action(step)[0]), repeat);
            assert!((f64::from(view.reward(step)) - expected).abs() < 1e-6, "step {step}");
        }
    }
}

#[test]
fn verify_finds_a_damaged_file_and_says_which() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--episodes 2 --steps 5 -o sound");
    assert!(works(folder.path(), "verify sound").contains("sound"));
    let file = folder.path().join("sound/episodes/000001.arrow");
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0xff;
    std::fs::write(&file, bytes).unwrap();
    let output = collect(folder.path(), "verify sound");
    assert_eq!(output.status.code(), Some(3), "data was lost");
    assert!(String::from_utf8_lossy(&output.stdout).contains("000001.arrow"));
}

#[test]
fn info_says_what_a_recording_holds() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--grid 1x2 --steps 3 -o r");
    let text = works(folder.path(), "info r");
    for said in
        ["reacher-easy", "1 state trajectories x 2 distractor trajectories", "64 x 64 RGB", "random: 2 episodes"]
    {
        assert!(text.contains(said), "{said} in {text}");
    }
    let manifest: serde_json::Value = serde_json::from_str(&works(folder.path(), "info r --json")).unwrap();
    assert_eq!(manifest["grid"]["distractors"], 2);
    assert!(!text.contains("stopped"), "{text}");
    // One that was stopped on the way says so, and is sound as far as it goes.
    let place = folder.path().join("r/manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&place).unwrap()).unwrap();
    manifest["options"]["episodes"] = 5.into();
    std::fs::write(&place, manifest.to_string()).unwrap();
    let text = works(folder.path(), "info r") + &works(folder.path(), "verify r --no-simulation");
    assert_eq!(text.matches("of 5 (if it was stopped, the same command goes on)").count(), 2, "{text}");
}

/// A protocol's name stands beside whether the returns are its result.
#[test]
fn info_names_the_protocol_that_a_manifest_has() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--episodes 2 --steps 3 --size 16 --no-mcap -o r");
    assert!(!works(folder.path(), "info r").contains("protocol"));
    let place = folder.path().join("r/manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&place).unwrap()).unwrap();
    manifest["options"]["protocol"] = "dcs-easy-dynamic-500k".into();
    for (episodes, said) in [(2, ""), (100, "; no result of it until"), (0, "; what a run under it lived through")] {
        manifest["options"]["episodes"] = episodes.into();
        std::fs::write(&place, manifest.to_string()).unwrap();
        let text = works(folder.path(), "info r");
        let line = text.lines().find(|line| line.starts_with("protocol")).unwrap();
        assert!(line.contains("dcs-easy-dynamic-500k, videos procedural") && line.contains(said), "{line}");
        assert_eq!(line.contains("; "), !said.is_empty(), "{line}");
    }
}

#[test]
fn wrong_arguments_exit_with_2_and_list_what_is_known() {
    let folder = tempfile::tempdir().unwrap();
    fails(folder.path(), "--task reacher-hard", 2, "reacher-easy, walker-walk");
    fails(folder.path(), "--grid 10", 2, "states x distractors");
    fails(folder.path(), "--grid 2x2 --episodes 3", 2, "cannot be used with");
    fails(folder.path(), "--policy walk", 2, "planner:noise=SIGMA");
    fails(folder.path(), "--difficulty insane", 2, "easy, medium, hard");
    fails(folder.path(), "--distract sound", 2, "background, camera, color");
    fails(folder.path(), "--steps 0", 2, "steps");
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "nothing is left behind");
}

#[test]
fn missing_and_broken_input_exits_with_1() {
    let folder = tempfile::tempdir().unwrap();
    fails(folder.path(), "info nowhere", 1, "no recording here");
    fails(folder.path(), "verify nowhere", 1, "no recording here");
    fails(folder.path(), "--videos nowhere", 1, "nowhere");
    fails(folder.path(), "replay nowhere.json", 1, "nowhere.json");
    std::fs::create_dir(folder.path().join("broken")).unwrap();
    std::fs::write(folder.path().join("broken/manifest.json"), "{").unwrap();
    fails(folder.path(), "info broken", 1, "manifest.json");
    fails(folder.path(), "preview --videos nowhere -o figures", 1, "nowhere");
    assert!(!folder.path().join("figures").exists(), "nothing is left behind");
    // Before anything is measured.
    let output = collect(folder.path(), "bench --folder broken/manifest.json");
    assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(1), true));
}

/// A folder of five films has fewer of a half than the first difficulty uses, and a sheet shows what there is.
#[test]
fn a_preview_takes_as_many_films_as_there_are() {
    let folder = tempfile::tempdir().unwrap();
    write_videos(&folder.path().join("films"), &["f1", "f2", "f3", "f4", "f5"]);
    for set in ["train", "val"] {
        works(
            folder.path(),
            &format!("preview --task reacher-easy --videos films --video-set {set} --size 16 -o {set}"),
        );
        assert_eq!(std::fs::read_dir(folder.path().join(set)).unwrap().count(), 3, "a sheet for every difficulty");
    }
}

/// A full disk is no fault of the program's.
#[test]
fn an_output_that_cannot_be_written_is_an_error_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/sample");
    for arguments in ["info", "info --json", "verify --no-simulation --json"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(folder.path(), &format!("{arguments} {sample}")).stdout(full).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {said}");
        assert!(said.starts_with("vibes-collect: cannot write to stdout: "), "{arguments}: {said}");
        assert_eq!(said.lines().count(), 1, "{arguments}: {said}");
    }
}

#[test]
fn the_long_help_of_the_verbs_of_care_says_what_becomes_of_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    for (verb, wanted) in [
        ("merge", "they lose their cells"),
        ("split", "no part sees a state or distractor trajectory of another"),
        ("filter", "the grid keeps its size"),
        ("export", "the last observation of every episode"),
        ("import", "choices become zeros and a one"),
    ] {
        let help = |flag: &str| {
            let text = works(folder.path(), &format!("{verb} {flag}"));
            text.split_whitespace().collect::<Vec<_>>().join(" ")
        };
        let (short, long) = (help("-h"), help("--help"));
        assert!(long.contains(wanted) && !short.contains(wanted), "{verb}: {long}");
        let first = short.split(" Usage:").next().unwrap();
        assert!(long.starts_with(first) && works(folder.path(), "--help").contains(verb), "{verb}: {first}");
    }
}

/// An evaluation: every policy says its mean return, the interval and every return; a row of a grid counts once.
#[test]
fn a_recording_says_what_was_earned() {
    let folder = tempfile::tempdir().unwrap();
    let said = |arguments: &str| -> serde_json::Value {
        serde_json::from_str(&works(folder.path(), &format!("{arguments} --no-pixels --no-mcap --json"))).unwrap()
    };
    let plain = said("--policy random --episodes 5 --task cartpole-swingup -o plain");
    let returns: Vec<f64> = plain["returns"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
    let mean = returns.iter().sum::<f64>() / 5.0;
    assert_eq!(returns.len(), 5);
    assert!((plain["mean_return"].as_f64().unwrap() - mean).abs() < 1e-9);
    let (low, high) = (plain["interval"][0].as_f64().unwrap(), plain["interval"][1].as_f64().unwrap());
    assert!(low < mean && mean < high && ((low + high) / 2.0 - mean).abs() < 1e-9, "{plain}");
    let manifest = Recording::open(&folder.path().join("plain")).unwrap();
    assert_eq!(manifest.manifest().spec.pixels, None);
    let grid = said("--policy random --grid 2x3 --steps 6 -o grid");
    assert_eq!((&grid["episodes"], grid["returns"].as_array().unwrap().len()), (&6.into(), 2));
    // `info` says the same mean, also where rows have lost some of their cells.
    works(folder.path(), "filter grid --episodes 0-3 -o uneven");
    for name in ["grid", "uneven"] {
        let text = works(folder.path(), &format!("info {name}"));
        let wanted = format!("mean {:.1}, lowest", grid["mean_return"].as_f64().unwrap());
        assert!(text.contains(&wanted) && text.contains("of 2 state trajectories"), "{wanted} in {text}");
    }
    let single = said("--policy random --episodes 1 --steps 6 -o single");
    assert!(single["interval"].is_null() && single["mean_return"].is_number(), "{single}");
}
