//! Later views of a recording, as processes: `extend`, `render`, `replay`, seeds of single axes. The law of all of them: what comes out is what the
//! same options would have recorded in the first place, byte for byte.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod process;

use std::path::Path;

use process::{assert_same_bytes, fails, files, works};
use vibes_data::Recording;
use vibes_env::example_tasks;

fn tasks() -> Vec<String> {
    example_tasks().into_iter().map(str::to_owned).collect()
}

fn open(folder: &Path, name: &str) -> Recording {
    Recording::open(&folder.join(name)).unwrap()
}

#[test]
fn an_extended_grid_is_the_grid_recorded_so_large() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (larger, threads) in [("3x2", 1), ("2x3", 2), ("3x3", 2), ("2x2", 1)] {
        let options = "--steps 3 --seed 5 --size 24 --difficulty medium --camera-seed 9";
        works(folder, &format!("--grid 2x2 {options} -o small-{larger}"));
        works(folder, &format!("extend small-{larger} --grid {larger} --threads {threads}"));
        works(folder, &format!("--grid {larger} {options} -o fresh-{larger}"));
        assert_same_bytes(&folder.join(format!("small-{larger}")), &folder.join(format!("fresh-{larger}")));
        works(folder, &format!("--grid {larger} {options} -o small-{larger}"));
    }
    let left: Vec<String> = files(folder).into_keys().filter(|name| name.starts_with('.')).collect();
    assert!(left.is_empty(), "left beside the recordings: {left:?}");
}

#[test]
fn more_episodes_are_those_of_a_longer_recording() {
    let folder = tempfile::tempdir().unwrap();
    for task in tasks() {
        let options = format!("--task {task} --steps 2 --size 16 --no-mcap --seed 2 --mix random:1,planner:1");
        let (short, long) = (format!("{task}-short"), format!("{task}-long"));
        works(folder.path(), &format!("--episodes 1 {options} -o {short}"));
        works(folder.path(), &format!("extend {short} --episodes 3"));
        works(folder.path(), &format!("--episodes 3 {options} -o {long}"));
        assert_same_bytes(&folder.path().join(short), &folder.path().join(long));
    }
}

/// The actions of a row are gone, but its states are in the recording.
#[test]
fn known_rows_are_not_simulated_again_and_what_fails_harms_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("actions.json"), "[[0.5, -0.5], [1, 0], [0, 1]]").unwrap();
    works(folder, "--grid 2x1 --steps 3 --size 16 --policy actions:actions.json -o grid");
    std::fs::remove_file(folder.join("actions.json")).unwrap();
    works(folder, "extend grid --grid 2x3");
    let before = files(&folder.join("grid"));
    fails(folder, "extend grid --grid 3x3", 1, "actions.json");
    assert_eq!(open(folder, "grid").episodes().len(), 6);
    assert!(files(&folder.join("grid")) == before, "the manifest asks for what it asked for before");
    works(folder, "verify grid --no-simulation");
    works(folder, "--grid 2x3 --steps 3 --size 16 --policy actions:actions.json -o grid");
}

#[test]
fn a_recording_does_not_shrink_and_what_was_put_together_is_not_extended() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--grid 2x2 --steps 2 --size 16 -o grid");
    works(folder, "--episodes 2 --steps 2 --size 16 -o list");
    fails(folder, "extend grid --grid 3x1", 2, "a grid of 2x2");
    fails(folder, "extend grid --episodes 9", 2, "a grid of 2x2");
    fails(folder, "extend list --episodes 1", 2, "2 episodes");
    fails(folder, "extend list", 2, "--grid");
    fails(folder, "extend nowhere --episodes 3", 1, "no recording here");
    works(folder, "render list --rotate 30 -o turned");
    fails(folder, "extend turned --episodes 3", 1, "turned about the origin");
    let path = folder.join("list/manifest.json");
    let text = std::fs::read_to_string(&path).unwrap().replacen("\"seed\": ", "\"seed\": 1", 9);
    std::fs::write(&path, text).unwrap();
    fails(folder, "extend list --episodes 3", 1, "not the one that its options make");
}

