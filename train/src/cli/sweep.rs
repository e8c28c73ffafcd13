//! `vibes-train sweep`: many runs from one plan.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::error::ErrorKind;
use clap::{Args, Parser, ValueEnum};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::json;
use vibes_command::{Ending, error_text, stop_on_signals};
use vibes_train::TrainError;
use vibes_train::sweep::{self, Element, Engine, Plan, StageEnd, State, Status, line, run_element};

use super::{Cli, Context, judge};

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
    /// Do all runs here, so many at once, the cores divided among them. With --script: at most so many at once.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..), conflicts_with_all = ["list", "status", "index"])]
    jobs: Option<u16>,
    /// Save and end after this time, as in 3h50m or 90s, as if a signal had come.
    #[arg(long, value_name = "TIME", value_parser = parse_time, conflicts_with_all = ["list", "status", "script"])]
    stop_after: Option<Duration>,
    /// Save and end when standard input is closed: how --jobs stops its children.
    #[arg(long, hide = true, requires = "index")]
    until_closed: bool,
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
    check(&elements)?;
    if args.what.status {
        return status(context, &elements);
    }
    if let Some(engine) = args.what.script {
        print!("{}", script(args, engine, elements.len())?);
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
            if args.until_closed {
                std::thread::spawn(move || {
                    let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
                    stop.store(true, Ordering::Relaxed);
                });
            }
            here(context, &elements, &indices(text, elements.len())?, (verb, stop))
        }
        (None, Some(jobs)) => children(context, &args.plan, &elements, usize::from(jobs), stop),
        (None, None) if args.stop_after.is_some() => {
            bail!(TrainError::Options("--stop-after needs runs to stop; add --index N or --jobs K".to_owned()))
        }
        (None, None) => Ok(list(context, &elements)),
    }
}

/// Refuses command lines that this program could not read, before anything is run.
fn check(elements: &[Element]) -> Result<()> {
    for words in elements.iter().flat_map(|element| &element.stages).filter(|words| words[0] == "vibes-train") {
        let fault = |error: clap::Error| {
            let text = error.to_string();
            let first = text.lines().next().unwrap_or_default().trim_start_matches("error: ");
            TrainError::Options(format!("{first}; in the stage: {}", line(words)))
        };
        let (typed, has_file) = typed(words);
        let cli = match Cli::try_parse_from(typed) {
            // The file may say it, and may be one that an earlier stage has yet to write.
            Err(error) if has_file && error.kind() == ErrorKind::MissingRequiredArgument => continue,
            read => read.map_err(fault)?,
        };
        if matches!(cli.command, super::Command::Sweep(_)) {
            bail!(TrainError::Options(format!("a sweep inside a sweep; in the stage: {}", line(words))));
        }
    }
    Ok(())
}

/// The words of a command line without `--config FILE`, and whether that was there.
fn typed(words: &[String]) -> (Vec<&String>, bool) {
    let is_file = |word: &String| word == "--config" || word.starts_with("--config=");
    let Some(place) = words.iter().position(is_file) else { return (words.iter().collect(), false) };
    let after = if words[place] == "--config" { place + 2 } else { place + 1 };
    (words[..place].iter().chain(words.iter().skip(after)).collect(), true)
}

fn list(context: &Context, elements: &[Element]) -> Ending {
    if context.json {
        let all = elements.iter().map(|element| {
            json!({ "index": element.index, "name": element.name, "folder": element.folder, "settings": element.settings,
                "stages": element.stages.iter().map(|words| line(words)).collect::<Vec<_>>() })
        });
        println!("{}", serde_json::Value::from(all.collect::<Vec<_>>()));
    } else {
        for element in elements {
            println!("{}  {}", element.index, element.folder.display());
            for words in &element.stages {
                println!("     {}", line(words));
            }
        }
    }
    Ending::Done
}

