//! Episodes made up for tests: every number is a known function of episode, row and column, so that a row or column out of
//! place shows. The reward of step t is `reward_of(observation_t, action_t)`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use vibes_data::{
    ActionSpec, BackgroundFrame, CameraPose, Cell, Episode, EpisodeBuilder, EpisodeInfo, FORMAT, Frame, Grid,
    ImageSize, Manifest, ObservationPart, Recording, RecordingWriter, Spec, Video,
};

pub(crate) fn spec(pixels: bool) -> Spec {
    let part = |name: &str, len| ObservationPart { name: name.into(), len };
    Spec {
        task: "made-up".into(),
        action: ActionSpec { min: vec![-1.0; 2], max: vec![1.0; 2] },
        observation: vec![part("position", 2), part("height", 1)],
        qpos: 2,
        qvel: 1,
        pixels: pixels.then_some(ImageSize { height: 4, width: 6 }),
        materials: vec!["self".into(), "grid".into()],
        control_timestep: 0.02,
        action_repeat: 4,
        quantities: Vec::new(),
    }
}

pub(crate) fn reward_of(observation: &[f32], action: &[f32]) -> f32 {
    observation[0] + 10.0 * action[0] - action[1]
}

pub(crate) fn frame(spec: &Spec, index: u32, row: usize) -> Frame {
    let at = |column: usize| (index as f32) * 100.0 + row as f32 + 0.1 * column as f32;
    Frame {
        observation: (0..spec.observation_len()).map(at).collect(),
        qpos: (0..spec.qpos).map(|column| f64::from(at(column)) * 1.5).collect(),
        qvel: (0..spec.qvel).map(|column| f64::from(at(column)) * -0.5).collect(),
        pixels: (0..spec.pixels_len()).map(|byte| (index as usize * 31 + row * 7 + byte) as u8).collect(),
        camera: CameraPose { r: 1.0, h: row as f64, v: -0.25, roll: f64::from(index) },
        background: (row % 3 != 2).then_some(BackgroundFrame { video: index % 2, frame: row as u32 }),
        colors: (0..3 * spec.materials.len()).map(|column| column as f32 / 8.0).collect(),
    }
}

pub(crate) fn action(index: u32, step: usize) -> [f32; 2] {
    [((index as usize + step) % 5) as f32 * 0.25 - 0.5, (step % 3) as f32 * 0.5 - 0.5]
}

pub(crate) fn episode(spec: &Spec, index: u32, cell: Option<Cell>, steps: usize, is_terminal: bool) -> Episode {
    let mut builder = EpisodeBuilder::first(index, cell, frame(spec, index, 0));
    for step in 0..steps {
        let taken = action(index, step);
        let reward = reward_of(&frame(spec, index, step).observation, &taken);
        let ended = is_terminal && step + 1 == steps;
        builder.step(&taken, reward, f32::from(!ended), frame(spec, index, step + 1));
    }
    builder.finish(is_terminal)
}

pub(crate) fn manifest(spec: &Spec, grid: Option<Grid>) -> Manifest {
    let video = |name: &str| Video { name: name.into(), set: "train".into(), frames: 50 };
    Manifest {
        format: FORMAT.into(),
        spec: spec.clone(),
        options: serde_json::json!({ "steps": 9, "distract": ["camera", "color"] }),
        seed: 7,
        versions: BTreeMap::from([("vibes".into(), "0.1.0".into())]),
        grid,
        videos: vec![video("a"), video("b")],
        episodes: Vec::new(),
    }
}

pub(crate) fn info(index: u32) -> EpisodeInfo {
    EpisodeInfo {
        policy: "random".into(),
        seed: u64::from(index),
        model_overrides: serde_json::json!({ "target": [index, 2] }),
    }
}

/// A recording of a grid of `states` × `distractors` episodes of 9 steps.
pub(crate) fn recording(path: &Path, states: u32, distractors: u32) -> Recording {
    let spec = spec(true);
    let header = manifest(&spec, Some(Grid { states, distractors }));
    let writer = RecordingWriter::create_or_resume(path, header, true).unwrap();
    for index in 0..states * distractors {
        let cell = Cell { state: index / distractors, distractor: index % distractors };
        writer.write(&episode(&spec, index, Some(cell), 9, false), info(index)).unwrap();
    }
    writer.finish().unwrap()
}

/// Every file of a recording by name.
pub(crate) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let listed = fs::read_dir(folder.join("episodes")).unwrap().map(|file| file.unwrap().path());
    let all = listed.chain([folder.join("manifest.json")]);
    all.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap())).collect()
}

/// Every episode, in memory.
pub(crate) fn episodes(recording: &Recording) -> Vec<Episode> {
    recording.episodes().iter().map(|entry| recording.episode(entry.index).unwrap().to_episode()).collect()
}