#[test]
fn every_task_drawn_again_is_what_those_options_record() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cases = [
        ("--size 28", "--size 28"),
        ("--distract none", "--distract none --size 20"),
        (
            "--distract camera,color --difficulty hard --static",
            "--distract camera,color --difficulty hard --static --size 20",
        ),
        ("--seed 8", "--background-seed 8 --camera-seed 8 --color-seed 8 --size 20"),
    ];
    for (number, task) in tasks().into_iter().enumerate() {
        let common = format!("--task {task} --grid 2x1 --steps 3 --seed 4 --no-mcap");
        works(folder, &format!("{common} --size 20 -o {task}"));
        // Two views of every task; what a view does is not the task's business.
        for (number, (again, fresh)) in
            [number, number + 1].map(|case| cases[case % cases.len()]).into_iter().enumerate()
        {
            works(folder, &format!("render {task} -o {task}-again-{number} {again}"));
            works(folder, &format!("{common} -o {task}-fresh-{number} {fresh}"));
            assert_same_bytes(
                &folder.join(format!("{task}-again-{number}")),
                &folder.join(format!("{task}-fresh-{number}")),
            );
        }
    }
}

#[test]
fn looks_videos_and_recordings_without_pictures_can_be_drawn_too() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let common = "--episodes 2 --steps 3 --task walker-walk";
    works(folder, &format!("{common} --no-pixels -o blind"));
    works(folder, &format!("{common} --size 32 -o seen"));
    works(folder, &format!("{common} --size 32 --videos procedural -o named"));
    assert_same_bytes(&folder.join("named"), &folder.join("seen"));
    works(folder, "render blind --size 32 -o blind-seen");
    assert_same_bytes(&folder.join("blind-seen"), &folder.join("seen"));
    works(folder, "render seen --render suite --video-set val --video-count 2 -o suite");
    works(folder, &format!("{common} --size 32 --render suite --video-set val --video-count 2 -o fresh"));
    assert_same_bytes(&folder.join("suite"), &folder.join("fresh"));
    works(folder, "verify suite");
    works(folder, "render seen --render suite --video-set val --video-count 2 -o suite");
    fails(folder, "render seen -o seen", 1, "the recording itself");
    fails(folder, "render nowhere -o new", 1, "no recording here");
    fails(folder, "render seen --size 8 -o suite", 1, "another recording is here");
}

/// Changes the options in a recording's manifest.
fn change_options(recording: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let path = recording.join("manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    change(&mut manifest["options"]);
    std::fs::write(&path, manifest.to_string()).unwrap();
}

/// Others who record a world name in their own words who acted, and may not know beforehand how often: an online run says `random`, Python says `python`. A redraw
/// does not act.
#[test]
fn what_others_recorded_in_a_world_is_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 2 --steps 3 --size 16 --no-mcap -o plain");
    for policy in ["random", "python"] {
        change_options(&folder.join("plain"), |options| {
            options["policy"] = policy.into();
            options["episodes"] = 0.into();
        });
        for (name, change) in [("larger", "--size 20"), ("other", "--seed 8")] {
            let name = format!("{policy}-{name}");
            works(folder, &format!("render plain {change} -o {name}"));
            let again = open(folder, &name);
            assert_eq!(again.manifest().options["policy"], policy);
            assert_eq!(again.episodes().len(), 2);
            assert_eq!(again.episode(1).unwrap().qpos(3), open(folder, "plain").episode(1).unwrap().qpos(3));
            assert!(works(folder, &format!("verify {name}")).starts_with("sound: 2 episodes, 0 findings; 2 simulated"));
        }
    }
    // Whoever simulates has to know who acts.
    change_options(&folder.join("plain"), |options| options["episodes"] = 2.into());
    fails(folder, "extend plain --episodes 3", 1, "it was recorded from Python");
    change_options(&folder.join("plain"), |options| *options = serde_json::json!({ "recorded_by": "python" }));
    for line in ["extend plain --episodes 3", "render plain --size 20 -o again"] {
        fails(folder, line, 1, "it was recorded from Python, with a spec of its own");
    }
    assert!(!folder.join("again").exists());
}

