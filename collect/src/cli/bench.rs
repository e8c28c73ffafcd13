//! `vibes-collect bench`: the rate card.

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::{Outcome, OutputArgs};
use crate::bench::{DrawingCase, DrawingRate, STAGES, drawing_rate, peak_memory, physics_rate};
use crate::render::{Look, RenderSettings};
use crate::videos::{VideoLibrary, VideoSet, VideoSource};

#[derive(Debug, Args)]
pub(super) struct BenchArgs {
    /// Tasks, as in reacher-easy,cheetah-run [default: all, with swimmer-100].
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    task: Vec<String>,
    /// Sizes of the pictures.
    #[arg(long, value_delimiter = ',', default_value = "64,84", value_name = "LIST")]
    size: Vec<u16>,
    /// Control steps per picture [default: the task's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    action_repeat: Option<u16>,
    /// Pictures per thread for the fast look; the suite's look draws a fifth of them.
    #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(5..=1_000_000))]
    pictures: u32,
    /// Renderers at work at the same time [default: one per core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &BenchArgs, output: OutputArgs) -> Result<Outcome> {
    let all = || crate::task_names().into_iter().map(|name| name.replace("swimmer-N", "swimmer-100")).collect();
    let tasks: Vec<String> = if args.task.is_empty() { all() } else { args.task.clone() };
    let is_table = !output.json && !output.quiet;
    let mut physics = Vec::new();
    for task in &tasks {
        let rate = physics_rate(task, 2000)?;
        if is_table {
            println!(
                "{task:18} physics {:>9.0} steps/s, {:>8.0} control steps/s on one core",
                rate.physics_steps, rate.control_steps
            );
        }
        physics.push(rate);
    }
    let mut drawing = Vec::new();
    for look in [Look::Fast, Look::Suite] {
        for &size in &args.size {
            let size = usize::from(size);
            let source = VideoSource::Procedural;
            let videos = VideoLibrary::open(
                &source,
                VideoSet::Train,
                &source.list(VideoSet::Train, Some(4))?,
                look.sky_side(size),
            )?;
            for task in &tasks {
                for distracted in [false, true] {
                    let rate = drawing_rate(task, &args.case(RenderSettings { size, look }, distracted), &videos)?;
                    if is_table {
                        println!("{}", line(&rate));
                    }
                    drawing.push(rate);
                }
            }
        }
    }
    let peak = peak_memory();
    if output.json {
        println!("{}", json!({ "physics": physics, "drawing": drawing, "stages": STAGES, "peak_memory_bytes": peak }));
    } else if let (true, Some(peak)) = (is_table, peak) {
        println!("peak memory {:.0} MB", peak as f64 / 1e6);
    }
    Ok(Outcome::Done)
}

impl BenchArgs {
    fn case(&self, pictures: RenderSettings, distracted: bool) -> DrawingCase {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let share = if pictures.look == Look::Fast { 1 } else { 5 };
        DrawingCase {
            pictures,
            distracted,
            action_repeat: self.action_repeat.map(usize::from),
            count: self.pictures as usize / share,
            threads: self.threads.map_or(cores, usize::from),
        }
    }
}

fn line(rate: &DrawingRate) -> String {
    let stages: Vec<String> =
        STAGES.iter().zip(rate.microseconds).map(|(name, time)| format!("{name} {time:.0}")).collect();
    let DrawingRate { task, pictures, threads, pictures_per_second, action_repeat, .. } = rate;
    let kind = if rate.distracted { "distracted" } else { "clean" };
    format!(
        "{task:18} {:5} {:3} px {kind:10} repeat {action_repeat} {pictures_per_second:>7.0} pictures/s on {threads} threads; µs on one: {}",
        pictures.look.name(),
        pictures.size,
        stages.join(", ")
    )
}
