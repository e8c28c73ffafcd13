//! A recording that was killed, damaged or made up by somebody hostile: everything finished is kept, and bad bytes give a
//! clear error, never a panic.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[allow(dead_code, reason = "each test file uses a part of it")]
mod synthetic;

use std::fs;
use std::path::Path;

use vibes_data::{
    EpisodeView, Error, Latents, Manifest, Recording, RecordingWriter, read_episode_entry, read_mcap, verify_recording,
};

use synthetic::{episode, info, manifest, recording, spec};

#[test]
fn a_killed_recording_opens_with_what_was_finished_and_goes_on_to_the_same_bytes() {
    let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let undisturbed = recording(whole.path(), 2, 2);
    let spec = spec(true);
    let header = manifest(&spec, undisturbed.manifest().grid);
    let writer = RecordingWriter::create_or_resume(killed.path(), header.clone(), true).unwrap();
    let cell = |index| undisturbed.episodes()[index as usize].cell;
    for index in [0, 3] {
        writer.write(&episode(&spec, index, cell(index), 9, false), info(index)).unwrap();
    }
    // As SIGKILL leaves it: the manifest not yet completed, an episode half-written.
    drop(writer);
    header.write(&killed.path().join("manifest.json")).unwrap();
    fs::write(killed.path().join("episodes/000001.arrow.partial"), b"half").unwrap();

    let found = Recording::open(killed.path()).unwrap();
    assert_eq!(found.episodes().iter().map(|entry| entry.index).collect::<Vec<_>>(), [0, 3]);
    assert!(verify_recording(&found).is_empty());

    let writer = RecordingWriter::create_or_resume(killed.path(), header, true).unwrap();
    assert!(writer.has(0) && !writer.has(1) && writer.has(3));
    for index in [1, 2] {
        writer.write(&episode(&spec, index, cell(index), 9, false), info(index)).unwrap();
    }
    writer.finish().unwrap();
    for file in ["manifest.json", "episodes/000001.arrow", "episodes/000003.mcap"] {
        assert_eq!(fs::read(killed.path().join(file)).unwrap(), fs::read(whole.path().join(file)).unwrap(), "{file}");
    }
    assert!(!killed.path().join("episodes/000001.arrow.partial").exists());
}

#[test]
fn a_recording_of_other_options_is_refused_and_named() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), 1, 2);
    let mut other = manifest(&spec(true), Some(vibes_data::Grid { states: 1, distractors: 2 }));
    other.options["steps"] = 10.into();
    let error = RecordingWriter::create_or_resume(folder.path(), other, true).unwrap_err();
    assert!(error.to_string().contains("options.steps is 9, asked for was 10"), "{error}");
}

#[test]
fn an_episode_that_does_not_fit_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let spec = spec(true);
    let writer = RecordingWriter::create_or_resume(folder.path(), manifest(&spec, None), true).unwrap();
    let mut odd = episode(&spec, 0, None, 4, false);
    odd.actions.pop();
    assert!(matches!(writer.write(&odd, info(0)), Err(Error::Episode { .. })));
    assert_eq!(fs::read_dir(folder.path().join("episodes")).unwrap().count(), 0);
}

#[test]
fn hostile_manifests_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), 1, 1);
    let path = folder.path().join("manifest.json");
    let good: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let refused = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut bad = good.clone();
        change(&mut bad);
        fs::write(&path, serde_json::to_vec(&bad).unwrap()).unwrap();
        matches!(Manifest::read(&path), Err(Error::Malformed { .. }))
    };
    assert!(refused(&|bad| bad["episodes"][0]["arrow"]["path"] = "../../etc/passwd".into()));
    assert!(refused(&|bad| bad["episodes"][0]["arrow"]["path"] = "/etc/passwd".into()));
    assert!(refused(&|bad| bad["spec"]["pixels"]["height"] = 4_000_000_000u32.into()));
    assert!(refused(&|bad| bad["spec"]["qpos"] = u64::MAX.into()));
    assert!(refused(&|bad| bad["spec"]["control_timestep"] = 0.into()));
    assert!(refused(&|bad| bad["spec"]["action_repeat"] = u32::MAX.into()));
    assert!(refused(&|bad| bad["format"] = "vibes-recording/9".into()));
    // Sizes that are small enough one by one, cells out of the grid or there twice, numbers out of order, a grid too large.
    assert!(refused(&|bad| {
        let part = serde_json::json!({ "name": "part", "len": 1 << 20 });
        bad["spec"]["observation"] = vec![part; 100].into();
    }));
    assert!(refused(&|bad| bad["spec"]["action"] = serde_json::json!({ "min": [], "max": [] })));
    assert!(refused(&|bad| bad["spec"]["control_timestep"] = (-1.0).into()));
    assert!(refused(&|bad| bad["spec"]["action"]["min"][0] = 1e300.into()));
    assert!(refused(&|bad| bad["episodes"][0]["cell"]["state"] = 1.into()));
    assert!(refused(&|bad| bad["grid"]["distractors"] = u32::MAX.into()));
    assert!(refused(&|bad| bad["videos"][0]["frames"] = u32::MAX.into()));
    for (index, cell) in [(0, 1), (1, 0)] {
        assert!(refused(&|bad| {
            bad["grid"]["distractors"] = 2.into();
            let mut twin = bad["episodes"][0].clone();
            twin["index"] = index.into();
            twin["cell"]["distractor"] = cell.into();
            bad["episodes"].as_array_mut().unwrap().push(twin);
        }));
    }
    for path in ["", ".", "..", "episodes/../../x", "./x"] {
        assert!(refused(&|bad| bad["episodes"][0]["mcap"]["path"] = path.into()), "{path}");
    }
    // Numbers that JSON does not have.
    for number in ["NaN", "1e999", "Infinity", "null"] {
        let text = serde_json::to_string(&good)
            .unwrap()
            .replace("\"control_timestep\":0.02", &format!("\"control_timestep\":{number}"));
        fs::write(&path, text).unwrap();
        assert!(matches!(Manifest::read(&path), Err(Error::Malformed { .. })), "{number}");
    }
    assert!(!refused(&|_| {}));
}

