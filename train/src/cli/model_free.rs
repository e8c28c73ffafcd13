//! `vibes-train online --agent sac|qt-opt`: the agents without a world model, by the names of the systems that have them.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::{Args, ValueEnum};
use vibes_command::{Ending, stop_on_signals};
use vibes_data::Metrics;
use vibes_train::fit::{End, Go};
use vibes_train::learners::model_free::AgentOptions;
use vibes_train::learners::recurrent::options::RecurrentOptions;
use vibes_train::learners::sac::augment::Augment;
use vibes_train::learners::sac::options::{Auxiliary, SacOptions, Size};
use vibes_train::online::model_free::folder::{FORMAT, Folder, ModelFreeOptions};
use vibes_train::online::model_free::{Event, Line, model_free_under};
use vibes_train::online::options::OnlineOptions;

use super::Context;
use super::device::DeviceArgs;
use super::online_progress::{ended_under, on, protocol_of, under};
use super::videos::open_videos;

/// Time between lines.
const EVERY: Duration = Duration::from_secs(15);

/// Which agent learns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AgentKind {
    /// Actor and critic that learn from trajectories imagined by a world model.
    Dreamer,
    /// Soft actor-critic from stacked pictures, or through a GRU.
    Sac,
    /// Critics alone; the best action is searched for.
    QtOpt,
}

/// Agents without a world model.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Agents without a world model (--agent sac or qt-opt)")]
pub(crate) struct ModelFreeArgs {
    /// The agent: dreamer, sac or qt-opt.
    #[arg(long, value_enum, default_value_t = AgentKind::Dreamer)]
    agent: AgentKind,
    /// The system to begin as: sac-rad, sac-drq, curl, deepmdp, dbc, mico, simsr, sar, rsac, core, or qt-opt-rad, qt-opt-drq [default: sac-drq, qt-opt-drq].
    #[arg(long, value_name = "NAME")]
    system: Option<String>,
    /// Its size: small (64 pixels, batches of 128, one view) or paper (84 pixels, batches of 512, or 32 windows of 32) [default: small].
    #[arg(long, value_parser = parse_size, value_name = "small|paper")]
    system_size: Option<Size>,
    /// How pictures are varied: none, crop or shift.
    #[arg(long)]
    augment: Option<Augment>,
    /// Views of the next stack that targets are averaged over (K).
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    next_views: Option<u16>,
    /// Views of the stack that the critics' loss is added up over (M).
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u16).range(1..))]
    views: Option<u16>,
    /// What stands beside the critics' loss: none, curl, deepmdp, dbc, mico, simsr or sar.
    #[arg(long)]
    auxiliary: Option<Auxiliary>,
    /// Transitions a batch; of rsac and core, rows in all windows together.
    #[arg(long, value_name = "N")]
    transitions: Option<usize>,
    /// Updates for every agent step [default: 0.5; 1 for paper systems that look at stacks].
    #[arg(long, value_name = "X")]
    updates_per_step: Option<f64>,
    /// Episodes between checkpoints [default: 10].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    save_every: Option<u32>,
}

fn parse_size(text: &str) -> std::result::Result<Size, String> {
    match text {
        "small" => Ok(Size::Small),
        "paper" => Ok(Size::Paper),
        _ => Err("the sizes are small and paper".to_owned()),
    }
}

fn wrong(text: String) -> anyhow::Error {
    vibes_train::TrainError::Options(text).into()
}

impl ModelFreeArgs {
    /// Whether there is such a system.
    pub(crate) fn is_system(name: &str) -> bool {
        AgentOptions::system(name, Size::Small).is_ok()
    }

