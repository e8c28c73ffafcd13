//! Which rows count as one state trajectory when a probe is fitted on several recordings.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use std::collections::BTreeSet;

use synthetic::{SIDE, recording};
use vibes_data::Recording;
use vibes_train::evaluate::{self, Rows};

/// State trajectories among all rows of some recordings, as probes and as the intervals of gaps count them.
fn trajectories(recordings: &[Recording]) -> usize {
    let rows = Rows::of(recordings, usize::MAX).unwrap();
    let past = rows.past_actions();
    let states = rows.table(&past).unwrap().state_trajectories();
    let of_probes = states.into_iter().max().map_or(0, |last| last as usize + 1);
    let labels = evaluate::trajectories(recordings).unwrap();
    let of_gaps = labels.values().map(|label| label.0).collect::<BTreeSet<_>>().len();
    assert_eq!(of_gaps, of_probes);
    of_probes
}

#[test]
fn a_recording_drawn_again_has_no_trajectories_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    // Coins are tossed in the same order everywhere: the same episodes, and other ones where they are longer.
    let made = |name: &str, steps, grid| recording(&folder.path().join(name), SIDE, 6, steps, grid);
    let (first, again, other) = (made("first", 30, false), made("again", 30, false), made("other", 31, false));
    assert_eq!(trajectories(std::slice::from_ref(&first)), 6);
    assert_eq!(trajectories(&[first.clone(), again.clone()]), 6);
    assert_eq!(trajectories(&[first.clone(), other.clone()]), 12);
    assert_eq!(trajectories(&[first, again, other]), 12);
    // The cells of a grid keep its states, three of them here.
    assert_eq!(trajectories(&[made("grid", 30, true)]), 3);
}
