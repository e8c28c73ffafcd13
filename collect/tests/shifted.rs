//! What `verify` finds beside damaged positions: columns that are a row late, and pictures that are, where nothing moves but what acts.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod process;

use std::path::Path;

use process::works;
use vibes_collect::verify::verify;
use vibes_data::{Episode, EpisodeInfo, Manifest, Recording, RecordingWriter};

/// The recording with every episode changed and written again, checksums and all.
fn changed(recording: &Recording, out: &Path, change: fn(&mut Episode)) -> Recording {
    let manifest = Manifest { episodes: Vec::new(), ..recording.manifest().clone() };
    let writer = RecordingWriter::create_or_resume(out, manifest, false).unwrap();
    for entry in recording.episodes() {
        let mut episode = recording.episode(entry.index).unwrap().to_episode();
        change(&mut episode);
        let (policy, model_overrides) = (entry.policy.clone(), entry.model_overrides.clone());
        writer.write(&episode, EpisodeInfo { policy, seed: entry.seed, model_overrides }).unwrap();
    }
    writer.finish().unwrap()
}

/// Every row of a column a row late, the first one twice.
fn late<T: Copy>(column: &mut [T], rows: usize) {
    let len = column.len() / rows;
    column.copy_within(..len * (rows - 1), len);
}

/// And a row early, the last one twice.
fn early<T: Copy>(column: &mut [T], rows: usize) {
    let len = column.len() / rows;
    column.copy_within(len.., 0);
}

#[test]
fn what_is_a_row_late_is_found_in_every_column() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, distractors) in [("clean", "none"), ("coloured", "color --static")] {
        let options = "--task cartpole-swingup --episodes 2 --steps 12 --size 48 --no-mcap -q";
        works(folder, &format!("{options} --distract {distractors} -o {name}"));
        let sound = Recording::open(&folder.join(name)).unwrap();
        assert_eq!(verify(&sound, true).unwrap().findings, []);
        type Damage = (&'static str, fn(&mut Episode), &'static str);
        let damages: [Damage; 5] = [
            ("rewards", |episode| late(&mut episode.rewards, 12), "rewards differ by"),
            ("observations", |episode| late(&mut episode.observations, 13), "observations differ by"),
            ("velocities", |episode| late(&mut episode.qvel, 13), "velocities differ by"),
            ("late", |episode| late(&mut episode.pixels, 13), "the picture of row"),
            ("early", |episode| early(&mut episode.pixels, 13), "the picture of row"),
        ];
        for (damage, change, said) in damages {
            let recording = changed(&sound, &folder.join(format!("{name}-{damage}")), change);
            let faults: Vec<String> =
                verify(&recording, true).unwrap().findings.into_iter().map(|finding| finding.fault).collect();
            assert_eq!(faults.len(), 2, "{name}, {damage}: {faults:?}");
            assert!(faults.iter().all(|fault| fault.contains(said)), "{name}, {damage}: {faults:?}");
        }
    }
}