fn status(context: &Context, elements: &[Element]) -> Result<Ending> {
    let all: Vec<Status> = elements.iter().map(sweep::status).collect();
    if context.json {
        println!("{}", serde_json::to_string(&all)?);
        return Ok(Ending::Done);
    }
    let width = all.iter().map(|status| status.name.len()).max().unwrap_or(3).max(3);
    println!(
        "{:>5}  {:<width$}  state    stages  made of all                   objective  left    last change",
        "index", "run"
    );
    for status in &all {
        println!("{}", row(status, width));
    }
    let count = |state: State| all.iter().filter(|status| status.state == state).count();
    println!(
        "{} runs: {} done, {} running, {} saved, {} failed, {} waiting",
        all.len(),
        count(State::Done),
        count(State::Running),
        count(State::Saved),
        count(State::Failed),
        count(State::Waiting)
    );
    Ok(Ending::Done)
}

fn row(status: &Status, width: usize) -> String {
    let dash = || "–".to_owned();
    let number = |value: Option<u64>| value.map_or_else(dash, |value| value.to_string());
    let made = match status.control_steps_asked {
        Some(asked) => format!("{}/{asked} control steps", number(status.control_steps)),
        None => format!("{}/{} updates", number(status.update), number(status.updates)),
    };
    let objective = status.objective.map_or_else(dash, |value| format!("{value:.3}"));
    let time = |seconds: Option<f64>| seconds.map_or_else(dash, short_time);
    let state = format!("{:?}", status.state).to_lowercase();
    let left = if status.state == State::Running { time(status.seconds_left) } else { dash() };
    let note = status.note.as_ref().map_or_else(String::new, |note| format!("  {note}"));
    format!(
        "{:>5}  {:<width$}  {state:<7}  {}/{:<4}  {made:<28}  {objective:<9}  {left:<6}  {}{note}",
        status.index,
        status.name,
        status.stages.0,
        status.stages.1,
        time(status.seconds_since)
    )
}

