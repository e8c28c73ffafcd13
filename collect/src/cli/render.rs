//! `vibes-collect render RECORDING -o NEW`: a recording drawn again.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_command::Given;
use vibes_data::Recording;

use super::axis_seeds::AxisSeedArgs;
use super::record::record_with_progress;
use super::{Outcome, OutputArgs, idle, videos};
use crate::recorder::cores;
use crate::redraw::{NewDistractors, Redraw};
use crate::stored::options_of;
use crate::trained::Home;
use vibes_env::distractors::{Axes, Difficulty};
use vibes_env::render::{Look, MAX_SIZE};
use vibes_env::videos::{MOST_VIDEOS, VideoSet};

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    given: Given,
    /// The recording's folder.
    recording: PathBuf,
    /// The new recording's folder.
    #[arg(short, long, value_name = "NEW")]
    output: PathBuf,
    /// Which distractors: background, camera, color, or all, or none [default: those that are stored].
    #[arg(long, value_name = "LIST")]
    distract: Option<Axes>,
    /// How far the distractors go: easy, medium or hard.
    #[arg(long)]
    difficulty: Option<Difficulty>,
    /// Distractors move during an episode.
    #[arg(long, conflicts_with = "static")]
    dynamic: bool,
    /// Distractors keep what they are at the start of the episode.
    #[arg(long = "static")]
    r#static: bool,
    /// Background videos, DIR/VIDEO/FRAME.jpg as in DAVIS, or `procedural` for the built-in ones; of other folders the first half is train, the second val.
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// Which videos: train, or val for held-out ones.
    #[arg(long)]
    video_set: Option<VideoSet>,
    /// Number of videos.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_VIDEOS)))]
    video_count: Option<u16>,
    /// Seed of new distractors; the states stay.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    axis_seeds: AxisSeedArgs,
    /// Side of the pictures, pixels [default: the recording's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=MAX_SIZE as i64))]
    size: Option<u32>,
    /// The look of the pictures: fast, or suite, which agrees with the Distracting Control Suite to half a level of 255 on average [default: the recording's].
    #[arg(long)]
    render: Option<Look>,
    /// Turn every state about the origin: reacher's symmetry.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = parse_degrees)]
    rotate: Option<f64>,
    /// Write no MCAP logs, only Arrow tables [default: as the recording has them].
    #[arg(long)]
    no_mcap: bool,
    /// Worker threads, each with a render context; at most one per core, the default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

fn parse_degrees(text: &str) -> Result<f64, String> {
    let degrees: f64 = text.parse().map_err(|_error| "degrees are a number".to_owned())?;
    if degrees.is_finite() && degrees.abs() <= 360.0 { Ok(degrees) } else { Err("degrees are -360 to 360".to_owned()) }
}

impl RenderArgs {
    fn redraw(&self) -> Redraw {
        Redraw {
            distractors: NewDistractors {
                axes: self.distract,
                difficulty: self.difficulty,
                dynamic: self.dynamic.then_some(true).or(self.r#static.then_some(false)),
                videos: self.videos.as_deref().map(videos::source),
                video_set: self.video_set,
                video_count: self.video_count.map(usize::from),
                seed: self.seed,
                axis_seeds: self.axis_seeds.into(),
            },
            size: self.size,
            look: self.render,
            rotate: self.rotate,
            with_mcap: self.no_mcap.then_some(false),
        }
    }
}

pub(super) fn run(args: &RenderArgs, output: OutputArgs) -> Result<Outcome> {
    idle::check(&args.given, args.distract.unwrap_or(Axes::ALL))?;
    let recording = Recording::open(&args.recording)?;
    // What the recording is drawn under stays unless other axes are asked for.
    let own = || Some(options_of(&recording).ok()?.distractors.axes);
    let axes = args.distract.or_else(own).unwrap_or(Axes::ALL);
    idle::check(&args.given, axes)?;
    idle::check_seed(&args.given, axes)?;
    let run = (args.threads.map_or_else(cores, usize::from), vibes_command::stop_on_signals()?);
    let wanted = recording.episodes().len() as u64;
    let redraw = args.redraw();
    // Nobody acts.
    let home = Home::default();
    record_with_progress(&args.output, (wanted, &home), output, |report| {
        redraw.draw(&recording, &args.output, run, report)
    })
}