#[test]
fn actions_and_rewards_that_are_no_numbers_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let spec = spec(true);
    let writer = RecordingWriter::create_or_resume(folder.path(), manifest(&spec, None), true).unwrap();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut odd = episode(&spec, 0, None, 4, false);
        odd.rewards[2] = bad;
        let error = writer.write(&odd, info(0)).unwrap_err().to_string();
        assert!(error.contains("reward of step 2"), "{error}");
        let mut odd = episode(&spec, 0, None, 4, false);
        odd.discounts[0] = bad;
        assert!(writer.write(&odd, info(0)).is_err());
        let mut odd = episode(&spec, 0, None, 4, false);
        odd.actions[5] = bad;
        let error = writer.write(&odd, info(0)).unwrap_err().to_string();
        assert!(error.contains("action of step 2"), "{error}");
    }
    // Observations may be: a simulator that went astray is worth recording.
    let mut odd = episode(&spec, 0, None, 4, false);
    (odd.observations[1], odd.qpos[0]) = (f32::NAN, f64::NEG_INFINITY);
    writer.write(&odd, info(0)).unwrap();
    assert!(verify_recording(&writer.finish().unwrap()).is_empty(), "the same in both files, to the bit");
}

#[test]
fn verify_finds_what_checksums_do_not() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), 1, 2);
    let path = folder.path().join("manifest.json");
    let good: Manifest = Manifest::read(&path).unwrap();
    let fault = |change: &dyn Fn(&mut Manifest)| -> String {
        let mut other = good.clone();
        change(&mut other);
        other.write(&path).unwrap();
        let findings = verify_recording(&Recording::open(folder.path()).unwrap());
        findings.first().map_or(String::new(), |finding| finding.fault.clone())
    };
    assert_eq!(fault(&|_| {}), "");
    assert!(fault(&|other| other.episodes[1].policy = "planner".into()).contains("its own policy is \"random\""));
    assert!(fault(&|other| other.episodes[0].seed = 99).contains("its own seed"));
    assert!(fault(&|other| other.videos.truncate(1)).contains("of the manifest's 1 videos"));
    assert!(fault(&|other| other.videos[0].frames = 5).contains("frame 6 of video 0"));
    assert!(fault(&|other| other.episodes[0].episode_return += 1.0).contains("own return"));
    assert!(
        fault(&|other| {
            other.episodes[1].arrow = other.episodes[0].arrow.clone();
            other.episodes[1].mcap = None;
        })
        .contains("episode 0")
    );
}

#[test]
fn pipes_and_folders_are_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("folder.arrow");
    fs::create_dir(&path).unwrap();
    assert!(matches!(Latents::read(&path), Err(Error::Malformed { .. })));
    // Opening a pipe waits for its writer: the reader must not get so far.
    let pipe = folder.path().join("pipe.arrow");
    if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success()) {
        assert!(matches!(Latents::read(&pipe), Err(Error::Malformed { .. })));
    }
}

/// Every reader, on a file whose bytes are not to be trusted. Errors are fine; panics and hangs are not.
fn read_all(folder: &Path, recording: &Recording) {
    let spec = &recording.manifest().spec;
    let _ = Recording::open(folder);
    let _ = EpisodeView::open(&folder.join("episodes/000000.arrow"), spec).map(|view| view.to_episode());
    let _ = read_episode_entry(&folder.join("episodes/000000.arrow"));
    let _ = read_mcap(&folder.join("episodes/000000.mcap"), spec);
    let _ = Latents::read(&folder.join("latents.arrow"));
}

#[test]
fn flipped_and_truncated_bytes_never_panic_and_verify_names_the_file() {
    use rand::{Rng, SeedableRng};
    let folder = tempfile::tempdir().unwrap();
    let recording = recording(folder.path(), 1, 1);
    let latents = Latents {
        episode: vec![0],
        step: vec![0],
        state: vec![None],
        distractor: vec![None],
        reward: vec![None],
        dims: 3,
        latent: vec![0.0; 3],
        ..Latents::default()
    };
    latents.write(&folder.path().join("latents.arrow")).unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for file in ["manifest.json", "episodes/000000.arrow", "episodes/000000.mcap", "latents.arrow"] {
        let path = folder.path().join(file);
        let good = fs::read(&path).unwrap();
        for trial in 0..400 {
            let mut bad = good.clone();
            if trial % 4 == 0 {
                bad.truncate(rng.random_range(0..good.len()));
            }
            for _ in 0..rng.random_range(1..4) {
                // Arrow's footer and headers are where a reader can be led astray; half of the flips go to the end.
                let from = if trial % 2 == 0 { 0 } else { bad.len() * 3 / 4 };
                if from < bad.len() {
                    let at = rng.random_range(from..bad.len());
                    bad[at] = rng.random();
                }
            }
            fs::write(&path, &bad).unwrap();
            read_all(folder.path(), &recording);
            if file.starts_with("episodes") && bad != good {
                let findings = verify_recording(&recording);
                assert!(findings.iter().any(|finding| finding.path.ends_with(file)), "{file}, trial {trial}");
            }
        }
        fs::write(&path, &good).unwrap();
    }
}