fn short_time(seconds: f64) -> String {
    match seconds as u64 {
        seconds @ 0..60 => format!("{seconds} s"),
        seconds @ 60..3600 => format!("{} min", seconds / 60),
        seconds => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}

fn script(args: &SweepArgs, engine: EngineName, runs: usize) -> Result<String> {
    let engine = match engine {
        EngineName::Slurm => Engine::Slurm,
        EngineName::Xargs => Engine::Xargs,
        EngineName::Parallel => Engine::Parallel,
    };
    let folder = std::env::current_dir().context("cannot tell the present folder")?;
    let jobs = args.jobs.map_or_else(cores, usize::from);
    Ok(sweep::script(engine, &args.plan.to_string_lossy(), &folder.to_string_lossy(), runs, jobs))
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The runs that `3`, `0-3`, `0-3,7` or `slurm` means.
fn indices(text: &str, count: usize) -> Result<Vec<usize>> {
    let wrong = |fact: String| anyhow!(TrainError::Options(fact));
    let text = if text == "slurm" {
        let name = "SLURM_ARRAY_TASK_ID";
        std::env::var(name)
            .map_err(|_none| wrong(format!("--index slurm needs {name}, which Slurm's job arrays set")))?
    } else {
        text.to_owned()
    };
    let mut all = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (Ok(first), Ok(last)) = (first.trim().parse::<usize>(), last.trim().parse::<usize>()) else {
            return Err(wrong(format!(
                "--index is {text}; a number, a range or a list is right, as in 3, 0-3 or 0-3,7"
            )));
        };
        if last >= count || first > last {
            return Err(wrong(format!("--index is {text}; the plan's runs are 0 to {}", count - 1)));
        }
        all.extend(first..=last);
    }
    Ok(all)
}

/// Does some runs in this process. One that fails does not keep the others from being done.
fn here(
    context: &Context,
    elements: &[Element],
    chosen: &[usize],
    (verb, stop): (Verb, &AtomicBool),
) -> Result<Ending> {
    let mut failed = Vec::new();
    for &index in chosen {
        let element = &elements[index];
        match run_element(element, stop, &mut |words| carry_out(context, words, verb, stop)) {
            Ok(None) => say(context, &format!("run {index} is done already: {}", element.folder.display())),
            Ok(Some(StageEnd::Done)) => say(context, &format!("run {index} is done: {}", element.folder.display())),
            Ok(Some(StageEnd::Again)) => {
                say(context, &format!("run {index} is saved; the same command goes on: {}", element.folder.display()));
                return Ok(Ending::Again);
            }
            Err(error) if judge(&error) == Ending::Again => return Err(error),
            Err(error) if chosen.len() == 1 => return Err(error),
            Err(error) => {
                eprintln!("run {index} failed: {}", error_text(&error));
                failed.push(index);
            }
        }
    }
    ended(&failed, chosen.len())
}

fn ended(failed: &[usize], runs: usize) -> Result<Ending> {
    if failed.is_empty() {
        return Ok(Ending::Done);
    }
    let names: Vec<String> = failed.iter().map(usize::to_string).collect();
    bail!(
        "{} of {runs} runs failed: {}; the others are done, and the same command tries again",
        failed.len(),
        names.join(", ")
    )
}

/// Carries out one command line: this program's own verbs in this process, another program as a child, and this one too where its options are to be read from a file, which is done
/// where a process begins.
fn carry_out(context: &Context, words: &[String], verb: Verb, stop: &AtomicBool) -> Result<StageEnd> {
    say(context, &line(words));
    let ending = if words[0] == "vibes-train" && !typed(words).1 {
        let mut cli = Cli::try_parse_from(words)?;
        cli.output.quiet |= context.quiet;
        match verb(cli) {
            Err(error) if judge(&error) == Ending::Again => Ending::Again,
            ending => ending?,
        }
    } else {
        other(words, context.quiet, stop)?
    };
    match ending {
        Ending::Done => Ok(StageEnd::Done),
        Ending::Again => Ok(StageEnd::Again),
        Ending::Failed | Ending::Wrong | Ending::DataLost => bail!("exit code {}", ending.code()),
    }
}

/// Runs another of the three programs, the one beside this one if there is one. When this process is to stop, so is that.
fn other(words: &[String], quiet: bool, stop: &AtomicBool) -> Result<Ending> {
    let beside = std::env::current_exe().ok().map(|own| own.with_file_name(&words[0])).filter(|path| path.is_file());
    let mut command = Command::new(beside.unwrap_or_else(|| PathBuf::from(&words[0])));
    command.args(&words[1..]).args(quiet.then_some("-q")).stdin(Stdio::null());
    in_a_group_of_its_own(&mut command);
    let mut child = command.spawn().with_context(|| format!("cannot start {}", words[0]))?;
    let mut told = false;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if stop.load(Ordering::Relaxed) && !told {
            told = true;
            // One that has ended meanwhile needs none.
            let _ = kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM);
        }
        std::thread::sleep(LOOK);
    };
    match status.code() {
        Some(0) => Ok(Ending::Done),
        Some(75) => Ok(Ending::Again),
        _ if told => Ok(Ending::Again),
        _ => bail!("{} ended with {status}", words[0]),
    }
}

/// Ctrl-C reaches this process alone, which then stops its children once.
fn in_a_group_of_its_own(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    command.process_group(0);
}

