//! The collector's rate card: how fast this machine simulates, draws and writes, and where the time goes.
//!
//! In: tasks and how long to measure. Out: [`PhysicsRate`]s, [`DrawingRate`]s and [`WritingRate`]s, one at a time, so that whoever asks can print
//! them as they come.

mod writing;

use std::time::Instant;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

pub use writing::{FileRate, Limits, WRITING_STAGES, WritingRate, writing_rate};

use crate::Result;
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::{RenderSettings, Speed, SpeedTrial};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, EnvironmentOptions};

/// How fast a task is simulated, on one core.
#[derive(Clone, Debug, Serialize)]
pub struct PhysicsRate {
    /// The task.
    pub task: String,
    /// Physics steps a second.
    pub physics_steps: f64,
    /// Control steps a second, with observation and reward.
    pub control_steps: f64,
}

/// How fast a task is recorded, but for writing.
#[derive(Clone, Debug, Serialize)]
pub struct DrawingRate {
    /// The task.
    pub task: String,
    /// Size and look.
    pub pictures: RenderSettings,
    /// Whether all easy dynamic distractors are on.
    pub distracted: bool,
    /// Control steps per picture.
    pub action_repeat: usize,
    /// Renderers at work at the same time.
    pub threads: usize,
    /// Pictures a second, physics included.
    pub pictures_per_second: f64,
    /// Microseconds per picture on one thread, stage by stage, each waited for: simulating, making the scene, uploading the video frame,
    /// drawing, reading back.
    pub microseconds: [f64; 5],
    /// Microseconds of rendering when no body is in the scene: what a picture costs before anything is in it.
    pub empty_render: f64,
}

/// The names of [`DrawingRate::microseconds`].
pub const STAGES: [&str; 5] = ["physics", "scene", "upload", "render", "read back"];

/// What to draw for a rate.
#[derive(Clone, Copy, Debug)]
pub struct DrawingCase {
    /// Size and look.
    pub pictures: RenderSettings,
    /// All easy dynamic distractors, or none.
    pub distracted: bool,
    /// The task's own when none is given.
    pub action_repeat: Option<usize>,
    /// Pictures per thread.
    pub count: usize,
    /// Renderers at work at the same time.
    pub threads: usize,
}

/// Simulates a task under random actions for about `control_steps` control steps.
///
/// # Errors
/// For an unknown task.
pub fn physics_rate(task: &str, control_steps: usize) -> Result<PhysicsRate> {
    let mut environment =
        Environment::new(task, EnvironmentOptions { action_repeat: Some(1), ..EnvironmentOptions::default() })?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    environment.reset(&mut rng)?;
    let bounds = environment.action_spec();
    let begin = Instant::now();
    for _ in 0..control_steps {
        let action: Vec<f64> =
            bounds.min.iter().zip(&bounds.max).map(|(low, high)| rng.random_range(*low..=*high)).collect();
        environment.step(&action)?;
    }
    let control_steps = control_steps as f64 / begin.elapsed().as_secs_f64();
    Ok(PhysicsRate {
        task: task.to_owned(),
        physics_steps: control_steps * physics_steps(&environment) as f64,
        control_steps,
    })
}

fn physics_steps(environment: &Environment) -> usize {
    (environment.control_timestep() / environment.physics().timestep()).round() as usize
}

/// Draws a task twice: freely for the rate, then, shorter and on one thread, stage by stage.
///
/// # Errors
/// For an unknown task, or a machine that cannot draw.
pub fn drawing_rate(task: &str, case: &DrawingCase, videos: &VideoLibrary) -> Result<DrawingRate> {
    let environment = Environment::new(task, EnvironmentOptions::default())?;
    let trial = SpeedTrial {
        scenery: environment.scenery(),
        model: environment.physics().model(),
        settings: case.pictures,
        distractors: case.distracted.then(DistractorSettings::default),
        videos,
        action_repeat: case.action_repeat.unwrap_or(environment.action_repeat() as usize),
        physics_steps: physics_steps(&environment),
        pictures: case.count,
        threads: case.threads,
        separate_stages: false,
        is_empty: false,
    };
    let speed = trial.run()?;
    let staged = SpeedTrial { separate_stages: true, threads: 1, pictures: case.count.div_ceil(4), ..trial }.run()?;
    let empty =
        SpeedTrial { separate_stages: true, threads: 1, pictures: case.count.div_ceil(4), is_empty: true, ..trial }
            .run()?;
    Ok(DrawingRate {
        task: task.to_owned(),
        pictures: case.pictures,
        distracted: case.distracted,
        action_repeat: trial.action_repeat,
        threads: case.threads,
        pictures_per_second: speed.pictures_per_second(),
        microseconds: microseconds(&staged),
        empty_render: microseconds(&empty)[3],
    })
}

fn microseconds(speed: &Speed) -> [f64; 5] {
    let stages = &speed.stages;
    [stages.physics, stages.scene, stages.upload, stages.render, stages.read_back]
        .map(|time| time.as_secs_f64() * 1e6 / speed.pictures.max(1) as f64)
}

/// The most memory this process has held, bytes; none where the system does not say.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