    /// The same arguments with the system that was named as a preset, which says what its agent is.
    pub(crate) fn named(&self, preset: Option<&str>) -> Result<Self> {
        let Some(name) = preset else { return Ok(self.clone()) };
        if self.system.is_some() {
            return Err(wrong(format!("--preset {name} and --system name one thing; leave out one of the two")));
        }
        let has_actor = AgentOptions::system(name, Size::Small)?.has_actor();
        let agent = if has_actor { AgentKind::Sac } else { AgentKind::QtOpt };
        if self.is_asked() && self.agent != agent {
            return Err(wrong(format!("the system {name} is of another --agent; leave out one of the two")));
        }
        Ok(Self { agent, system: Some(name.to_owned()), ..self.clone() })
    }

    /// Whether such an agent is asked for.
    pub(crate) fn is_asked(&self) -> bool {
        self.agent != AgentKind::Dreamer
    }

    /// The size of the pictures, if the system's size says one.
    pub(crate) fn picture_size(&self) -> Result<Option<u32>> {
        let crop = match self.options()? {
            AgentOptions::Stacks(options) => options.augment,
            AgentOptions::Recurrent(options) => options.augment,
        } == Augment::Crop;
        Ok(match self.system_size {
            // A crop keeps 84 of 100 pixels, so that 84 are seen.
            Some(Size::Paper) if crop => Some(100),
            Some(Size::Paper) => Some(84),
            _ => None,
        })
    }

    /// Episodes between checkpoints, if it was said: where a run is gone on with it may differ from before.
    pub(crate) fn save_every(&self) -> Option<u32> {
        self.save_every
    }

    fn system(&self) -> String {
        let default = if self.agent == AgentKind::QtOpt { "qt-opt-drq" } else { "sac-drq" };
        self.system.clone().unwrap_or_else(|| default.to_owned())
    }

    fn size(&self) -> Size {
        self.system_size.unwrap_or(Size::Small)
    }

    fn options(&self) -> Result<AgentOptions> {
        let system = AgentOptions::system(&self.system(), self.size())?;
        let wanted = self.agent == AgentKind::Sac;
        if self.auxiliary == Some(Auxiliary::Sar) && !wanted {
            return Err(wrong("--auxiliary sar looks through an actor's features; it needs --agent sac".to_owned()));
        }
        if system.has_actor() != wanted {
            let kind = if system.has_actor() { "sac" } else { "qt-opt" };
            return Err(wrong(format!("the system {} is of --agent {kind}; leave out one of the two", self.system())));
        }
        Ok(match system {
            AgentOptions::Stacks(system) => {
                let auxiliary = self.auxiliary.unwrap_or(system.auxiliary);
                AgentOptions::Stacks(SacOptions {
                    augment: self.augment.unwrap_or(system.augment),
                    next_views: self.next_views.map_or(system.next_views, usize::from),
                    views: self.views.map_or(system.views, usize::from),
                    batch: self.transitions.unwrap_or(system.batch),
                    ..system.with(auxiliary, self.size())
                })
            }
            AgentOptions::Recurrent(system) => {
                let is_of_stacks = self.next_views.or(self.views).is_some() || self.auxiliary.is_some();
                if is_of_stacks {
                    let text = "--views, --next-views and --auxiliary are of systems that look at stacks";
                    return Err(wrong(format!("{text}; {} learns from windows", self.system())));
                }
                let windows = self.transitions.map(|rows| rows.div_ceil(system.length));
                AgentOptions::Recurrent(RecurrentOptions {
                    augment: self.augment.unwrap_or(system.augment),
                    windows: windows.unwrap_or(system.windows),
                    ..system
                })
            }
        })
    }

    /// The run to begin, or to go on with, in this world.
    pub(crate) fn prepare(&self, output: Option<&Path>, seed: u64, online: OnlineOptions) -> Result<Folder> {
        let agent = self.options()?;
        let options = ModelFreeOptions {
            format: FORMAT.to_owned(),
            system: self.system(),
            size: self.size(),
            seed,
            agent: agent.clone(),
            updates_per_step: self.updates_per_step.unwrap_or(match (self.size(), &agent) {
                (Size::Small, _) | (_, AgentOptions::Recurrent(_)) => 0.5,
                (Size::Paper, AgentOptions::Stacks(_)) => 1.0,
            }),
            save_every: self.save_every.unwrap_or(10),
            online,
        };
        let folder = format!("runs/{}-{}", options.online.world.task, options.system);
        let path = output.map_or_else(|| PathBuf::from(folder), Path::to_owned);
        Ok(Folder::create_or_open(&path, options)?)
    }
}

