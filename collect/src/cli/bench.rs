//! `vibes-collect bench`: the rate card.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use serde_json::json;
use vibes_data::MOST_ACTION_REPEAT;

use super::{Outcome, OutputArgs};
use crate::bench::{
    DrawingCase, DrawingRate, FileRate, Limits, STAGES, WRITING_STAGES, WritingRate, drawing_rate, peak_memory,
    physics_rate, writing_rate,
};
use crate::recorder::cores;
use vibes_env::large_example_tasks;
use vibes_env::render::{Look, RenderSettings};
use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};

#[derive(Debug, Args)]
pub(super) struct BenchArgs {
    #[arg(long, value_delimiter = ',', value_name = "LIST", help = format!("Tasks [default: {}]", large_example_tasks().join(",")))]
    task: Vec<String>,
    /// Sizes of the pictures.
    #[arg(long, value_delimiter = ',', default_value = "64,84", value_name = "LIST")]
    size: Vec<u16>,
    /// Control steps per picture [default: the task's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_ACTION_REPEAT)))]
    action_repeat: Option<u16>,
    /// Pictures per thread for the fast look; the suite's look draws a fifth of them.
    #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(5..=1_000_000))]
    pictures: u32,
    /// Renderers at work at the same time [default: one per core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Folder on the disk to measure; what is written there is removed afterwards [default: a temporary one].
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &BenchArgs, output: OutputArgs) -> Result<Outcome> {
    let all = || large_example_tasks().into_iter().map(str::to_owned).collect();
    let tasks: Vec<String> = if args.task.is_empty() { all() } else { args.task.clone() };
    let is_table = !output.json && !output.quiet;
    // Before anything is measured: whether there is somewhere to write.
    let folder = Scratch::new(&args.folder.clone().unwrap_or_else(std::env::temp_dir))?;
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
    let (writing, limits) = args.writing(&tasks, &folder, is_table)?;
    let peak = peak_memory();
    if output.json {
        println!(
            "{}",
            json!({ "physics": physics, "drawing": drawing, "stages": STAGES, "writing": writing, "writing_stages": WRITING_STAGES,
                "limits": limits, "peak_memory_bytes": peak })
        );
    } else if let (true, Some(peak)) = (is_table, peak) {
        println!("peak memory {:.0} MB", peak as f64 / 1e6);
    }
    Ok(Outcome::Done)
}

impl BenchArgs {
    /// Write rates of the first task at every size, and the machine's limits.
    #[allow(clippy::print_stdout, reason = "the command line's result")]
    fn writing(&self, tasks: &[String], folder: &Scratch, is_table: bool) -> Result<(Vec<WritingRate>, Limits)> {
        let threads = self.threads();
        let mut rates = Vec::new();
        for (&size, task) in self.size.iter().flat_map(|size| tasks.iter().take(1).map(move |task| (size, task))) {
            let pictures = RenderSettings { size: usize::from(size), look: Look::Fast };
            let rate = writing_rate(task, pictures, threads, &folder.0)?;
            if is_table {
                println!("{}", writing_line(&rate));
            }
            rates.push(rate);
        }
        let limits = Limits::measure(&folder.0)?;
        if is_table {
            let [copy, disk] = [limits.memory_copy, limits.disk_write].map(|rate| rate / 1e6);
            println!(
                "limits: memory is copied at {copy:.0} MB/s, plain bytes are written and flushed at {disk:.0} MB/s"
            );
        }
        Ok((rates, limits))
    }

    fn threads(&self) -> usize {
        self.threads.map_or_else(cores, usize::from).min(cores())
    }

    fn case(&self, pictures: RenderSettings, distracted: bool) -> DrawingCase {
        let share = if pictures.look == Look::Fast { 1 } else { 5 };
        DrawingCase {
            pictures,
            distracted,
            action_repeat: self.action_repeat.map(usize::from),
            count: self.pictures as usize / share,
            threads: self.threads(),
        }
    }
}

fn line(rate: &DrawingRate) -> String {
    let stages: Vec<String> =
        STAGES.iter().zip(rate.microseconds).map(|(name, time)| format!("{name} {time:.0}")).collect();
    let DrawingRate { task, pictures, threads, pictures_per_second, action_repeat, .. } = rate;
    let kind = if rate.distracted { "distracted" } else { "clean" };
    format!(
        "{task:18} {:5} {:3} px {kind:10} repeat {action_repeat} {pictures_per_second:>7.0} pictures/s on {threads} threads; µs on one: {} (an empty picture {:.0})",
        pictures.look.name(),
        pictures.size,
        stages.join(", "),
        rate.empty_render
    )
}

fn writing_line(rate: &WritingRate) -> String {
    let stages: Vec<String> =
        WRITING_STAGES.iter().zip(rate.microseconds).map(|(name, time)| format!("{name} {time:.0}")).collect();
    let file = |name: &str, file: FileRate| {
        format!("{name} {:.0} MB/s ({:.1} episodes/s)", file.megabytes_per_second, file.episodes_per_second)
    };
    format!(
        "{:18} {:5} {:3} px recorded with all distractors at {:.0} rows/s on {} threads; {}, {}; µs a row: {}",
        rate.task,
        rate.pictures.look.name(),
        rate.pictures.size,
        rate.recorded_rows_per_second,
        rate.threads,
        file("Arrow", rate.arrow),
        file("MCAP", rate.mcap),
        stages.join(", ")
    )
}

/// A folder that is removed in the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(parent: &Path) -> Result<Self> {
        let folder = parent.join(format!("vibes-collect-bench-{}", std::process::id()));
        std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(Self(folder))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed lies in a folder for temporary files.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
