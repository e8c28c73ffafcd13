//! Memory does not grow with the number of episodes, and with the length of one by no more copies of its pictures than the recorder has to make.

#![cfg(target_os = "linux")]
#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod process;

use std::path::Path;
use std::process::Stdio;

/// The most memory a command held, in megabytes, as the system said last before it ended.
fn peak(folder: &Path, arguments: &str) -> u64 {
    let mut child = process::command(folder, arguments).stdout(Stdio::null()).spawn().unwrap();
    let mut kilobytes = 0;
    while child.try_wait().unwrap().is_none() {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok()).unwrap_or(kilobytes);
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(child.wait().unwrap().success(), "{arguments}");
    kilobytes / 1000
}

#[test]
fn many_episodes_take_no_more_memory_than_few() {
    let folder = tempfile::tempdir().unwrap();
    for distract in ["none", "all"] {
        let options = format!("--steps 2 --size 32 --no-mcap --threads 2 --distract {distract}");
        let few = peak(folder.path(), &format!("--episodes 6 {options} -o few-{distract}"));
        let many = peak(folder.path(), &format!("--episodes 90 {options} -o many-{distract}"));
        assert!(few > 0 && many < 600, "{distract}: {many} MB");
        assert!(many < few + 60, "{distract}: {few} MB for 6 episodes, {many} MB for 90");
    }
}

/// The pictures as they were drawn, as Arrow's message and as the bytes of the file: one copy more is a sixth of all memory here.
#[test]
fn a_long_episode_is_in_memory_three_times_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let peak_of = |steps: u64| {
        let options = format!("--episodes 1 --steps {steps} --size 84 --no-mcap --threads 1 --distract none");
        peak(folder.path(), &format!("{options} -o long-{steps}"))
    };
    let pictures = |steps: u64| steps * 84 * 84 * 3 / 1_000_000;
    let (short, long) = (peak_of(30), peak_of(3000));
    let most = (pictures(3000) - pictures(30)) * 36 / 10;
    assert!(short > 0 && long - short < most, "{short} MB for 30 steps, {long} MB for 3000; {most} MB more may be");
}
