//! `vibes-train bench`: how long an update takes, by part.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_command::{Given, options_of};
use vibes_data::Recording;
use vibes_train::TrainError;
use vibes_train::bench::{Sizes, bench, bench_agent, bench_online};
use vibes_train::learners::model_free::AgentOptions;
use vibes_train::learners::sac::options::Size;
use vibes_train::online::prepare::{default_options, default_world};
use vibes_train::options::Options;

use super::Context;
use super::device::DeviceArgs;
use super::flags::{OptionArgs, refuse};

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    #[command(flatten)]
    given: Given,
    /// Time an agent without a world model instead, by its system's name, at the size `small`; every update steps the actor.
    #[arg(long, value_name = "SYSTEM", conflicts_with_all = ["recording", "online", "recipe"])]
    pub(crate) system: Option<String>,
    /// Width of that agent's perceptrons [default: the system's].
    #[arg(long, value_name = "N", requires = "system")]
    system_hidden: Option<usize>,
    /// A recording to measure window sampling on.
    recording: Option<PathBuf>,
    /// Height and width of the pictures.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u16).range(10..=2048))]
    size: u16,
    /// Values of an action.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=1000))]
    actions: u16,
    /// Updates to time; the median counts.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Measure online training too: the whole update with actor and critic, and an episode of this task.
    #[arg(long, value_name = "TASK", num_args = 0..=1, default_missing_value = "cartpole-swingup", conflicts_with = "recording")]
    online: Option<String>,
    /// With the terms that the preset's recipe adds to the paper's objective.
    #[arg(long)]
    recipe: bool,
    #[command(flatten)]
    options: OptionArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl BenchArgs {
    fn sizes(&self) -> Sizes {
        Sizes {
            picture: usize::from(self.size),
            actions: usize::from(self.actions),
            repeats: usize::from(self.repeats),
        }
    }

    /// That nothing was given that is not looked at: of an agent without a world model those of a model, of online training what its task says.
    fn check_given(&self) -> Result<()> {
        let model = if self.system.is_some() { options_of::<OptionArgs>() } else { Vec::new() };
        let of_task: &[&str] = if self.online.is_some() { &["size", "actions"] } else { &[] };
        let beside = if self.system.is_some() { "with --system" } else { "with --online" };
        refuse(&self.given, model.iter().map(String::as_str).chain(of_task.iter().copied()), beside)
    }

    /// The model's options. What says how long a run is and how it is saved may stand, as a run's config.toml has it, but not what it sees: pictures are timed.
    fn model(&self) -> Result<Options> {
        let options = if self.recipe { self.options.resolve() } else { self.options.resolve_plain() }?;
        if options.first_changed(&Options::preset(self.options.preset())?, &["observations"]).is_some() {
            let text = "--observations has no effect where updates on pictures are timed; leave it out";
            return Err(TrainError::Options(text.to_owned()).into());
        }
        Ok(options)
    }
}

/// An agent without a world model.
pub(crate) fn of_agent(context: &Context, args: &BenchArgs, system: &str) -> Result<()> {
    args.check_given()?;
    let mut options = AgentOptions::system(system, Size::Small)?;
    let width = match &mut options {
        AgentOptions::Stacks(options) => &mut options.hidden,
        AgentOptions::Recurrent(options) => &mut options.hidden,
    };
    *width = args.system_hidden.unwrap_or(*width);
    let hidden = *width;
    let ms = bench_agent(&options, args.sizes(), &args.device.open()?)?;
    if context.json {
        println!("{}", serde_json::json!({ "system": system, "update_ms": ms }));
    } else {
        let side = args.size;
        let batch = match &options {
            AgentOptions::Stacks(options) => options.batch.to_string(),
            AgentOptions::Recurrent(options) => format!("{} × {}", options.windows, options.length),
        };
        println!("{system} update, batch {batch}, {side}×{side}, hidden {hidden}: {ms:.1} ms");
    }
    Ok(())
}

pub(crate) fn run(context: &Context, args: &BenchArgs) -> Result<()> {
    args.check_given()?;
    let options = args.model()?;
    if let Some(task) = &args.online {
        return online(context, args, &options, task);
    }
    let sizes = args.sizes();
    let recording = args.recording.as_ref().map(|path| Recording::open(path)).transpose()?;
    let report = bench(&options, sizes, recording.as_ref(), &args.device.open()?)?;
    if context.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let (side, depth) = (args.size, options.depth);
    println!(
        "{} update, batch {} × {}, {side}×{side}, depth {depth}",
        options.objective, options.batch, options.length
    );
    println!("  {:<30}{:8.1} ms", "whole update", report.update_ms);
    for part in &report.parts {
        println!("    {:<28}{:8.1} ms", part.name, part.ms);
    }
    println!("  {:<30}{:8.1} ms", "bytes to tensors (before it)", report.batch_ms);
    let (gflop, gflops) = (report.convolution_gflop, report.convolution_gflops);
    println!("  {:<30}{gflop:8.1} GFLOP, {gflops:.0} GFLOP/s over the whole update", "convolutions of an update");
    println!("  {:<30}{:8.0} GFLOP/s", "matrix product 1024³", report.matrix_product_gflops);
    if let Some(rate) = report.sampling_gigabytes_per_second {
        println!("  {:<30}{rate:8.2} GB/s", "window sampling");
    }
    Ok(())
}

fn online(context: &Context, args: &BenchArgs, options: &Options, task: &str) -> Result<()> {
    let settings = default_options(default_world(task)?, false);
    let report = bench_online(options, &settings, usize::from(args.repeats), &args.device.open()?)?;
    if context.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let (batch, length, horizon) = (options.batch, options.length, settings.behaviour.horizon);
    println!("{} online on {task}, batch {batch} × {length}, horizon {horizon}", options.objective);
    println!("  {:<32}{:8.1} ms", "whole update", report.update_ms);
    println!("  {:<32}{:8.1} ms", "world model", report.world_ms);
    println!("  {:<32}{:8.1} ms", "actor and critic", report.behaviour_ms);
    for part in &report.parts {
        println!("    {:<30}{:8.1} ms", part.name, part.ms);
    }
    println!("  {:<32}{:8.2} ms", "acting, networks, a step", report.acting_ms);
    println!("  {:<32}{:8.2} ms", "acting, simulation and drawing", report.step_ms);
    let timed = &report.end_to_end;
    println!(
        "  end to end {:.1} control steps a second at {:.1} updates an agent step, over {} rounds",
        timed.control_steps_per_second, report.updates_per_step, timed.rounds
    );
    println!(
        "  the {} is waited for: the learner waits {:.0} % of a round, the actor is at work {:.0} % of it",
        report.waited_for,
        100.0 * timed.waiting_for_actor_share,
        100.0 * timed.acting_share
    );
    Ok(())
}
