//! Runs of a sweep side by side, each in a child of this program. In: the plan and its runs. Out: their folders.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result};
use vibes_command::Ending;
use vibes_train::sweep::Element;

use super::here::{ended, in_a_group_of_its_own};
use super::{LOOK, cores, say};
use crate::cli::Context;

/// Does all runs, so many at once, each in a child of this program with its share of the cores. What a child says goes into `sweep.log` in its
/// run's folder.
pub(super) fn children(
    context: &Context,
    plan: &Path,
    elements: &[Element],
    jobs: usize,
    stop: &AtomicBool,
) -> Result<Ending> {
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
