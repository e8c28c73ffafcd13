//! Every place that says a version of the simulator or of the models says the one that set-up fetches: `setup/wheels.txt`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use vibes_env::{Environment, EnvironmentOptions, Heading, example_tasks};

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)).unwrap()
}

/// The version to which a wheel is pinned.
fn pinned(wheel: &str) -> String {
    let wheels = read("setup/wheels.txt");
    let rest = wheels.lines().find_map(|line| line.strip_prefix(wheel)?.strip_prefix("==")).unwrap();
    rest.trim_end_matches('\\').trim().to_owned()
}

#[test]
fn a_recording_says_the_shape_of_its_task_and_the_versions_that_set_up_fetched() {
    for task in example_tasks() {
        let environment = Environment::new(task, EnvironmentOptions::default()).unwrap();
        let options = serde_json::json!({ "anything": 1 });
        let heading = Heading { spec: environment.spec(Some(12)), options, seed: 7, grid: None, videos: Vec::new() };
        let manifest = heading.manifest();
        assert_eq!((manifest.spec.task.as_str(), manifest.spec.pixels_len()), (task, 12 * 12 * 3));
        assert_eq!(manifest.spec.fault(), None, "{task}");
        assert_eq!(environment.spec(None).pixels, None);
        let version = |name: &str| manifest.versions[name].as_str();
        assert_eq!(version("mujoco"), pinned("mujoco"));
        assert_eq!(version("dm_control models"), pinned("dm-control"));
        assert_eq!(version("vibes"), env!("CARGO_PKG_VERSION"));
    }
}

/// Files that cannot read the version when they are used.
#[test]
fn whoever_writes_a_version_by_hand_writes_the_pinned_one() {
    let (mujoco, models) = (pinned("mujoco"), pinned("dm-control"));
    for (path, says) in [
        ("env/mujoco/libmujoco.so", format!("libmujoco.so.{mujoco})")),
        ("NOTICE", format!("MuJoCo {mujoco} ")),
        ("NOTICE", format!("dm_control {models} ")),
        ("python/tests/requirements.txt", format!("mujoco=={mujoco}\n")),
        ("python/tests/requirements.txt", format!("dm-control=={models}\n")),
        ("env/src/tasks.rs", format!("`dm_control` {models} ")),
    ] {
        assert!(read(path).contains(&says), "{path} does not say {says:?}");
    }
}
