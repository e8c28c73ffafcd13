//! Runs of a sweep in this process, one after the other. In: the runs, and what carries out a command line of this program. Out: their folders.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use vibes_command::{Ending, error_text, parse};
use vibes_train::TrainError;
use vibes_train::sweep::{Element, StageEnd, line, run_element};

use super::tally::Tally;
use super::{LOOK, Verb, say};
use crate::cli::{Cli, Context, judge};

/// Does some runs in this process. One that fails, or that another process is at, does not keep the others from being done.
pub(super) fn here(
    context: &Context,
    elements: &[Element],
    chosen: &[usize],
    (verb, stop): (Verb, &AtomicBool),
) -> Result<Ending> {
    let mut tally = Tally::of(chosen.len());
    for &index in chosen {
        let element = &elements[index];
        let mut said = Said::default();
        match run_element(element, stop, &mut |words| carry_out(context, words, &mut said, (verb, stop))) {
            Ok(None) => say(context, &format!("run {index} is done already: {}", element.folder.display())),
            Ok(Some(StageEnd::Done)) => say(context, &format!("run {index} is done: {}", element.folder.display())),
            Ok(Some(StageEnd::Again(_))) => {
                say(context, &format!("run {index} is saved; the same command goes on: {}", element.folder.display()));
                return Ok(Ending::Again);
            }
            Err(error) if chosen.len() == 1 => return Err(error),
            Err(error) if judge(&error) == Ending::Again => {
                eprintln!("run {index} is busy: {}", error_text(&error));
                tally.busy.push(index);
            }
            Err(error) => {
                eprintln!("run {index} failed: {}", error_text(&error));
                tally.failed.push(index);
            }
        }
    }
    tally.end(context)
}

/// What was said of the stage at hand, which may be tried again and again: everything once.
#[derive(Default)]
struct Said {
    line: String,
    waiting: String,
}

impl Said {
    fn stage(&mut self, context: &Context, words: &[String]) {
        let line = line(words);
        if self.line != line {
            say(context, &line);
            *self = Self { line, waiting: String::new() };
        }
    }

    fn waiting(&mut self, context: &Context, reason: &str) {
        if self.waiting != reason {
            say(context, &format!("waiting: {reason}"));
            reason.clone_into(&mut self.waiting);
        }
    }
}

/// Carries out one command line: this program's own verbs in this process, another program as a child.
fn carry_out(
    context: &Context,
    words: &[String],
    said: &mut Said,
    (verb, stop): (Verb, &AtomicBool),
) -> Result<StageEnd> {
    said.stage(context, words);
    let (ending, reason) = if words[0] == "vibes-train" {
        own(context, words, verb)?
    } else {
        (other(words, context.quiet, stop)?, format!("{} asks to be started again", words[0]))
    };
    match ending {
        Ending::Done => {
            *said = Said::default();
            Ok(StageEnd::Done)
        }
        // What was stopped waits for nobody.
        Ending::Again if reason.is_empty() || stop.load(Ordering::Relaxed) => Ok(StageEnd::Again(None)),
        Ending::Again => {
            said.waiting(context, &reason);
            Ok(StageEnd::Again(Some(reason)))
        }
        Ending::Failed | Ending::Wrong | Ending::DataLost => bail!("exit code {}", ending.code()),
    }
}

/// Carries out one of this program's own verbs; where that is to be done again because of an error, with its text.
fn own(context: &Context, words: &[String], verb: Verb) -> Result<(Ending, String)> {
    let mut cli = parse::<Cli>(words).map_err(|error| TrainError::Options(error_text(&error)))?;
    cli.output.quiet |= context.quiet;
    match verb(cli) {
        Err(error) if judge(&error) == Ending::Again => Ok((Ending::Again, error_text(&error))),
        ending => Ok((ending?, String::new())),
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
pub(super) fn in_a_group_of_its_own(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    command.process_group(0);
}