/// A damaged manifest asks for more names of videos than memory holds, or for a step that takes for ever.
#[test]
fn numbers_that_no_command_takes_are_an_error_and_nothing_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 1 --steps 2 --size 16 --no-mcap -o plain");
    let whole = std::fs::read(folder.join("plain/manifest.json")).unwrap();
    let damages = [
        ("video_count", u64::MAX, "right is 1 to 10000"),
        ("action_repeat", u64::from(u32::MAX), "right is 1 to 1000"),
        ("steps", u64::from(u32::MAX), "right is 0 to 1000000"),
        ("episodes", u64::from(u32::MAX), "right is 0 to 999999"),
        ("size", u64::from(u32::MAX), "right is 1 to 2048"),
    ];
    for (option, number, said) in damages {
        change_options(&folder.join("plain"), |options| options[option] = number.into());
        for line in ["verify plain", "render plain --seed 3 -o again", "extend plain --episodes 2"] {
            fails(folder, line, 1, &format!("its option {option} is {number}; {said}"));
        }
        assert!(!folder.join("again").exists(), "{option}");
        std::fs::write(folder.join("plain/manifest.json"), &whole).unwrap();
    }
    let mut manifest: serde_json::Value = serde_json::from_slice(&whole).unwrap();
    for name in ["", "../elsewhere"] {
        manifest["videos"][0]["name"] = name.into();
        std::fs::write(folder.join("plain/manifest.json"), manifest.to_string()).unwrap();
        for line in ["verify plain", "render plain --size 20 -o again"] {
            fails(
                folder,
                line,
                1,
                &format!("a background video is named {name:?}; right is the name of a video: plain"),
            );
        }
    }
    assert!(!folder.join("again").exists());
    let mut manifest: serde_json::Value = serde_json::from_slice(&whole).unwrap();
    manifest["spec"]["action_repeat"] = u32::MAX.into();
    std::fs::write(folder.join("plain/manifest.json"), manifest.to_string()).unwrap();
    fails(folder, "replay plain", 1, "held for 4294967295 control steps");
}

#[test]
fn a_turned_reacher_is_a_recording_of_the_same_rewards() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 2 --steps 40 --size 32 -o plain");
    works(folder, "render plain --rotate 90 -o turned");
    assert!(works(folder, "verify turned").starts_with("sound"), "physics again gives the turned states");
    assert_eq!(works(folder, "replay turned --episode 1 --tolerance 1e-6 --quiet"), "");
    works(folder, "render turned --rotate -90 -o back");
    let [plain, turned, back] = ["plain", "turned", "back"].map(|name| open(folder, name).episode(1).unwrap());
    for row in 0..plain.rows() {
        assert!((turned.qpos(row)[0] - plain.qpos(row)[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let [x, y] = [2, 3].map(|place| plain.observation(row)[place]);
        let [turned_x, turned_y] = [2, 3].map(|place| turned.observation(row)[place]);
        assert!((turned_x + y).abs() < 1e-6 && (turned_y - x).abs() < 1e-6, "the way to the target turns too");
        assert!((back.qpos(row)[0] - plain.qpos(row)[0]).abs() < 1e-12);
        assert_eq!(turned.camera(row), plain.camera(row), "the camera does not");
        assert_ne!(turned.pixels(row), plain.pixels(row));
    }
    assert!((0..40).all(|step| turned.reward(step) == plain.reward(step)));
    for task in tasks().iter().filter(|task| *task != "reacher-easy") {
        works(folder, &format!("--task {task} --episodes 1 --steps 2 --size 16 --no-mcap -o {task}"));
        for degrees in [10, 0] {
            let line = format!("render {task} --rotate {degrees} -o {task}-turned");
            fails(folder, &line, 2, "not the same turned");
        }
    }
}

#[test]
fn an_axis_has_a_seed_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 3 --steps 3 --size 16 --seed 1 -o plain");
    for axis in ["background", "camera", "color"] {
        works(folder, &format!("--episodes 3 --steps 3 --size 16 --seed 1 --{axis}-seed 77 -o {axis}"));
        let (plain, other) = (open(folder, "plain"), open(folder, axis));
        assert_eq!(other.manifest().options["axis_seeds"], serde_json::json!({ axis: 77 }));
        let mut differs = [false; 3];
        for index in 0..3 {
            let (plain, other) = (plain.episode(index).unwrap(), other.episode(index).unwrap());
            for row in 0..4 {
                assert_eq!(plain.qpos(row), other.qpos(row), "{axis}: the states stay");
                differs[0] |= plain.background(row) != other.background(row);
                differs[1] |= plain.camera(row) != other.camera(row);
                differs[2] |= plain.colors(row) != other.colors(row);
            }
        }
        assert_eq!(differs, ["background", "camera", "color"].map(|name| name == axis), "{axis}");
        fails(folder, &format!("--episodes 3 --steps 3 --size 16 --seed 1 -o {axis}"), 1, "axis_seeds");
    }
}

#[test]
fn every_task_s_episode_is_replayed_exactly_and_leaves_a_trace() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for task in tasks() {
        works(
            folder,
            &format!("--task {task} --episodes 2 --steps 5 --size 48 --distract none --render suite -o {task}"),
        );
        works(
            folder,
            &format!("replay {task} --episode 1 --tolerance 0 --out {task}.json --frames {task}-rows --size 48"),
        );
        works(folder, &format!("replay {task}.json --tolerance 0 --frames {task}-steps --size 20"));
        let recording = open(folder, &task);
        let view = recording.episode(1).unwrap();
        let repeat = recording.manifest().spec.action_repeat as usize;
        assert_eq!(
            files(&folder.join(format!("{task}-steps"))).len(),
            5 * repeat + 1,
            "{task}: a picture a control step"
        );
        for row in 0..6 {
            let path = folder.join(format!("{task}-rows/{row:06}.png"));
            let picture = image::open(path).unwrap().into_rgb8();
            let difference = picture.as_raw().iter().zip(view.pixels(row)).map(|(&a, &b)| f64::from(a.abs_diff(b)));
            let mean = difference.sum::<f64>() / view.pixels(row).len() as f64;
            assert!(mean < 1.0, "{task}: row {row} differs by {mean}");
        }
    }
    fails(folder, "replay reacher-easy --episode 7", 1, "no episode 7");
}

