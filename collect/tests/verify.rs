//! What `verify` says: every damaged episode, and no other.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "process/run.rs"]
mod process;

use std::path::Path;

use process::{fails, works};
use vibes_collect::verify::verify;
use vibes_data::{Episode, EpisodeInfo, FileTransfer, Manifest, Recording, RecordingWriter};

/// The recording with one of its episodes changed and written again, checksums and all.
fn with_changed(recording: &Recording, index: u32, out: &Path, change: impl FnOnce(&mut Episode)) -> Recording {
    let manifest = Manifest { episodes: Vec::new(), ..recording.manifest().clone() };
    let writer = RecordingWriter::create_or_resume(out, manifest, false).unwrap();
    let mut change = Some(change);
    for entry in recording.episodes() {
        if entry.index != index {
            writer.take(recording, entry, FileTransfer::Copy).unwrap();
            continue;
        }
        let mut episode = recording.episode(index).unwrap().to_episode();
        change.take().unwrap()(&mut episode);
        let info = EpisodeInfo {
            policy: entry.policy.clone(),
            seed: entry.seed,
            model_overrides: entry.model_overrides.clone(),
        };
        writer.write(&episode, info).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn a_damaged_episode_condemns_itself_alone() {
    let folder = tempfile::tempdir().unwrap();
    works(folder.path(), "--episodes 3 --steps 4 --size 24 --no-mcap -q -o r");
    let sound = Recording::open(&folder.path().join("r")).unwrap();
    assert_eq!(verify(&sound, true).unwrap().findings, []);
    type Damage = (&'static str, fn(&mut Episode), &'static str);
    let damages: [Damage; 4] = [
        ("picture", |episode| episode.pixels[..24 * 24 * 3].fill(7), "a picture differs"),
        ("qpos", |episode| episode.qpos[2] += 1e-3, "positions differ"),
        ("nan", |episode| episode.qpos[4] = f64::NAN, "positions differ by inf"),
        ("infinite", |episode| episode.qpos[4] = f64::INFINITY, "positions differ by inf"),
    ];
    for (name, damage, said) in damages {
        for index in 0..3 {
            let recording = with_changed(&sound, index, &folder.path().join(format!("{name}-{index}")), damage);
            let verdict = verify(&recording, true).unwrap();
            let faults: Vec<&str> = verdict.findings.iter().map(|finding| finding.fault.as_str()).collect();
            assert_eq!(faults.len(), 1, "{name} in episode {index}: {faults:?}");
            assert!(faults[0].contains(&format!("episode {index}")) && faults[0].contains(said), "{faults:?}");
        }
    }
}

/// What a recording names is no argument of the command's: a task that this build does not know is a failure, and not a wrong argument.
#[test]
fn a_recording_of_an_unknown_task_is_refused_as_the_file_s_fault() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    works(folder, "--episodes 1 --steps 3 --no-pixels --no-mcap -q -o r");
    works(folder, "replay r --out r.json --quiet");
    for file in ["r/manifest.json", "r.json"] {
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(text.contains("reacher-easy"), "{file}");
        std::fs::write(folder.join(file), text.replace("reacher-easy", "juggler")).unwrap();
    }
    for verb in ["verify r", "replay r", "replay r.json", "render r -o drawn", "extend r --episodes 2"] {
        fails(folder, verb, 1, "unknown task juggler; the tasks are ");
    }
    assert!(!folder.join("drawn").exists());
    // What was typed is one.
    fails(folder, "--task juggler -o typed", 2, "unknown task juggler");
}