/// Does all runs, so many at once, each in a child of this program with its share of the cores. What a child says goes into `sweep.log` in its
/// run's folder.
fn children(context: &Context, plan: &Path, elements: &[Element], jobs: usize, stop: &AtomicBool) -> Result<Ending> {
    let threads = (cores() / jobs.min(elements.len())).max(1).to_string();
    let mut waiting = elements.iter();
    let mut running: Vec<(&Element, Child)> = Vec::new();
    let (mut failed, mut saved) = (Vec::new(), false);
    loop {
        while running.len() < jobs && !stop.load(Ordering::Relaxed) {
            let Some(element) = waiting.next() else { break };
            say(context, &format!("run {}: {}", element.index, element.name));
            running.push((element, child(plan, element, &threads)?));
        }
        if stop.load(Ordering::Relaxed) {
            saved |= waiting.len() > 0;
            // Closing a child's standard input stops it.
            running.iter_mut().for_each(|(_, child)| drop(child.stdin.take()));
        }
        if running.is_empty() {
            break;
        }
        std::thread::sleep(LOOK);
        let mut going = Vec::new();
        for (element, mut child) in running {
            match child.try_wait()? {
                None => going.push((element, child)),
                Some(status) if status.success() => say(context, &format!("run {} is done", element.index)),
                Some(status) if status.code() == Some(75) => saved = true,
                Some(status) => {
                    eprintln!(
                        "run {} failed ({status}): {}",
                        element.index,
                        element.folder.join("sweep.log").display()
                    );
                    failed.push(element.index);
                }
            }
        }
        running = going;
    }
    // What was stopped goes on with the same command, also where a run failed; that another process owns a run is no reason to pass over one that failed.
    if saved && (failed.is_empty() || stop.load(Ordering::Relaxed)) {
        let names = failed.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let failed = if failed.is_empty() { names } else { format!("; failed: {names}") };
        say(context, &format!("stopped and saved{failed}; the same command goes on"));
        return Ok(Ending::Again);
    }
    ended(&failed, elements.len())
}

fn child(plan: &Path, element: &Element, threads: &str) -> Result<Child> {
    std::fs::create_dir_all(&element.folder).with_context(|| format!("cannot create {}", element.folder.display()))?;
    let path = element.folder.join("sweep.log");
    let open = || std::fs::OpenOptions::new().create(true).append(true).open(&path);
    let log = open().with_context(|| format!("cannot write {}", path.display()))?;
    let mut command = Command::new(std::env::current_exe().context("cannot find this program")?);
    command.arg("sweep").arg(plan).args(["--until-closed", "--index"]).arg(element.index.to_string());
    command.env("RAYON_NUM_THREADS", threads).stdin(Stdio::piped()).stdout(log.try_clone()?).stderr(log);
    in_a_group_of_its_own(&mut command);
    command.spawn().context("cannot start a run")
}

fn say(context: &Context, text: &str) {
    if !context.quiet {
        eprintln!("{text}");
    }
}

/// `3h50m`, `90s`, `1h30m10s`.
fn parse_time(text: &str) -> Result<Duration, String> {
    let wrong = || format!("{text} is no time; 3h50m, 45m or 90s is right");
    let (mut seconds, mut digits) = (0_u64, String::new());
    for c in text.chars() {
        let unit = match c {
            '0'..='9' => {
                digits.push(c);
                continue;
            }
            'h' => 3600,
            'm' => 60,
            's' => 1,
            _ => return Err(wrong()),
        };
        let count: u64 = std::mem::take(&mut digits).parse().map_err(|_none| wrong())?;
        seconds = count.checked_mul(unit).and_then(|more| seconds.checked_add(more)).ok_or_else(wrong)?;
    }
    if digits.is_empty() && seconds > 0 { Ok(Duration::from_secs(seconds)) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_indices_are_read_and_what_is_none_is_refused() {
        assert_eq!(parse_time("3h50m").unwrap().as_secs(), 13_800);
        assert_eq!(parse_time("90s").unwrap().as_secs(), 90);
        for text in ["", "90", "h", "3x", "3h50", "0s"] {
            assert!(parse_time(text).is_err(), "{text}");
        }
        assert_eq!(indices("0-2,4", 5).unwrap(), [0, 1, 2, 4]);
        for text in ["5", "2-1", "x", "", "0-9"] {
            assert!(indices(text, 5).is_err(), "{text}");
        }
    }
}
