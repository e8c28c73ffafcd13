//! `vibes-collect [OPTIONS]`: records.

mod said;
mod unrecorded;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Result;
use clap::Args;
use vibes_command::{Given, stop_on_signals};
use vibes_data::{Grid, MOST_ACTION_REPEAT, MOST_EPISODES, MOST_STEPS, Recording};

use super::axis_seeds::AxisSeedArgs;
use super::{Outcome, OutputArgs, idle, show, videos};
use crate::cut::cut_actions;
use crate::plan::RecordOptions;
use crate::played::played_by;
use crate::recorder::{PolicyMaker, Progress, RecordRun, Source, cores, record};
use crate::trained::{Home, acted_by, as_named, home};
use said::Said;
pub(super) use said::source_name;
use vibes_env::distractors::{Axes, Difficulty, DistractorSettings};
use vibes_env::render::{Look, MAX_SIZE};
use vibes_env::videos::{MOST_VIDEOS, VideoSet, VideoSource};
use vibes_env::{Environment, EnvironmentOptions, PolicyMix, PolicySpec};

/// The task when none is named.
const DEFAULT_TASK: &str = "reacher-easy";

/// Episodes when neither a grid nor a number is asked for.
const DEFAULT_EPISODES: u32 = 10;
/// Side of the pictures, pixels, where nothing else is asked for.
const DEFAULT_SIZE: u32 = 64;

#[derive(Debug, Args)]
pub(super) struct RecordArgs {
    #[command(flatten)]
    given: Given,
    #[arg(long, help = format!("Task: {} [default: that of a trained run, or reacher-easy]", vibes_env::task_help()))]
    task: Option<String>,
    /// A grid: every state trajectory under every distractor trajectory, as in 10x10.
    #[arg(long, value_parser = parse_grid, conflicts_with = "episodes")]
    grid: Option<Grid>,
    /// Independent episodes, each with its own distractors [default: 10].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EPISODES)))]
    episodes: Option<u32>,
    /// Behaviour: random, random:hold=STEPS, planner, planner:noise=SIGMA, actions:FILE, or the folder of a trained run.
    #[arg(long, default_value = "random", conflicts_with = "mix")]
    policy: PolicySpec,
    /// Several behaviours with weights, as in random:0.3,planner:noise=0.3:0.4,planner:0.3.
    #[arg(long)]
    mix: Option<PolicyMix>,
    /// How far the distractors go: easy, medium or hard [default: that of a trained run, or easy].
    #[arg(long)]
    difficulty: Option<Difficulty>,
    /// Distractors move during an episode (the default, but for a run that was trained under others).
    #[arg(long, conflicts_with = "static")]
    dynamic: bool,
    /// Distractors keep what they are at the start of the episode.
    #[arg(long = "static")]
    r#static: bool,
    /// Which distractors: background, camera, color, or all, or none [default: those of a trained run, or all].
    #[arg(long, value_name = "LIST")]
    distract: Option<Axes>,
    /// Background videos, DIR/VIDEO/FRAME.jpg as in DAVIS, or `procedural` for the built-in ones; of other folders the first half is train, the second val [default: those of a trained run, or the built-in
    /// procedural videos].
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// Which videos: train, or val for held-out ones.
    #[arg(long, default_value = "train")]
    video_set: VideoSet,
    /// Number of videos [default: that of a trained run, or the suite's for the difficulty: 4, 8 or all].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_VIDEOS)))]
    video_count: Option<u16>,
    /// Side of the pictures, pixels [default: that of a trained run, or 64].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MAX_SIZE as i64))]
    size: Option<u32>,
    /// Record no pictures, only states and vector observations.
    #[arg(long, conflicts_with_all = ["size", "render"])]
    no_pixels: bool,
    /// The look of the pictures: fast, or suite, which agrees with the Distracting Control Suite to half a level of 255 on average [default: that of a trained run, or fast].
    #[arg(long)]
    render: Option<Look>,
    /// Control steps per agent step [default: those of a trained run, or the task's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_ACTION_REPEAT)))]
    action_repeat: Option<u32>,
    /// Agent steps per episode [default: 1000 control steps].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_STEPS)))]
    steps: Option<u32>,
    /// One torque per joint for the swimmer, instead of its four-parameter wave.
    #[arg(long)]
    raw_torques: bool,
    /// The seed that everything random follows from.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    axis_seeds: AxisSeedArgs,
    /// Write no MCAP logs, only Arrow tables.
    #[arg(long)]
    no_mcap: bool,
    /// Evaluate only: act, say what was earned, and leave no recording.
    #[arg(long)]
    no_record: bool,
    /// Worker threads, each with a render context; at most one per core, the default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// The recording's folder [default: recordings/TASK-NxM or recordings/TASK-N, by a trained run TASK-RUN in the place of TASK, or RUN alone where that begins with the task's
    /// name].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// `10x10`, with x, X or ×.
pub(super) fn parse_grid(text: &str) -> std::result::Result<Grid, String> {
    let parts: Vec<&str> = text.split(['x', 'X', '×']).collect();
    let count = |part: &str| part.trim().parse::<u32>().ok().filter(|count| (1..=10_000).contains(count));
    match parts.as_slice() {
        [states, distractors] => match (count(states), count(distractors)) {
            (Some(states), Some(distractors)) if states * distractors <= MOST_EPISODES => {
                Ok(Grid { states, distractors })
            }
            _ => Err("a grid has 1 to 10000 rows and columns, and fewer than a million cells".into()),
        },
        _ => Err("a grid is states x distractors, as in 10x10".into()),
    }
}

impl RecordArgs {
    fn resolve(&self, home: &Home) -> Result<RecordOptions> {
        let (distractors, videos, video_count) = self.distraction(home);
        let task = self.task.clone().or(home.task.clone()).unwrap_or_else(|| DEFAULT_TASK.to_owned());
        let action_repeat = self.action_repeat.or(home.action_repeat);
        let options = EnvironmentOptions { action_repeat, raw_torques: self.raw_torques };
        let environment = Environment::new(&task, options)?;
        if self.raw_torques && !Environment::new(&task, EnvironmentOptions::default())?.acts_by_waves() {
            return Err(idle::option("--raw-torques", &format!("{task} always takes torques"), "leave it out").into());
        }
        let mix = self.mix.clone().unwrap_or_else(|| PolicyMix::of(self.policy.clone()));
        let episodes =
            self.grid.map_or(self.episodes.unwrap_or(DEFAULT_EPISODES), |grid| grid.states * grid.distractors);
        let mut options = RecordOptions {
            task: task.clone(),
            policy: mix.to_string(),
            grid: self.grid,
            episodes,
            steps: self.steps.unwrap_or(environment.episode_steps()),
            action_repeat: environment.action_repeat(),
            raw_torques: self.raw_torques,
            distractors,
            videos,
            video_set: self.video_set,
            video_count,
            size: (!self.no_pixels && !self.no_record).then_some(self.size.or(home.size).unwrap_or(DEFAULT_SIZE)),
            look: self.render.unwrap_or(if self.no_pixels { Look::default() } else { home.look }),
            axis_seeds: self.axis_seeds.into(),
            acting: mix
                .shares()
                .iter()
                .filter_map(|(policy, _)| match policy {
                    PolicySpec::Run { path } => Some(acted_by(path, &task)),
                    _ => None,
                })
                .collect::<crate::Result<_>>()?,
            actions: played_by(&mix),
            protocol: None,
            rotated: None,
            redrawn: false,
        };
        options.protocol = options.protocol_of(home);
        Ok(options)
    }

