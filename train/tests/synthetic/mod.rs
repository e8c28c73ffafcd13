//! Recordings made up for tests. At every step the state is a coin, shown as a bright or dark picture and as the sign of the observation; the action is
//! another coin, and the reward of a step is their product, +1 or −1. Coins of different steps are independent, so a reward can be predicted from the state and
//! action of its own step and from no other: rows out of line teach nothing.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test program uses some of these, and fails by panicking"
)]

use std::collections::BTreeMap;
use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{
    ActionSpec, Cell, Episode, EpisodeBuilder, EpisodeInfo, FORMAT, Frame, Grid, ImageSize, Manifest, ObservationPart,
    Recording, RecordingWriter, Spec,
};

pub const SIDE: u32 = 16;

pub fn spec(side: u32) -> Spec {
    Spec {
        task: "coins".to_owned(),
        action: ActionSpec { min: vec![-2.0], max: vec![2.0] },
        observation: vec![ObservationPart { name: "coin".to_owned(), len: 2 }],
        qpos: 1,
        qvel: 1,
        pixels: Some(ImageSize { height: side, width: side }),
        materials: Vec::new(),
        control_timestep: 0.02,
        action_repeat: 1,
        quantities: Vec::new(),
    }
}

fn coin(rng: &mut impl Rng) -> f32 {
    if rng.random() { 1.0 } else { -1.0 }
}

fn frame(side: u32, state: f32, rng: &mut impl Rng) -> Frame {
    let bright = if state > 0.0 { 140 } else { 20 };
    let pixels = (0..side * side * 3).map(|_| bright + rng.random_range(0..90)).collect();
    Frame {
        observation: vec![state, rng.random()],
        qpos: vec![state.into()],
        qvel: vec![0.0],
        pixels,
        ..Frame::default()
    }
}

/// What a step earns, of the state's coin and the action's.
pub type Reward = fn(f32, f32) -> f32;

pub fn episode(side: u32, index: u32, cell: Option<Cell>, steps: usize, reward: Reward, rng: &mut impl Rng) -> Episode {
    let mut state = coin(rng);
    let mut builder = EpisodeBuilder::first(index, cell, frame(side, state, rng));
    for _ in 0..steps {
        let action = coin(rng);
        let reward = reward(state, action);
        state = coin(rng);
        builder.step(&[2.0 * action], reward, 1.0, frame(side, state, rng));
    }
    builder.finish(false)
}

/// Writes `episodes` episodes of `steps` steps with pictures of `side`×`side`; on a grid with two columns if `grid`.
pub fn recording(path: &Path, side: u32, episodes: u32, steps: usize, grid: bool) -> Recording {
    recording_of(path, side, episodes, steps, grid, |state, action| state * action)
}

/// The same where a step earns something else.
pub fn recording_of(path: &Path, side: u32, episodes: u32, steps: usize, grid: bool, reward: Reward) -> Recording {
    let manifest = Manifest {
        format: FORMAT.to_owned(),
        spec: spec(side),
        options: serde_json::json!({ "steps": steps }),
        seed: 1,
        versions: BTreeMap::new(),
        grid: grid.then_some(Grid { states: episodes / 2, distractors: 2 }),
        videos: Vec::new(),
        episodes: Vec::new(),
    };
    let writer = RecordingWriter::create_or_resume(path, manifest, false).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for index in 0..episodes {
        let cell = grid.then_some(Cell { state: index / 2, distractor: index % 2 });
        writer
            .write(
                &episode(side, index, cell, steps, reward, &mut rng),
                EpisodeInfo { policy: "coins".to_owned(), ..EpisodeInfo::default() },
            )
            .unwrap();
    }
    writer.finish().unwrap()
}
