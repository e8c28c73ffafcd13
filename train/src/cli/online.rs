//! `vibes-train online`: train in the environment, from nothing or on from an offline run.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use vibes_command::{Ending, Given, options_of, stop_on_signals};
use vibes_env::distractors::{Axes, Difficulty};
use vibes_env::render::Look;
use vibes_env::videos::VideoSource;
use vibes_train::TrainError;
use vibes_train::fit::{End, Go};
use vibes_train::learners::behaviour::{BehaviourOptions, Gradient};
use vibes_train::online::model_free::folder::Folder;
use vibes_train::online::options::{OnlineOptions, WorldOptions};
use vibes_train::online::prepare::{self, Prepared};
use vibes_train::online::protocol::Protocol;
use vibes_train::online::{Setup, online};
use vibes_train::options::Options;
use vibes_train::run::Run;

use super::Context;
use super::device::DeviceArgs;
use super::flags::OptionArgs;
use super::model_free::{self, ModelFreeArgs};
use super::online_progress::OnlineProgress;

/// Where to begin.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct From {
    /// A run to go on from: an offline run, whose recordings stay part of every batch, or an online run.
    #[arg(value_name = "RUN")]
    run: Option<PathBuf>,
    /// Begin from nothing, in this task.
    #[arg(long)]
    task: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct OnlineArgs {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    from: From,
    /// The run folder [default: RUN-online, or runs/TASK-online-OBJECTIVE].
    #[arg(short, long, value_name = "RUN")]
    output: Option<PathBuf>,
    /// Settings that numbers are published under: dcs-easy-dynamic-500k. Other settings are refused.
    #[arg(long)]
    protocol: Option<Protocol>,
    #[command(flatten)]
    work: WorkArgs,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    behaviour: BehaviourArgs,
    #[command(flatten)]
    model_free: ModelFreeArgs,
    #[command(flatten)]
    options: OptionArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// How much is lived through and learned.
#[derive(Debug, Args)]
#[command(next_help_heading = "Work")]
struct WorkArgs {
    /// Control steps to act for in all, every step of an action repeat counted [default: 500000].
    #[arg(long, value_name = "N")]
    control_steps: Option<u64>,
    /// Replayed rows that the world model learns from for every agent step: the one number that sets how much is computed [default: 128].
    #[arg(long, value_name = "X")]
    rows_per_step: Option<f64>,
    /// Random episodes at the beginning [default: 5, or 0 with recordings].
    #[arg(long, value_name = "N")]
    prefill: Option<u32>,
    /// Share of every batch from the recordings of RUN [default: 0.5].
    #[arg(long, value_name = "X")]
    given_share: Option<f64>,
    /// Updates before the first episode with the actor [default: 200, or 1000 with recordings].
    #[arg(long, value_name = "N")]
    first_updates: Option<u64>,
    /// Updates at the beginning in which the critic learns and the actor does not move [default: 0, or 500 with recordings].
    #[arg(long, value_name = "N")]
    critic_first: Option<u64>,
    /// Imagined steps of the first updates [default: --horizon].
    #[arg(long, value_name = "N", requires = "short_for")]
    short_horizon: Option<usize>,
    /// Updates that imagine --short-horizon steps.
    #[arg(long, value_name = "N", requires = "short_horizon")]
    short_for: Option<u64>,
    /// Standard deviation of noise on executed actions, in units of −1..1 [default: 0.3].
    #[arg(long, value_name = "X")]
    exploration: Option<f64>,
    /// Control steps between evaluations [default: 10000].
    #[arg(long, value_name = "N")]
    evaluate_every: Option<u64>,
    /// Episodes of an evaluation, on held-out and on training videos each [default: 5].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    evaluation_episodes: Option<u32>,
    /// Episodes of the last evaluation [default: 20].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    final_episodes: Option<u32>,
    /// Evaluate samples of the actor rather than its mode.
    #[arg(long)]
    evaluate_samples: bool,
}

/// The world.
#[derive(Debug, Args)]
#[command(next_help_heading = "World")]
struct WorldArgs {
    /// Which distractors: background, camera, color, or all, or none [default: all].
    #[arg(long, value_name = "LIST")]
    distract: Option<Axes>,
    /// How far the distractors go: easy, medium or hard [default: easy].
    #[arg(long)]
    difficulty: Option<Difficulty>,
    /// Distractors keep what they are at the start of the episode.
    #[arg(long = "static")]
    r#static: bool,
    /// Background videos, DIR/VIDEO/FRAME.jpg as in DAVIS [default: the built-in procedural videos].
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// Number of videos [default: the suite's for the difficulty].
    #[arg(long, value_name = "N")]
    video_count: Option<usize>,
    /// Side of the pictures, pixels [default: 64].
    #[arg(long, conflicts_with = "no_pixels", value_parser = clap::value_parser!(u32).range(10..=512))]
    size: Option<u32>,
    /// Act on vector observations; nothing is drawn.
    #[arg(long)]
    no_pixels: bool,
    /// The look of the pictures: fast, or suite, which agrees with the Distracting Control Suite pixel by pixel [default: fast].
    #[arg(long, conflicts_with = "no_pixels")]
    render: Option<Look>,
    /// Control steps an action is held [default: the task's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    action_repeat: Option<u32>,
    /// Agent steps of an episode [default: 1000 control steps].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    steps: Option<u32>,
}

/// Actor and critic.
#[derive(Debug, Args)]
#[command(next_help_heading = "Actor and critic")]
struct BehaviourArgs {
    /// Values that the options below begin with: gaussian (tanh-normal actor, squared error), dreamer-v3 (bounded normal, two-hot critic) or mixed (bounded normal, squared
    /// error) [default: mixed].
    #[arg(long)]
    recipe: Option<String>,
    /// How the actor learns: dynamics or reinforce.
    #[arg(long, value_parser = parse_gradient)]
    gradient: Option<Gradient>,
    /// Imagined steps.
    #[arg(long, value_name = "N")]
    horizon: Option<usize>,
    /// Discount of an agent step.
    #[arg(long, value_name = "X")]
    discount: Option<f64>,
    /// Share of the longer return in a λ-return.
    #[arg(long, value_name = "X")]
    lambda: Option<f64>,
    /// Weight of the actor's entropy.
    #[arg(long, value_name = "X")]
    entropy: Option<f64>,
    /// Step size of the actor.
    #[arg(long, value_name = "X")]
    actor_lr: Option<f64>,
    /// Step size of the critic.
    #[arg(long, value_name = "X")]
    critic_lr: Option<f64>,
    /// Imagination starts from every Nth row of a window.
    #[arg(long, value_name = "N")]
    every_start: Option<usize>,
    /// Take from imagined rewards so many standard deviations over a few small reward heads, each of which learns from half the episodes: against an actor that goes where
    /// the reward model is too high because it has seen little there [default: 0, no guard].
    #[arg(long, value_name = "X")]
    guard: Option<f64>,
    /// Reward heads of the guard [default: 5].
    #[arg(long, value_name = "N")]
    guard_members: Option<usize>,
}

fn parse_gradient(text: &str) -> std::result::Result<Gradient, String> {
    match text {
        "dynamics" => Ok(Gradient::Dynamics),
        "reinforce" => Ok(Gradient::Reinforce),
        _ => Err("the gradients are dynamics and reinforce".to_owned()),
    }
}

/// Puts what was typed in the place of what was there.
fn put<T>(place: &mut T, typed: Option<T>) {
    if let Some(typed) = typed {
        *place = typed;
    }
}

impl OnlineArgs {
    fn lay_over(&self, options: &mut OnlineOptions) -> Result<()> {
        self.behaviour.lay_over(&mut options.behaviour)?;
        self.world.lay_over(options);
        self.work.lay_over(options);
        if let Some(protocol) = self.protocol {
            // What was typed is kept, so that the check can refuse it.
            options.settle(protocol);
            self.world.lay_over(options);
            self.work.lay_over(options);
        }
        Ok(())
    }

    /// That nothing was given that does not concern how this run begins.
    fn check_beginning(&self, beginning: Beginning<'_>) -> Result<()> {
        match beginning {
            Beginning::Nothing => self.refuse(["given_share"], "without recordings (name a RUN that has some)")?,
            Beginning::Offline | Beginning::Again(_) => self.refuse(["preset"], "where a run is gone on from")?,
        }
        match (&self.output, beginning) {
            (Some(output), Beginning::Again(run)) if !is_same(output, run) => {
                self.refuse(["output"], "on an online run that is there: it goes on in its own folder")
            }
            _ => Ok(()),
        }
    }

    /// That none of these options was given.
    fn refuse<'a>(&self, options: impl IntoIterator<Item = &'a str>, why: &str) -> Result<()> {
        match self.given.first_of(options) {
            Some(option) => anyhow::bail!(TrainError::Options(format!("{option} has no effect {why}; leave it out"))),
            None => Ok(()),
        }
    }

    /// That nothing was given that this agent, or a world like this, does not look at.
    fn check_given(&self, is_model_free: bool, options: &OnlineOptions) -> Result<()> {
        let of_other: Vec<String> = if is_model_free {
            let work = [
                "rows_per_step",
                "given_share",
                "first_updates",
                "critic_first",
                "short_horizon",
                "short_for",
                "exploration",
            ];
            let work = work.into_iter().map(str::to_owned);
            let settled = |option: &String| option == "seed" || (option == "preset" && self.system().is_some());
            let model = options_of::<OptionArgs>().into_iter().filter(|option| !settled(option));
            model.chain(options_of::<BehaviourArgs>()).chain(work).collect()
        } else {
            options_of::<ModelFreeArgs>().into_iter().filter(|option| option != "agent").collect()
        };
        let agent = if is_model_free { "without a world model" } else { "with a world model (--agent dreamer)" };
        let axes = options.world.distractors.axes;
        let background: &[&str] = if axes.background { &[] } else { &["videos", "video_count"] };
        let any: &[&str] = if axes == Axes::NONE { &["difficulty", "static"] } else { &[] };
        self.refuse(of_other.iter().map(String::as_str), &format!("for an agent {agent}"))?;
        let unguarded: &[&str] = if options.behaviour.guard > 0.0 { &[] } else { &["guard_members"] };
        self.refuse(unguarded.iter().copied(), "without a guard (--guard)")?;
        self.refuse([background, any].concat(), "without such distractors (--distract)")
    }

    /// The system without a world model that `--preset` names, if it names one.
    fn system(&self) -> Option<&str> {
        let name = self.options.preset();
        let is_typed = self.given.first_of(["preset"]).is_some();
        (is_typed && ModelFreeArgs::is_system(name)).then_some(name)
    }

    /// The run without a world model that is asked for, if one is: by its agent, or by being the run to go on with.
    fn model_free(&self) -> Result<Option<Folder>> {
        if let Some(found) = self.from.run.as_deref().map(Folder::open).transpose()?.flatten() {
            let mut options = found.options().clone();
            self.lay_over(&mut options.online)?;
            self.check_given(true, &options.online)?;
            self.check_beginning(Beginning::Again(found.path()))?;
            let settled = options_of::<ModelFreeArgs>();
            let settled = settled.iter().map(String::as_str).chain(["seed"]);
            self.refuse(settled, "on a run that is there")?;
            return Ok(Some(Folder::create_or_open(found.path(), options)?));
        }
        let model_free = self.model_free.named(self.system())?;
        let Some(task) = self.from.task.as_deref().filter(|_| model_free.is_asked()) else {
            if model_free.is_asked() {
                let text = "agents without a world model begin with --task, or go on with a run of theirs";
                anyhow::bail!(TrainError::Options(text.to_owned()));
            }
            return Ok(None);
        };
        let mut world = prepare::default_world(task)?;
        world.size = model_free.picture_size()?.or(world.size);
        let mut options = OnlineOptions { exploration: 0.0, ..prepare::default_options(world, false) };
        self.lay_over(&mut options)?;
        self.check_given(true, &options)?;
        let seed = self.options.seed()?;
        Ok(Some(model_free.prepare(self.output.as_deref(), seed, options)?))
    }

    /// The run and its options: those of the run to go on from, or the defaults; what was typed lies over them.
    fn prepare(&self) -> Result<Prepared> {
        if let Some(task) = &self.from.task {
            self.check_beginning(Beginning::Nothing)?;
            let model = self.options.resolve()?;
            check_same(&model, &Options::preset(self.options.preset())?, false)?;
            let mut options = prepare::default_options(prepare::default_world(task)?, false);
            self.lay_over(&mut options)?;
            self.check_given(false, &options)?;
            let folder = format!("runs/{task}-online-{}", model.objective);
            let output = self.output.clone().unwrap_or_else(|| PathBuf::from(folder));
            return Ok(prepare::from_nothing(&output, &model, options)?);
        }
        let path = self.from.run.as_deref().unwrap_or_else(|| Path::new("."));
        let found = Run::open(path)?;
        let model = self.options.over(&found.info().options)?;
        check_same(&model, &found.info().options, true)?;
        if let Some(mut options) = OnlineOptions::read(path)? {
            self.check_beginning(Beginning::Again(path))?;
            self.lay_over(&mut options)?;
            self.check_given(false, &options)?;
            return Ok(prepare::again(path, &model, options)?);
        }
        self.check_beginning(Beginning::Offline)?;
        let mut options = prepare::default_options(world_of(&found)?, true);
        self.lay_over(&mut options)?;
        self.check_given(false, &options)?;
        let output = self.output.clone().unwrap_or_else(|| beside(path));
        Ok(prepare::from_run(&output, &found, &model, options)?)
    }
}

