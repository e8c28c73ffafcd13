//! A small recording and its latents, made with the format's own writers: a disc that circles on a coloured background, no simulator.
//!
//! The task state is the disc's position; the distractor is the background's colour and the camera. The latents hold the state on the unit
//! circle, a little of the distractor, and one constant dimension, so that the right answers are known.

use std::path::{Path, PathBuf};

use vibes_data::{
    ActionSpec, BackgroundFrame, CameraPose, Cell, EpisodeBuilder, EpisodeInfo, FORMAT, Frame, Grid, ImageSize,
    Latents, LatentsSource, Manifest, ObservationPart, RecordingWriter, Spec, Video,
};

pub(crate) const SIDE: u32 = 24;

/// A folder with `recordings/discs` and `runs/discs/latents.arrow`.
pub(crate) struct Fixture {
    path: PathBuf,
    /// Removed with the fixture; none for a folder that stays.
    _dir: Option<tempfile::TempDir>,
}

impl Fixture {
    /// A grid of `states` × `distractors` episodes of `steps` actions.
    pub(crate) fn grid(states: u32, distractors: u32, steps: u32) -> Self {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().to_path_buf();
        Self { _dir: Some(dir), ..Self::fill(path, states, distractors, steps) }
    }

    /// The same in a folder that is made anew and stays.
    pub(crate) fn at(path: PathBuf, states: u32, distractors: u32, steps: u32) -> Self {
        let _ = std::fs::remove_dir_all(&path);
        Self::fill(path, states, distractors, steps)
    }