/// Trains, and says how it goes.
#[allow(clippy::print_stdout, clippy::print_stderr, reason = "the command line says what it does")]
pub(crate) fn run(context: &Context, folder: &Folder, device: DeviceArgs) -> Result<Ending> {
    let device = device.open()?;
    let stop = stop_on_signals()?;
    let (options, path) = (folder.options(), folder.path().display());
    let say = |text: &str| {
        if !context.quiet {
            eprintln!("{text}");
        }
    };
    say(&format!(
        "{} ({}) on {}, distractors {}{}, {} updates per agent step; into {path}",
        options.system,
        options.size,
        options.online.world.task,
        options.online.world.distractors.axes,
        under(&options.online),
        options.updates_per_step
    ));
    let videos = open_videos(context, &options.online.world, stop)?;
    let mut said: Option<Instant> = None;
    let end = model_free_under(videos, folder, &device, &mut |event| {
        match &event {
            Event::Start { control_steps: 0 } | Event::Update | Event::Admitted | Event::Judged => {}
            Event::Start { control_steps } => say(&format!("going on after {control_steps} control steps")),
            Event::Lived(line) => {
                let is_due = std::io::stderr().is_terminal() || said.is_none_or(|said| said.elapsed() >= EVERY);
                if is_due || context.verbose {
                    said = Some(Instant::now());
                    say(&format!(
                        "{} of {} control steps: {}",
                        line.control_steps,
                        options.online.control_steps,
                        summary(line)
                    ));
                }
            }
            Event::Evaluated(evaluation) => say(&format!(
                "evaluated at {} control steps: mean return{} {:.1}",
                evaluation.counters.control_steps,
                on(evaluation.gap.is_some(), true),
                evaluation.held_out.mean_return
            )),
        }
        if stop.load(std::sync::atomic::Ordering::Relaxed) { Go::Stop } else { Go::On }
    })?;
    let last = Metrics::read(&folder.places().evaluations_path())?.lines.pop().map(serde_json::Value::Object);
    if context.json {
        let end = format!("{end:?}").to_lowercase();
        let protocol = protocol_of(last.as_ref());
        println!(
            "{}",
            serde_json::json!({ "run": folder.path(), "end": end, "protocol": protocol, "evaluation": last })
        );
    } else if !context.quiet {
        let under = ended_under(&options.online, last.as_ref());
        match end {
            End::Nothing => {
                println!(
                    "{path} has lived through its control steps already{under}; ask for more with --control-steps N"
                );
            }
            End::Updates => println!("done{under}: {path}"),
            End::Minutes | End::Stopped if folder.places().checkpoints().is_empty() => {
                println!("stopped before anything was learned{under}; the same command begins anew: {path}");
            }
            End::Minutes | End::Stopped => {
                println!("stopped and saved{under}; the same command goes on from there: {path}");
            }
        }
    }
    Ok(if end == End::Stopped { Ending::Again } else { Ending::Done })
}

fn summary(line: &Line) -> String {
    let said = |text: &str, value: Option<f64>, digits: usize| value.map(|value| format!(", {text}{value:.digits$}"));
    let parts = [
        said("target ", line.target, 2),
        said("critic loss ", line.critic_loss, 3),
        line.control_steps_per_second.map(|pace| format!(", {pace:.0} control steps/s")),
    ];
    let parts: String = parts.into_iter().flatten().collect();
    format!("{} agent steps, return {:.1}{parts}", line.agent_steps, line.training_return)
}