/// That the options differ from those that they were laid over in nothing that is not looked at. What merely says the same again, as a run's config.toml does, may stand.
fn check_same(asked: &Options, base: &Options, is_gone_on_from: bool) -> Result<()> {
    let online = "online, where control steps count and a line is a round";
    let settled = "where a run is gone on from: it has that settled";
    let changed = [
        ("updates", asked.updates != base.updates, online),
        ("log-every", asked.log_every != base.log_every, online),
        ("calibrate", is_gone_on_from && asked.calibrate != base.calibrate, settled),
        ("reward-scale", is_gone_on_from && asked.reward_scale != base.reward_scale, settled),
        ("reward-floor", is_gone_on_from && asked.reward_floor != base.reward_floor, settled),
    ];
    match changed.into_iter().find(|(_, is_changed, _)| *is_changed) {
        Some((option, _, why)) => {
            anyhow::bail!(TrainError::Options(format!("--{option} has no effect {why}; leave it out")))
        }
        None => Ok(()),
    }
}

/// How a run begins.
#[derive(Clone, Copy)]
enum Beginning<'a> {
    /// From nothing.
    Nothing,
    /// On from an offline run, into a folder of its own.
    Offline,
    /// On with the run that is there.
    Again(&'a Path),
}

/// Whether two paths lead to one folder.
fn is_same(one: &Path, other: &Path) -> bool {
    one == other || one.canonicalize().ok().zip(other.canonicalize().ok()).is_some_and(|(one, other)| one == other)
}

