//! The action-only control of a table of latents: features of the past actions of every row (see [`vibes_measure::past_actions`]).

use std::collections::BTreeMap;

use vibes_data::{EpisodeView, Latents};
use vibes_measure::past_actions::{past_action_dims, past_action_features};

use crate::input::Frames;

/// Features of the past actions of every row, `[rows, dims]`, with their `dims`.
#[must_use]
pub fn action_features(latents: &Latents, frames: &Frames) -> (usize, Vec<f32>) {
    let axes = frames.recording().manifest().spec.action_len();
    let dims = past_action_dims(axes);
    let of = |view: &EpisodeView| past_action_features(&view.actions(), axes);
    let mut episodes: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
    let mut values = Vec::with_capacity(latents.len() * dims);
    for (&episode, &step) in latents.episode.iter().zip(&latents.step) {
        let features = episodes.entry(episode).or_insert_with(|| frames.view(episode).map(of).unwrap_or_default());
        let from = step as usize * dims;
        values.extend_from_slice(&features[from..from + dims]);
    }
    (dims, values)
}
