//! `vibes-train online`: train in the environment, from nothing or on from an offline run.

mod args;
mod checks;

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use vibes_command::{Ending, Given, options_of, stop_on_signals};
use vibes_data::Metrics;
use vibes_env::videos::VideoSource;
use vibes_train::TrainError;
use vibes_train::fit::{End, Go};
use vibes_train::online::model_free::folder::Folder;
use vibes_train::online::options::{OnlineOptions, WorldOptions};
use vibes_train::online::prepare::{self, Prepared};
use vibes_train::online::protocol::Protocol;
use vibes_train::online::{Setup, online_under};
use vibes_train::options::Options;
use vibes_train::run::Run;

use self::args::{BehaviourArgs, WorkArgs, WorldArgs};
use self::checks::{Beginning, check_same};
use super::Context;
use super::device::DeviceArgs;
use super::flags::OptionArgs;
use super::model_free::{self, ModelFreeArgs};
use super::online_progress::{OnlineProgress, ended_under, on_videos, protocol_of};
use super::videos::open_videos;

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
    /// The run folder [default: RUN-online, or runs/TASK-online-OBJECTIVE, or runs/TASK-SYSTEM of agents without a world model].
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
            // As many videos as it has, said in words, are no other setting.
            let own = options.world.distractors.difficulty.videos();
            options.world.video_count = options.world.video_count.filter(|count| Some(*count) != own);
        }
        Ok(())
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
            let settled = settled.iter().map(String::as_str).filter(|option| *option != "save_every").chain(["seed"]);
            self.refuse(settled, "on a run that is there")?;
            options.save_every = self.model_free.save_every().unwrap_or(options.save_every);
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
        let online = OnlineOptions::read(path)?;
        let mut before = found.info().options.clone();
        if online.is_none() {
            // The minutes of the offline run are over.
            before.settings.minutes = 0.0;
        }
        let model = self.options.over(&before)?;
        check_same(&model, &before, true)?;
        if let Some(mut options) = online {
            self.check_beginning(Beginning::Again(path))?;
            self.lay_over(&mut options)?;
            self.check_given(false, &options)?;
            return Ok(prepare::again(path, &model, options)?);
        }
        self.check_beginning(Beginning::Offline)?;
        let mut options = prepare::default_options(world_of(&found)?, self.work.takes_recordings());
        self.lay_over(&mut options)?;
        self.check_given(false, &options)?;
        let output = self.output.clone().unwrap_or_else(|| beside(path));
        Ok(prepare::from_run(&output, &found, &model, options)?)
    }
}

/// The world that an offline run's recordings come from.
fn world_of(run: &Run) -> Result<WorldOptions> {
    let model = &run.info().model;
    let mut world = prepare::default_world(&model.task)?;
    // Where the recordings are gone, a --given-share of 0 goes on without them, under the task's own action repeat.
    if let Some(first) = run.open_recordings().ok().as_deref().and_then(|recordings| recordings.first()) {
        let manifest = first.manifest();
        world.action_repeat = manifest.spec.action_repeat;
        world.steps = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(world.action_repeat);
        let recorded = |option: &str| manifest.options.get(option).cloned().unwrap_or_default();
        world.look = serde_json::from_value(recorded("look")).unwrap_or(world.look);
        let videos: Option<VideoSource> = serde_json::from_value(recorded("videos")).ok();
        world.videos = videos.map_or(world.videos, |videos| videos.found(first.path()));
    }
    match model.observation {
        vibes_model::ObservationKind::Pixels { height, .. } => world.size = Some(height as u32),
        vibes_model::ObservationKind::Vector { .. } => world.draw_nothing(),
    }
    Ok(world)
}

/// `RUN-online` beside RUN.
fn beside(run: &Path) -> PathBuf {
    // A path such as `.` has no name of its own.
    let named = if run.file_name().is_some() { Ok(run.to_owned()) } else { run.canonicalize() };
    let run = named.unwrap_or_else(|_unknown| run.to_owned());
    let name = run.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned());
    run.with_file_name(format!("{name}-online"))
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
    let videos = open_videos(context, &options.world, stop)?;
    let setup = Setup { run, options, given, device: &device };
    let end = online_under(videos, &setup, &mut |event| {
        progress.show(&event);
        if stop.load(std::sync::atomic::Ordering::Relaxed) { Go::Stop } else { Go::On }
    })?;
    progress.finish();
    report(context, run, options, end)?;
    Ok(if end == End::Stopped { Ending::Again } else { Ending::Done })
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
fn report(context: &Context, run: &Run, options: &OnlineOptions, end: End) -> Result<()> {
    let path = run.path().display();
    let last = Metrics::read(&run.evaluations_path())?.lines.pop().map(serde_json::Value::Object);
    if context.json {
        let end = format!("{end:?}").to_lowercase();
        let protocol = protocol_of(last.as_ref());
        println!("{}", serde_json::json!({ "run": run.path(), "end": end, "protocol": protocol, "evaluation": last }));
        return Ok(());
    }
    if context.quiet {
        return Ok(());
    }
    let found = last.as_ref().and_then(|line| line["held_out"]["mean_return"].as_f64());
    let set = if options.world.has_videos() { " --video-set val" } else { "" };
    let on = last.as_ref().map_or("", on_videos);
    let text = found.map_or(String::new(), |mean| format!("; mean return{on} {mean:.1}"));
    let under = ended_under(options, last.as_ref());
    let text = under.clone() + &text;
    match end {
        End::Nothing => {
            println!(
                "{path} has lived through its control steps, or its minutes, already{text}; ask for more with --control-steps N or --minutes M, or evaluate it anew: vibes-collect --policy {path} --episodes N{set}"
            );
        }
        End::Updates => println!("done{text}; next: vibes-collect --policy {path} --grid 10x10"),
        End::Minutes => println!("the minutes are up{text}; ask for more with --minutes M: {path}"),
        End::Stopped if run.checkpoints().is_empty() => {
            println!("stopped before anything was learned{under}; the same command begins anew: {path}");
        }
        End::Stopped => {
            let lived = Metrics::read(&run.metrics_path())?.last("control_steps").unwrap_or(0.0);
            let after = last.as_ref().and_then(|line| line["control_steps"].as_u64());
            let judged = after.zip(found).map_or(String::new(), |(after, mean)| {
                format!("; mean return{on} {mean:.1} when it was last evaluated, after {after} control steps")
            });
            println!(
                "stopped and saved after {lived:.0} control steps{under}{judged}; the same command goes on from there: {path}"
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_online_run_lies_beside_the_run_it_goes_on_from() {
        assert_eq!(beside(Path::new("runs/reacher")), Path::new("runs/reacher-online"));
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().canonicalize().unwrap();
        let inside = whole.join("reacher");
        std::fs::create_dir_all(inside.join("checkpoints")).unwrap();
        assert_eq!(
            beside(&inside.join("checkpoints/..")),
            whole.join("reacher-online"),
            "a path without a name of its own"
        );
    }
}