/// The world that an offline run's recordings come from.
fn world_of(run: &Run) -> Result<WorldOptions> {
    let model = &run.info().model;
    let mut world = prepare::default_world(&model.task)?;
    if let Some(first) = run.open_recordings()?.first() {
        world.action_repeat = first.manifest().spec.action_repeat;
        world.steps = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(world.action_repeat);
    }
    world.size = match model.observation {
        vibes_model::ObservationKind::Pixels { height, .. } => Some(height as u32),
        vibes_model::ObservationKind::Vector { .. } => None,
    };
    Ok(world)
}

/// `RUN-online` beside RUN.
fn beside(run: &Path) -> PathBuf {
    let whole = std::path::absolute(run).unwrap_or_else(|_unknown| run.to_owned());
    let name = whole.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned());
    run.with_file_name(format!("{name}-online"))
}

impl WorkArgs {
    fn lay_over(&self, options: &mut OnlineOptions) {
        put(&mut options.control_steps, self.control_steps);
        put(&mut options.rows_per_step, self.rows_per_step);
        put(&mut options.prefill, self.prefill);
        put(&mut options.given_share, self.given_share);
        put(&mut options.first_updates, self.first_updates);
        put(&mut options.critic_first, self.critic_first);
        put(&mut options.short_horizon, self.short_horizon);
        put(&mut options.short_for, self.short_for);
        put(&mut options.exploration, self.exploration);
        put(&mut options.evaluate_every, self.evaluate_every);
        put(&mut options.evaluation_episodes, self.evaluation_episodes);
        put(&mut options.final_episodes, self.final_episodes);
        put(&mut options.evaluate_mode, self.evaluate_samples.then_some(false));
    }
}

