//! `vibes-train sweep`: many runs from one plan.

mod children;
mod here;
mod same;
mod shown;
mod status;
mod tally;
mod typed;

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::error::ErrorKind;
use clap::{Args, ValueEnum};
use vibes_command::{Ending, error_text, parse, parse_typed, stop_on_signals};
use vibes_train::TrainError;
use vibes_train::sweep::{Element, Plan, line};

use self::children::children;
use self::here::here;
use self::same::{check_names, check_runs};
use self::shown::{list, script};
use self::status::status;
use self::typed::{indices, parse_time};
use super::{Cli, Command, Context};

/// How often children and the clock are looked at.
const LOOK: Duration = Duration::from_millis(100);

#[derive(Debug, Args)]
#[group(id = "what", multiple = false)]
pub(crate) struct What {
    /// Print every run with its folder and command lines (the default).
    #[arg(long)]
    list: bool,
    /// Print how far every run is, from its files alone.
    #[arg(long)]
    status: bool,
    /// Do these runs here, one after the other: 3, 0-3, or 0-3,7. `slurm` takes the index of Slurm's job array.
    #[arg(long, value_name = "N")]
    index: Option<String>,
    /// Print a script that hands the sweep to an engine; nothing is submitted.
    #[arg(long, value_name = "ENGINE")]
    script: Option<EngineName>,
}

#[derive(Debug, Args)]
pub(crate) struct SweepArgs {
    /// The plan, a TOML file: output and stages, and what varies: seeds, grid, zip, list.
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    #[command(flatten)]
    what: What,
    /// Do all runs here, so many at once, the cores divided among them unless `RAYON_NUM_THREADS` says how many each has. With --script: at most so many at once.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..), conflicts_with_all = ["list", "status", "index"])]
    jobs: Option<u16>,
    /// Save and end after this time, as in 3h50m or 90s, as if a signal had come.
    #[arg(long, value_name = "TIME", value_parser = parse_time, conflicts_with_all = ["list", "status", "script"])]
    stop_after: Option<Duration>,
    /// Save and end when standard input is closed: how --jobs stops its children.
    #[arg(long, hide = true, requires = "index")]
    until_closed: bool,
    /// Refuse a run of --index whose digest, as in --list --json, is another: how --jobs says which run it means.
    #[arg(long, hide = true, requires = "index", value_name = "DIGEST")]
    run_is: Option<String>,
    /// Refuse a plan whose runs' names have another digest: how a script says which runs its numbers mean.
    #[arg(long, hide = true, value_name = "DIGEST")]
    names_are: Option<String>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EngineName {
    Slurm,
    Xargs,
    Parallel,
}

/// What carries out one command line of this program.
type Verb = fn(Cli) -> Result<Ending>;

/// Carries out a sweep; `verb` does this program's own stages.
pub(crate) fn run(context: &Context, args: &SweepArgs, verb: Verb) -> Result<Ending> {
    let elements = Plan::read(&args.plan)?.expand()?;
    if args.what.status {
        return status(context, &elements);
    }
    check(&elements)?;
    check_names(args, &elements)?;
    if let Some(engine) = args.what.script {
        print!("{}", script(args, engine, &elements)?);
        return Ok(Ending::Done);
    }
    let stop = stop_on_signals()?;
    if let Some(time) = args.stop_after {
        std::thread::spawn(move || {
            std::thread::sleep(time);
            stop.store(true, Ordering::Relaxed);
        });
    }
    match (&args.what.index, args.jobs) {
        (Some(text), _) => {
            let chosen = indices(text, elements.len())?;
            check_runs(args, &elements, &chosen)?;
            if args.until_closed {
                std::thread::spawn(move || {
                    let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
                    stop.store(true, Ordering::Relaxed);
                });
            }
            here(context, &elements, &chosen, (verb, stop))
        }
        (None, Some(jobs)) => children(context, &args.plan, &elements, usize::from(jobs), stop),
        (None, None) if args.stop_after.is_some() => {
            bail!(TrainError::Options("--stop-after needs runs to stop; add --index N or --jobs K".to_owned()))
        }
        (None, None) => Ok(list(context, &elements)),
    }
}

/// Refuses command lines that this program could not read or would not carry out, before anything is run.
fn check(elements: &[Element]) -> Result<()> {
    let stages = elements.iter().flat_map(|element| element.stages.iter().enumerate());
    let mut own = stages.filter(|(_, words)| words[0] == "vibes-train");
    own.try_for_each(|(place, words)| check_stage(place, words))
}

fn check_stage(place: usize, words: &[String]) -> Result<()> {
    let (read, is_whole) = match parse::<Cli>(words) {
        // An earlier stage may have the file of options yet to write: what was typed is judged as far as it goes.
        Err(error) if place > 0 && is_missing(&error) => match parse_typed(words) {
            Err(error) if is_incomplete(&error) => return Ok(()),
            read => (read, false),
        },
        read => (read, true),
    };
    let checked = match read.map_err(|error| fault(&error, words))?.command {
        Command::Sweep(_) => {
            bail!(TrainError::Options(format!("a sweep inside a sweep; in the stage: {}", line(words))))
        }
        Command::Offline(args) if is_whole => args.resolve().map(|_options| ()),
        Command::Online(args) if is_whole => args.check_typed(),
        _ => Ok(()),
    };
    Ok(checked.map_err(|error| fault(&error, words))?)
}

/// Whether a file is not there.
fn is_missing(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|part| part.downcast_ref::<std::io::Error>());
    causes.any(|cause| cause.kind() == std::io::ErrorKind::NotFound)
}

/// Whether an option is missing that the file may yet bring.
fn is_incomplete(error: &anyhow::Error) -> bool {
    error.downcast_ref::<clap::Error>().is_some_and(|error| error.kind() == ErrorKind::MissingRequiredArgument)
}

fn fault(error: &anyhow::Error, words: &[String]) -> TrainError {
    let text = error_text(error);
    let first = text.lines().next().unwrap_or_default().trim_start_matches("error: ");
    TrainError::Options(format!("{first}; in the stage: {}", line(words)))
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn say(context: &Context, text: &str) {
    if !context.quiet {
        eprintln!("{text}");
    }
}