    fn fill(path: PathBuf, states: u32, distractors: u32, steps: u32) -> Self {
        let cells: Vec<Cell> =
            (0..states * distractors).map(|i| Cell { state: i / distractors, distractor: i % distractors }).collect();
        write_recording(&path.join("recordings/discs"), &cells, steps, Some(Grid { states, distractors }));
        latents(&cells, steps).write(&path.join("runs/discs/latents.arrow")).expect("latents");
        write_run(&path.join("runs/discs"), 0.0);
        Self { path, _dir: None }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn latents(&self) -> PathBuf {
        self.path().join("runs/discs/latents.arrow")
    }
}

/// A pseudo-random number in 0..1 from a counter.
pub(crate) fn noise(i: u32) -> f32 {
    let x = i.wrapping_mul(2_654_435_761) ^ 0x9E37_79B9;
    let x = (x ^ (x >> 15)).wrapping_mul(0x85EB_CA6B);
    ((x ^ (x >> 13)) & 0xFFFF) as f32 / 65_536.0
}

fn angle(cell: Cell, step: u32) -> f32 {
    cell.state as f32 * 1.3 + step as f32 * 0.09
}

fn reward(cell: Cell, step: u32) -> f32 {
    if angle(cell, step).sin() > 0.4 { 1.0 } else { 0.0 }
}

fn frame(cell: Cell, step: u32) -> Frame {
    let (y, x) = angle(cell, step).sin_cos();
    let (cx, cy) = ((0.5 + 0.35 * x) * SIDE as f32, (0.5 - 0.35 * y) * SIDE as f32);
    let tint = [60 * (cell.distractor as u8 % 4), 80, 200 - 40 * (cell.distractor as u8 % 5)];
    let pixel = |i: u32| {
        let (px, py) = ((i % SIDE) as f32, (i / SIDE) as f32);
        if (px - cx).powi(2) + (py - cy).powi(2) < 12.0 {
            [240, 220, 60]
        } else {
            tint.map(|t| t.wrapping_add((py * 2.0) as u8))
        }
    };
    let wave = (step as f64 * 0.1 + f64::from(cell.distractor)).sin();
    Frame {
        observation: vec![x, y, noise(cell.state * 1000 + step)],
        qpos: vec![f64::from(x), f64::from(y)],
        qvel: vec![0.0, 0.0],
        pixels: (0..SIDE * SIDE).flat_map(pixel).collect(),
        camera: CameraPose { r: 1.0 + 0.1 * wave, h: 0.2 * wave, v: 0.3, roll: 0.05 * wave },
        background: Some(BackgroundFrame { video: cell.distractor % 2, frame: step % 12 }),
        colors: vec![0.1 * cell.distractor as f32, 0.5, 0.9 - 0.05 * (step % 7) as f32],
    }
}

pub(crate) fn write_recording(path: &Path, cells: &[Cell], steps: u32, grid: Option<Grid>) {
    let manifest = Manifest {
        format: FORMAT.into(),
        spec: Spec {
            task: "reacher-easy".into(),
            action: ActionSpec { min: vec![-1.0, -1.0], max: vec![1.0, 1.0] },
            observation: vec![
                ObservationPart { name: "position".into(), len: 2 },
                ObservationPart { name: "unseen".into(), len: 1 },
            ],
            qpos: 2,
            qvel: 2,
            pixels: Some(ImageSize { height: SIDE, width: SIDE }),
            materials: vec!["self".into()],
            control_timestep: 0.02,
            action_repeat: 4,
            quantities: Vec::new(),
        },
        options: serde_json::json!({}),
        seed: 0,
        versions: Default::default(),
        grid,
        videos: (0..2).map(|i| Video { name: format!("video-{i}"), set: "val".into(), frames: 12 }).collect(),
        episodes: Vec::new(),
    };
    let writer = RecordingWriter::create_or_resume(path, manifest, false).expect("recording");
    for (index, &cell) in cells.iter().enumerate() {
        let mut episode = EpisodeBuilder::first(index as u32, grid.map(|_| cell), frame(cell, 0));
        for t in 0..steps {
            let action = [noise(cell.state * 7919 + t) * 2.0 - 1.0, noise(cell.state * 104_729 + t) * 2.0 - 1.0];
            episode.step(&action, reward(cell, t), 1.0, frame(cell, t + 1));
        }
        writer
            .write(&episode.finish(false), EpisodeInfo { policy: "random".into(), ..EpisodeInfo::default() })
            .expect("episode");
    }
    writer.finish().expect("recording");
}

pub(crate) fn latents(cells: &[Cell], steps: u32) -> Latents {
    let mut l = Latents { dims: 5, ..Latents::default() };
    l.source = LatentsSource {
        recording: Some("recordings/discs".into()),
        checkpoint: Some("runs/discs/checkpoints/000100".into()),
    };
    for (index, &cell) in cells.iter().enumerate() {
        for step in 0..=steps {
            let (y, x) = angle(cell, step).sin_cos();
            l.episode.push(index as u32);
            l.step.push(step);
            l.state.push(Some(cell.state));
            l.distractor.push(Some(cell.distractor));
            l.reward.push((step < steps).then(|| reward(cell, step)));
            let n = |k: u32| 0.02 * (noise(index as u32 * 100_003 + step * 17 + k) - 0.5);
            l.latent.extend([
                x + n(0),
                y + n(1),
                0.1 * (cell.distractor as f32).sin() + n(2),
                0.3 * step as f32 / steps as f32 + n(3),
                0.7,
            ]);
        }
    }
    l
}

/// A run folder with metrics.
pub(crate) fn write_run(path: &Path, shift: f64) {
    std::fs::create_dir_all(path).expect("run");
    let line = |i: u32| {
        let x = f64::from(i);
        format!(
            "{{\"update\":{},\"objective\":{},\"adversary_minus_dynamics\":{},\"batch_effective_rank\":{}}}\n",
            i * 10,
            -5.0 / (1.0 + x) + shift,
            1.0 / (1.0 + x) + shift,
            1.0 + x / 10.0
        )
    };
    std::fs::write(path.join("metrics.jsonl"), (1..=30).map(line).collect::<String>()).expect("metrics");
    std::fs::write(path.join("run.json"), RUN_JSON).expect("run.json");
}

/// What the trainer writes about a run.
const RUN_JSON: &str = r#"{"format":"vibes-run/1","options":{"objective":"vibes"},"model":{"task":"discs"},"recordings":["../../recordings/discs"],
    "episodes":6,"steps":48,"versions":{}}"#;