    /// What the run that acts was trained in; the first of a mix, of which none is evaluated under its protocol, or told what it began with.
    ///
    /// # Errors
    /// The runs of a mix hold an action for different numbers of control steps, and none was typed.
    fn home(&self) -> Result<Home> {
        let Some(mix) = &self.mix else {
            return Ok(match &self.policy {
                PolicySpec::Run { path } => home(path),
                _ => Home::default(),
            });
        };
        let homes = mix.shares().iter().filter_map(|(policy, _)| match policy {
            PolicySpec::Run { path } => Some(home(path)),
            _ => None,
        });
        let mut homes: Vec<Home> = homes.collect();
        for home in &mut homes {
            (home.protocol, home.given_control_steps, home.given_from) = (None, None, None);
        }
        let repeats: BTreeSet<u32> = homes.iter().filter_map(|home| home.action_repeat).collect();
        if repeats.len() > 1 && self.action_repeat.is_none() {
            let repeats: Vec<String> = repeats.iter().map(u32::to_string).collect();
            anyhow::bail!(
                "the runs of --mix hold an action for {} control steps; say for how many with --action-repeat",
                repeats.join(" and ")
            );
        }
        Ok(homes.into_iter().next().unwrap_or_default())
    }

    /// The distractors, where their videos come from, and how many: what was typed, else those that the run which acts was trained under.
    fn distraction(&self, home: &Home) -> (DistractorSettings, VideoSource, Option<usize>) {
        let of_run = home.distractors.unwrap_or_default();
        let distractors = DistractorSettings {
            axes: self.distract.unwrap_or(of_run.axes),
            difficulty: self.difficulty.unwrap_or(of_run.difficulty),
            dynamic: self.dynamic || (of_run.dynamic && !self.r#static),
        };
        let videos = self.videos.as_deref().map(videos::source).or_else(|| home.videos.clone()).unwrap_or_default();
        // A number is of one folder and one difficulty.
        let is_home = self.videos.is_none() && self.difficulty.is_none();
        let video_count = self.video_count.map(usize::from).or(home.video_count.filter(|_| is_home));
        (distractors, videos, video_count)
    }

    fn folder(&self, options: &RecordOptions) -> PathBuf {
        let run = options.acting.first().filter(|_| self.mix.is_none()).map(|acting| acting.run.as_str());
        self.output.clone().unwrap_or_else(|| PathBuf::from("recordings").join(folder_name(options, run)))
    }

    /// Where numbers come from that nobody typed.
    fn place(&self) -> &Path {
        match &self.policy {
            PolicySpec::Run { path } => path.as_path(),
            _ => Path::new("."),
        }
    }
}

/// The name of a recording's folder, so that recordings of two tasks, of two sizes, or by two trained runs, are apart.
fn folder_name(options: &RecordOptions, run: Option<&str>) -> String {
    let task = &options.task;
    let what = match run.filter(|run| !run.is_empty()) {
        None => task.clone(),
        Some(run) if run.strip_prefix(task.as_str()).is_some_and(|rest| rest.starts_with('-')) => run.to_owned(),
        Some(run) => format!("{task}-{run}"),
    };
    match options.grid {
        Some(Grid { states, distractors }) => format!("{what}-{states}x{distractors}"),
        None => format!("{what}-{}", options.episodes),
    }
}

pub(super) fn run(args: RecordArgs, output: OutputArgs) -> Result<Outcome> {
    if args.no_record {
        idle::check_unrecorded(&args.given)?;
    }
    let home = args.home()?;
    let options = args.resolve(&home)?;
    let is_seen = options.pictures().is_some() || options.acting.iter().any(|acting| acting.pictures.is_some());
    if args.no_record && !is_seen {
        idle::check_unseen_by_anyone(&args.given)?;
    }
    idle::check(&args.given, options.distractors.axes)?;
    if !is_seen {
        idle::check_unseen(&args.given)?;
    }
    if !output.quiet {
        say_cut(&options)?;
    }
    let stop = stop_on_signals()?;
    let threads = args.threads.map_or_else(cores, usize::from);
    let policies = as_named(&options.acting);
    let run = RecordRun {
        options: &options,
        seed: args.seed,
        threads,
        with_mcap: !args.no_mcap,
        source: Source::Simulation,
        turn: 0.0,
        policies: PolicyMaker(&policies),
        stop,
    };
    if args.no_record {
        return unrecorded::evaluate(&run, args.place(), &home, output);
    }
    let folder = args.folder(&options);
    record_with_progress(&folder, (u64::from(options.episodes), &home), output, |report| record(&folder, &run, report))
}

/// Says what the task's bounds cut of files of actions.
#[allow(clippy::print_stderr, reason = "what the command line warns of")]
fn say_cut(options: &RecordOptions) -> Result<()> {
    let mix = options.mix()?;
    if mix.shares().iter().any(|(policy, _)| matches!(policy, PolicySpec::Actions { .. })) {
        let environment = options.environment()?;
        let cut = mix.shares().iter().filter_map(|(policy, _)| cut_actions(policy, options.steps, &environment));
        cut.for_each(|cut| eprintln!("{cut}"));
    }
    Ok(())
}

/// Records with a progress bar, and says what came of it: how many of the `wanted` episodes there are, and what the run began with that acts, if one does.
#[allow(clippy::print_stdout, clippy::print_stderr, reason = "the command line says what it did")]
pub(super) fn record_with_progress(
    folder: &Path,
    (wanted, home): (u64, &Home),
    output: OutputArgs,
    record: impl FnOnce(&(dyn Fn(Progress) + Sync)) -> crate::Result<Recording>,
) -> Result<Outcome> {
    let meter = show::Meter::new(wanted, output.quiet || output.json);
    let (rows, finished) = (AtomicU64::new(0), AtomicU64::new(0));
    let recording = record(&|progress: Progress| {
        rows.fetch_max(progress.rows, Ordering::Relaxed);
        finished.fetch_max(progress.episodes, Ordering::Relaxed);
        meter.tell(progress);
    });
    meter.finish();
    let finished = finished.into_inner();
    let recording = match recording {
        Err(error) if finished > 0 => {
            let kept = format!("stopped; the {finished} finished episodes are kept, and the same command goes on");
            return Err(anyhow::Error::from(error).context(kept));
        }
        recording => recording?,
    };
    let episodes = recording.episodes().len();
    let said = Said::of(&recording, folder, (wanted, home), meter.seconds());
    if output.json {
        println!("{}", serde_json::to_string(&said)?);
    } else if !output.quiet {
        if rows.into_inner() == 0 && episodes > 0 && episodes as u64 >= wanted {
            println!("all {episodes} episodes are there already and used again");
        }
        println!("{}", said.in_words(&recording));
        let without = recording.episodes().iter().filter(|entry| entry.mcap.is_none()).count();
        if (1..episodes).contains(&without) {
            println!("{without} of {episodes} episodes have no log; the same command without --no-mcap writes them");
        }
    }
    if (episodes as u64) < wanted {
        eprintln!("stopped after {episodes} of {wanted} episodes; the same command goes on: {}", folder.display());
        return Ok(Outcome::Again);
    }
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_read_and_malformed_ones_refused() {
        assert_eq!(parse_grid("10x3"), Ok(Grid { states: 10, distractors: 3 }));
        assert_eq!(parse_grid("2×2"), Ok(Grid { states: 2, distractors: 2 }));
        for text in ["", "10", "x10", "0x3", "3x-1", "2x2x2", "10000x10000", "axb"] {
            assert!(parse_grid(text).is_err(), "{text}");
        }
    }
}