/// Five links have four joints, and a wave has four parameters.
#[test]
fn torques_are_replayed_as_torques_and_not_merged_with_waves() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let common = "--task swimmer-5 --episodes 1 --steps 3 --no-pixels --no-mcap";
    for (name, more) in [("torques", "--raw-torques"), ("others", "--raw-torques --seed 2"), ("waves", "")] {
        works(folder, &format!("{common} {more} -o {name}"));
        works(folder, &format!("replay {name} --tolerance 0"));
    }
    fails(folder, "merge torques waves -o all", 2, "torques and waves have another raw_torques");
    works(folder, "merge torques others -o both");
    works(folder, "replay both --episode 1 --tolerance 0");
}

/// Another action would have led elsewhere, and replay says so.
#[test]
fn an_episode_that_is_not_its_own_actions_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 1 --steps 6 --no-pixels --no-mcap -o episode");
    let recording = open(folder, "episode");
    let forge = |name: &str, change: fn(&mut vibes_data::Episode)| {
        let mut episode = recording.episode(0).unwrap().to_episode();
        change(&mut episode);
        let manifest = vibes_data::Manifest { episodes: Vec::new(), ..recording.manifest().clone() };
        let writer = vibes_data::RecordingWriter::create_or_resume(&folder.join(name), manifest, false).unwrap();
        let model_overrides = recording.episodes()[0].model_overrides.clone();
        writer.write(&episode, vibes_data::EpisodeInfo { model_overrides, ..Default::default() }).unwrap();
        writer.finish().unwrap();
    };
    works(folder, "replay episode");
    forge("forged", |episode| episode.actions[0] = -episode.actions[0]);
    let output = process::collect(folder, "replay forged");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    // JSON has no infinity, and null says that there was nothing to compare.
    forge("infinite", |episode| episode.qpos[4] = f64::INFINITY);
    let output = process::collect(folder, "replay infinite --json");
    let errors: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), &errors["qpos"]), (Some(1), &"Infinity".into()), "{errors}");
    assert!(errors["qvel"].is_number() && errors["rewards"].is_number(), "{errors}");
}

#[test]
fn frames_of_a_trace_are_dm_controls_own_pictures() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let folder = tempfile::tempdir().unwrap();
    for (name, picture) in files(&golden.join("frames")) {
        let (trace, step) = name.strip_suffix(".png").unwrap().rsplit_once('-').unwrap();
        let path = golden.join(format!("physics/{trace}.json"));
        works(folder.path(), &format!("replay {} --frames {trace} --size 64", path.display()));
        let read = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgb8().into_raw();
        let ours =
            std::fs::read(folder.path().join(format!("{trace}/{:06}.png", step.parse::<u32>().unwrap()))).unwrap();
        let (ours, theirs) = (read(&ours), read(&picture));
        assert_eq!(ours.len(), theirs.len());
        let difference = ours.iter().zip(&theirs).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum::<f64>();
        assert!(difference / ours.len() as f64 <= 1.0, "{name}: {}", difference / ours.len() as f64);
    }
}
