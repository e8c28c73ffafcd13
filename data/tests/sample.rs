//! The recording in the tree is a real one, and stays readable: a change of the format that breaks old recordings shows here.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::path::Path;

use vibes_data::{Latents, Recording, verify_recording};

#[test]
fn the_sample_is_sound_and_its_latents_are_of_its_rows() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample");
    let recording = Recording::open(&path).unwrap();
    assert_eq!(verify_recording(&recording), []);
    let latents = Latents::read(&path.join("latents.arrow")).unwrap();
    assert_eq!(latents.len(), recording.episodes().iter().map(|entry| entry.steps as usize + 1).sum::<usize>());
    for row in 0..latents.len() {
        let view = recording.episode(latents.episode[row]).unwrap();
        let step = latents.step[row] as usize;
        assert_eq!(latents.reward[row], (step < view.steps()).then(|| view.reward(step)));
    }
}
