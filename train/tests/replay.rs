//! What a batch of online training is made of: windows of its own episodes and of the recordings that the run was given.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use synthetic::{SIDE, recording};
use vibes_train::replay::{Replay, ReplayOptions};

/// The own episode has a single window, so that its share is the share of windows that begin where it does.
#[test]
fn a_stated_share_of_the_windows_is_of_the_given_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let own = recording(&folder.path().join("own"), SIDE, 1, 8, false);
    let given = recording(&folder.path().join("given"), SIDE, 5, 100, false);
    for (given_share, wanted) in [(0.25, 0.75), (0.7, 0.3), (1.0, 0.0)] {
        let options = ReplayOptions { length: 8, batch: 10, given_share };
        let given = std::slice::from_ref(&given);
        let replay = Replay::open(own.path(), own.manifest().clone(), (1, 0), given, options).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let starts: Vec<(u32, u32)> = (0..300).flat_map(|_| replay.draw(10, &mut rng).starts).collect();
        assert_eq!(starts.len(), 3000, "every batch is whole");
        let is_own = |start: &&(u32, u32)| **start == (0, 0);
        let share = starts.iter().filter(is_own).count() as f64 / starts.len() as f64;
        // One window in 465 of the given ones begins there too.
        assert!((share - wanted).abs() < 0.03, "{share} of the windows are the run's own, not {wanted}");
    }
}
