//! What is written comes back: Episode → Arrow → Episode and Episode → MCAP → Episode are the identity, and rows are aligned
//! as the format says.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[allow(dead_code, reason = "each test file uses a part of it")]
mod synthetic;

use std::path::Path;

use proptest::prelude::*;
use vibes_data::{
    Cell, Latents, LatentsSource, Recording, RecordingWriter, WindowSampler, read_mcap, verify_recording,
};

use synthetic::{episode, files, info, manifest, recording, reward_of, spec};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn an_episode_comes_back_from_both_files(
        index in 0u32..900, steps in 0usize..20, is_terminal: bool, pixels: bool, cell in prop::option::of((0u32..9, 0u32..9)),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let spec = spec(pixels);
        let cell = cell.map(|(state, distractor)| Cell { state, distractor });
        let written = episode(&spec, index, cell, steps, is_terminal);
        let writer = RecordingWriter::create_or_resume(folder.path(), manifest(&spec, None), true).unwrap();
        writer.write(&written, info(index)).unwrap();
        let recording = writer.finish().unwrap();
        prop_assert_eq!(&recording.episode(index).unwrap().to_episode(), &written);
        let entry = &recording.episodes()[0];
        let log = folder.path().join(&entry.mcap.as_ref().unwrap().path);
        prop_assert_eq!(&read_mcap(&log, &spec).unwrap(), &written);
        prop_assert!(verify_recording(&recording).is_empty());
    }
}

/// An episode that is given away is not copied, and is the same on disk.
#[test]
fn an_owned_episode_is_written_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for (pixels, with_mcap) in [(true, true), (true, false), (false, true)] {
        let [lent, given] = ["lent", "given"].map(|name| folder.path().join(format!("{name}-{pixels}-{with_mcap}")));
        let writer =
            |path: &Path| RecordingWriter::create_or_resume(path, manifest(&spec(pixels), None), with_mcap).unwrap();
        let (one, other) = (writer(&lent), writer(&given));
        for index in 0..2 {
            let written = episode(&spec(pixels), index, None, 5, false);
            one.write(&written, info(index)).unwrap();
            other.write_owned(written, info(index)).unwrap();
        }
        let written = other.finish().unwrap();
        assert_eq!(verify_recording(&written), []);
        assert_eq!(written.episodes()[1].mcap.is_some(), with_mcap);
        one.finish().unwrap();
        assert_eq!(files(&given), files(&lent), "pixels {pixels}, logs {with_mcap}");
    }
}

#[test]
fn windows_never_cross_an_episode_and_stay_aligned() {
    use rand::SeedableRng;
    let folder = tempfile::tempdir().unwrap();
    let recording = recording(folder.path(), 2, 3);
    let spec = &recording.manifest().spec;
    let sampler = WindowSampler::new(&recording, 4).unwrap();
    assert_eq!(sampler.windows(), 6 * (9 - 4 + 1));
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut seen = std::collections::BTreeSet::new();
    for draw in 0..50 {
        // Pages that were given back are found again.
        if draw % 10 == 9 {
            sampler.release();
        }
        let windows = sampler.sample(5, &mut rng);
        for b in 0..5 {
            let (index, start) = windows.starts[b];
            seen.insert((index, start));
            for t in 0..4 {
                let row = start as usize + t;
                let at = t * 5 + b;
                let frame = synthetic::frame(spec, index, row);
                let (observation, action) =
                    (&windows.observations[at * 3..at * 3 + 3], &windows.actions[at * 2..at * 2 + 2]);
                assert_eq!(observation, frame.observation);
                assert_eq!(&windows.pixels[at * 72..(at + 1) * 72], frame.pixels);
                assert_eq!(action, synthetic::action(index, row));
                assert_eq!(windows.rewards[at], reward_of(observation, action));
                assert_eq!(windows.is_first[at], row == 0);
                let before = if row == 0 { [0.0; 2] } else { synthetic::action(index, row - 1) };
                assert_eq!(&windows.previous_actions[at * 2..at * 2 + 2], before);
            }
        }
    }
    assert_eq!(seen.len() as u64, sampler.windows(), "every window turns up");
    assert!(WindowSampler::new(&recording, 10).is_err(), "no episode has 10 steps");
}

#[test]
fn latents_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("runs/x/latents.arrow");
    let latents = Latents {
        episode: vec![0, 0, 3],
        step: vec![0, 1, 0],
        state: vec![Some(1), None, Some(2)],
        distractor: vec![None, Some(4), Some(0)],
        reward: vec![Some(0.5), None, Some(-1.0)],
        dims: 2,
        latent: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        source: LatentsSource { recording: Some("recordings/x".into()), checkpoint: None },
    };
    latents.write(&path).unwrap();
    assert_eq!(Latents::read(&path).unwrap(), latents);
}

#[test]
fn the_same_episodes_give_the_same_bytes_in_any_order() {
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let spec = spec(true);
    let write = |path: &Path, order: &[u32]| -> Recording {
        let writer = RecordingWriter::create_or_resume(path, manifest(&spec, None), true).unwrap();
        for &index in order {
            writer.write(&episode(&spec, index, None, 5, false), info(index)).unwrap();
        }
        writer.finish().unwrap()
    };
    let (one, two) = (write(a.path(), &[0, 1, 2]), write(b.path(), &[2, 0, 1]));
    assert_eq!(one.manifest(), two.manifest());
    let bytes = |folder: &tempfile::TempDir| std::fs::read(folder.path().join("manifest.json")).unwrap();
    assert_eq!(bytes(&a), bytes(&b));
}