impl WorldArgs {
    fn lay_over(&self, options: &mut OnlineOptions) {
        let world = &mut options.world;
        put(&mut world.distractors.axes, self.distract);
        put(&mut world.distractors.difficulty, self.difficulty);
        put(&mut world.distractors.dynamic, self.r#static.then_some(false));
        put(&mut world.videos, self.videos.clone().map(VideoSource::Folder));
        put(&mut world.video_count, self.video_count.map(Some));
        put(&mut world.size, self.size.map(Some));
        put(&mut world.size, self.no_pixels.then_some(None));
        put(&mut world.look, self.render);
        if let Some(repeat) = self.action_repeat {
            world.action_repeat = repeat;
            world.steps = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(repeat);
        }
        put(&mut world.steps, self.steps);
    }
}

impl BehaviourArgs {
    fn lay_over(&self, options: &mut BehaviourOptions) -> Result<()> {
        if let Some(recipe) = &self.recipe {
            *options = BehaviourOptions::recipe(recipe)?;
        }
        put(&mut options.gradient, self.gradient);
        put(&mut options.horizon, self.horizon);
        put(&mut options.discount, self.discount);
        put(&mut options.lambda, self.lambda);
        put(&mut options.entropy, self.entropy);
        put(&mut options.actor_lr, self.actor_lr);
        put(&mut options.critic_lr, self.critic_lr);
        put(&mut options.every_start, self.every_start);
        put(&mut options.guard, self.guard);
        put(&mut options.guard_members, self.guard_members);
        Ok(())
    }
}

pub(crate) fn run(context: &Context, args: &OnlineArgs) -> Result<Ending> {
    if let Some(folder) = args.model_free()? {
        return model_free::run(context, &folder, args.device);
    }
    let prepared = args.prepare()?;
    let device = args.device.open()?;
    let stop = stop_on_signals()?;
    let mut progress = OnlineProgress::new(context, &prepared.options);
    progress.describe(&prepared);
    let Prepared { run, options, given } = &prepared;
    let setup = Setup { run, options, given, device: &device };
    let end = online(&setup, &mut |event| {
        progress.show(&event);
        if stop.load(std::sync::atomic::Ordering::Relaxed) { Go::Stop } else { Go::On }
    })?;
    progress.finish();
    report(context, run, end)?;
    Ok(if end == End::Stopped { Ending::Again } else { Ending::Done })
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
fn report(context: &Context, run: &Run, end: End) -> Result<()> {
    let path = run.path().display();
    let text = std::fs::read_to_string(run.evaluations_path()).unwrap_or_default();
    let last: Option<serde_json::Value> = text.lines().last().and_then(|line| serde_json::from_str(line).ok());
    if context.json {
        let end = format!("{end:?}").to_lowercase();
        let protocol = OnlineOptions::read(run.path())?.and_then(|options| options.protocol);
        println!("{}", serde_json::json!({ "run": run.path(), "end": end, "protocol": protocol, "evaluation": last }));
        return Ok(());
    }
    if context.quiet {
        return Ok(());
    }
    let found = last.as_ref().and_then(|line| line["held_out"]["mean_return"].as_f64());
    let text = found.map_or(String::new(), |mean| format!("; mean return on held-out videos {mean:.1}"));
    match end {
        End::Nothing => {
            println!(
                "{path} has lived through its control steps, or its minutes, already{text}; ask for more with --control-steps N or --minutes M"
            );
        }
        End::Updates => println!("done{text}; next: vibes-collect --policy {path} --grid 10x10"),
        End::Minutes => println!("the minutes are up{text}; ask for more with --minutes M: {path}"),
        End::Stopped => println!("stopped and saved{text}; the same command goes on from there: {path}"),
    }
    Ok(())
}
