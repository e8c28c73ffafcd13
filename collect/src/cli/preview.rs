//! `vibes-collect preview`: one contact sheet per task and difficulty.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use super::{Outcome, OutputArgs, videos};
use crate::preview::{ContactSheet, PreviewOptions};
use vibes_env::distractors::{Difficulty, DistractorSettings};
use vibes_env::example_tasks;
use vibes_env::render::{Look, RenderSettings};
use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};

#[derive(Debug, Args)]
pub(super) struct PreviewArgs {
    #[arg(long, value_delimiter = ',', value_name = "LIST", help = format!("Tasks [default: {}]", example_tasks().join(",")))]
    task: Vec<String>,
    /// Difficulties [default: all].
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    difficulty: Vec<Difficulty>,
    /// Distractors keep what they are at the start of the episode.
    #[arg(long = "static")]
    r#static: bool,
    /// Background videos, DIR/VIDEO/FRAME.jpg as in DAVIS, or `procedural` for the built-in ones; of a set as many as the difficulty uses, or all where there are fewer [default: the built-in procedural videos].
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// Which videos: train, or val for held-out ones.
    #[arg(long, default_value = "train")]
    video_set: VideoSet,
    /// Side of each picture, pixels.
    #[arg(long, default_value_t = 128, value_parser = clap::value_parser!(u16).range(1..=1024))]
    size: u16,
    /// The look of the pictures: fast, or suite, which agrees with the Distracting Control Suite to half a level of 255 on average.
    #[arg(long, default_value = "fast")]
    render: Look,
    /// Seed of the episode and of the distractors.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for the sheets.
    #[arg(short, long, default_value = "figures")]
    output: PathBuf,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &PreviewArgs, output: OutputArgs) -> Result<Outcome> {
    let all = || example_tasks().into_iter().map(str::to_owned).collect();
    let tasks: Vec<String> = if args.task.is_empty() { all() } else { args.task.clone() };
    let difficulties = if args.difficulty.is_empty() { Difficulty::ALL.to_vec() } else { args.difficulty.clone() };
    let pictures = RenderSettings { size: usize::from(args.size), look: args.render };
    let source = args.videos.as_deref().map_or(VideoSource::Procedural, videos::source);
    for task in &tasks {
        // Before there is a folder, which comes with the first sheet.
        vibes_env::Environment::new(task, vibes_env::EnvironmentOptions::default())?;
    }
    let list = |difficulty| names(&source, args.video_set, difficulty).map(|names| (difficulty, names));
    let listed = difficulties.into_iter().map(list).collect::<Result<Vec<_>>>()?;
    let mut sheets = Vec::new();
    for (difficulty, names) in listed {
        let videos = VideoLibrary::open(&source, args.video_set, &names, args.render.sky_side(pictures.size))?;
        let distractors = DistractorSettings { difficulty, dynamic: !args.r#static, ..DistractorSettings::default() };
        for task in &tasks {
            let path = args.output.join(format!("preview-{task}-{difficulty}.png"));
            let sheet = ContactSheet::draw(task, &PreviewOptions { distractors, pictures, seed: args.seed }, &videos)?;
            std::fs::create_dir_all(&args.output).with_context(|| format!("cannot make {}", args.output.display()))?;
            sheet.write(&path)?;
            if !output.quiet && !output.json {
                println!("{}", path.display());
            }
            sheets.push(path);
        }
    }
    if output.json {
        println!("{}", serde_json::json!({ "sheets": sheets }));
    }
    Ok(Outcome::Done)
}

/// The first videos of a set, as many as the difficulty uses; all of a folder that holds fewer, since a sheet shows what there is.
fn names(source: &VideoSource, set: VideoSet, difficulty: Difficulty) -> Result<Vec<String>> {
    let mut names = source.list(set, None)?;
    names.truncate(difficulty.videos().unwrap_or(names.len()));
    Ok(names)
}
