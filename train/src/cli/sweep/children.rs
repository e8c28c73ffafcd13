//! Runs of a sweep side by side, each in a child of this program. In: the plan and its runs. Out: their folders.

use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result};
use vibes_command::Ending;
use vibes_train::sweep::{self, Element, State};

use super::here::in_a_group_of_its_own;
use super::tally::Tally;
use super::{LOOK, cores, say};
use crate::cli::Context;

/// How many threads a process computes with.
const THREADS: &str = "RAYON_NUM_THREADS";

/// Does all runs, so many at once, each in a child of this program with its share of the cores. What a child says goes into `sweep.log` in its
/// run's folder.
pub(super) fn children(
    context: &Context,
    plan: &Path,
    elements: &[Element],
    jobs: usize,
    stop: &AtomicBool,
) -> Result<Ending> {
    let threads = share(std::env::var_os(THREADS).is_some(), cores(), jobs.min(elements.len()));
    let mut waiting = elements.iter();
    let mut running: Vec<(&Element, Child)> = Vec::new();
    let mut tally = Tally::of(elements.len());
    loop {
        while running.len() < jobs && !stop.load(Ordering::Relaxed) {
            let Some(element) = waiting.next() else { break };
            say(context, &format!("run {}: {}", element.index, element.name));
            running.push((element, child(plan, element, threads)?));
        }
        if stop.load(Ordering::Relaxed) {
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
                Some(status) => note(context, element, status, &mut tally),
            }
        }
        running = going;
    }
    tally.unbegun = waiting.len();
    tally.end(context)
}

/// How many threads each of so many children is told to use; none where whoever started this has said it for all of them.
fn share(is_said: bool, cores: usize, children: usize) -> Option<usize> {
    (!is_said).then(|| (cores / children.max(1)).max(1))
}

/// Notes how a child ended. One exit code says that it was saved and that another process is at its run: the run's files know which.
fn note(context: &Context, element: &Element, status: ExitStatus, tally: &mut Tally) {
    let index = element.index;
    let is_again = status.code() == Some(i32::from(Ending::Again.code()));
    let found = is_again.then(|| sweep::status(element));
    let state = found.as_ref().map(|found| found.state);
    match state {
        None if status.success() => say(context, &format!("run {index} is done")),
        // By the process that was at it.
        Some(State::Done) => say(context, &format!("run {index} is done")),
        Some(State::Running) => {
            let owner = found.and_then(|found| found.note).unwrap_or_default();
            eprintln!("run {index} is busy: {owner}");
            tally.busy.push(index);
        }
        Some(State::Saved | State::Waiting) => {
            say(context, &format!("run {index} is saved"));
            tally.saved.push(index);
        }
        None | Some(State::Failed) => {
            eprintln!("run {index} failed ({status}): {}", element.folder.join("sweep.log").display());
            tally.failed.push(index);
        }
    }
}

/// Starts the child of one run. It reads the plan anew, and is told which run was meant by the number.
fn child(plan: &Path, element: &Element, threads: Option<usize>) -> Result<Child> {
    std::fs::create_dir_all(&element.folder).with_context(|| format!("cannot create {}", element.folder.display()))?;
    let path = element.folder.join("sweep.log");
    let open = || std::fs::OpenOptions::new().create(true).append(true).open(&path);
    let log = open().with_context(|| format!("cannot write {}", path.display()))?;
    let mut command = Command::new(std::env::current_exe().context("cannot find this program")?);
    command.arg("sweep").arg(plan).args(["--until-closed", "--run-is", &element.digest()]);
    command.arg("--index").arg(element.index.to_string());
    command.envs(threads.map(|threads| (THREADS, threads.to_string())));
    command.stdin(Stdio::piped()).stdout(log.try_clone()?).stderr(log);
    in_a_group_of_its_own(&mut command);
    command.spawn().context("cannot start a run")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cores_are_divided_unless_threads_are_said() {
        assert_eq!(share(false, 8, 3), Some(2));
        assert_eq!(share(false, 2, 4), Some(1), "one at least");
        assert_eq!(share(true, 8, 3), None, "what was said holds for every child");
    }
}
