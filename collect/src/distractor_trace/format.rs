//! The JSON of `vibes-distractor-trace/1`, checked once and turned into a [`DistractorTrace`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;
use vibes_data::CameraPose;

use super::{DistractorTrace, FORMAT, TraceStep, TracedCamera};
use vibes_env::distractors::camera::{CameraReset, CameraStep};

#[derive(Deserialize)]
struct File {
    format: String,
    task: String,
    difficulty: String,
    dynamic: bool,
    ground_alpha: f32,
    video: String,
    frame_count: usize,
    materials: Vec<String>,
    #[serde(default)]
    model_overrides: serde_json::Value,
    camera_start: Start,
    steps: Vec<Step>,
}

#[derive(Deserialize)]
struct Start {
    h_bounds: (f64, f64),
    v_bounds: (f64, f64),
    r_bounds: (f64, f64),
    roll_bounds: (f64, f64),
    vel_scaling: f64,
}

#[derive(Deserialize)]
struct Step {
    qpos: Vec<f64>,
    camera: Camera,
    color: Color,
    background: Background,
    #[serde(default)]
    frames: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct Camera {
    r: f64,
    h: f64,
    v: f64,
    roll: f64,
    velocity: [f64; 3],
    roll_velocity: f64,
    xpos: [f64; 3],
    xmat: [f64; 9],
    draws: Vec<(String, Numbers)>,
}

#[derive(Deserialize)]
struct Color {
    rgb: Vec<[f64; 3]>,
    draws: Vec<(String, Numbers)>,
}

#[derive(Deserialize)]
struct Background {
    frame: usize,
    direction: i64,
}

/// What one call of the suite's generator returned.
#[derive(Deserialize)]
#[serde(untagged)]
enum Numbers {
    One(f64),
    List(Vec<f64>),
    Table(Vec<Vec<f64>>),
}

type Parsed<T> = Result<T, String>;

/// # Errors
/// The fact that makes the text no trace.
pub(super) fn parse(text: &str) -> Parsed<DistractorTrace> {
    let file: File = serde_json::from_str(text).map_err(|error| error.to_string())?;
    if file.format != FORMAT {
        return Err(format!("format {}", file.format));
    }
    let channels = 3 * file.materials.len();
    let first = file.steps.first().ok_or("no steps")?;
    let camera_draws = numbers(&first.camera.draws);
    let reset = camera_reset(camera_draws.get(..9).ok_or("too few camera draws at the reset")?)?;
    let color_reset = exactly(numbers(&first.color.draws), channels, "colour draws at the reset")?;
    let steps = file.steps.iter().enumerate().map(|(index, step)| {
        parse_step(step, index == 0, channels, file.frame_count).map_err(|fact| format!("step {index}: {fact}"))
    });
    let start = &file.camera_start;
    Ok(DistractorTrace {
        path: PathBuf::new(),
        difficulty: file.difficulty.parse().map_err(|error: vibes_env::Error| error.to_string())?,
        camera_bounds: [start.r_bounds, start.h_bounds, start.v_bounds, start.roll_bounds],
        velocity_scaling: start.vel_scaling,
        camera_reset: reset,
        color_reset,
        steps: steps.collect::<Parsed<_>>()?,
        task: file.task,
        dynamic: file.dynamic,
        ground_alpha: file.ground_alpha,
        video: file.video,
        frame_count: file.frame_count,
        materials: file.materials,
        model_overrides: file.model_overrides,
    })
}

/// h, v, r, roll, direction, speed, roll velocity: the suite's order.
fn camera_reset(draws: &[f64]) -> Parsed<CameraReset> {
    match *draws {
        [h, v, r, roll, x, y, z, speed, roll_velocity] => {
            Ok(CameraReset { h, v, r, roll, direction: [x, y, z], speed, roll_velocity })
        }
        _ => Err(format!("{} camera draws at the reset instead of 9", draws.len())),
    }
}

fn parse_step(step: &Step, is_reset: bool, channels: usize, frame_count: usize) -> Parsed<TraceStep> {
    let mut camera_draws = numbers(&step.camera.draws);
    if is_reset {
        camera_draws.drain(..9);
    }
    let [x, y, z, roll] = camera_draws[..] else {
        return Err(format!("{} camera draws instead of 4", camera_draws.len()));
    };
    let color_draws =
        if is_reset { Vec::new() } else { exactly(numbers(&step.color.draws), channels, "colour draws")? };
    if step.background.frame >= frame_count {
        return Err(format!("frame {} of a video of {frame_count}", step.background.frame));
    }
    let pictures = step.frames.iter().map(|(size, name)| {
        let size = size.parse().map_err(|error| format!("a picture of size {size} ({error})"))?;
        let is_plain = std::path::Path::new(name).file_name().is_some_and(|file| file == name.as_str());
        if is_plain { Ok((size, name.clone())) } else { Err(format!("a picture outside the trace's folder, {name}")) }
    });
    let camera = &step.camera;
    Ok(TraceStep {
        qpos: step.qpos.clone(),
        camera_draws: CameraStep { velocity: [x, y, z], roll },
        color_draws,
        camera: TracedCamera {
            pose: CameraPose { r: camera.r, h: camera.h, v: camera.v, roll: camera.roll },
            velocity: (camera.velocity, camera.roll_velocity),
            position: camera.xpos,
            orientation: camera.xmat,
        },
        rgb: exactly(step.color.rgb.as_flattened().to_vec(), channels, "colour channels")?,
        background: (step.background.frame, step.background.direction > 0),
        pictures: pictures.collect::<Parsed<_>>()?,
    })
}

fn numbers(draws: &[(String, Numbers)]) -> Vec<f64> {
    draws
        .iter()
        .flat_map(|(_, numbers)| match numbers {
            Numbers::One(number) => vec![*number],
            Numbers::List(list) => list.clone(),
            Numbers::Table(rows) => rows.concat(),
        })
        .collect()
}

fn exactly(list: Vec<f64>, length: usize, what: &str) -> Parsed<Vec<f64>> {
    if list.len() == length { Ok(list) } else { Err(format!("{} {what} instead of {length}", list.len())) }
}
