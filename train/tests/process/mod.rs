//! Runs of `vibes-train` as processes, and what lasts of a run folder: for tests of what it leaves behind however it ended.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test program uses some of these, and fails by panicking"
)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value as Json;

/// The program with one thread and nothing to read.
pub fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vibes-train"));
    command.env("RAYON_NUM_THREADS", "1").stdin(Stdio::null());
    command
}

/// Everything that was said.
pub fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Sends a signal by its name, as `TERM`.
pub fn signal(child: &Child, name: &str) {
    let signal: nix::sys::signal::Signal = format!("SIG{name}").parse().unwrap();
    nix::sys::signal::kill(nix::unistd::Pid::from_raw(child.id() as i32), signal).unwrap();
}

pub fn lines(path: &Path) -> Vec<Json> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Bytes of every file below a folder, by its place.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, std::fs::read(&path).unwrap());
        }
    }
    found
}

/// What must be the same however often a run was stopped: everything but how long it took.
pub fn lasting(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let clocks = ["seconds", "updates_per_second", "frames_per_second", "waiting_share"];
    let online = ["control_steps_per_second", "waiting_for_actor_share", "acting_share"];
    let timeless = |mut line: Json| {
        for clock in clocks.iter().chain(&online) {
            line.as_object_mut().unwrap().remove(*clock);
        }
        line.to_string()
    };
    let is_kept = |name: &str| !name.starts_with("events.") && name != "summary.md" && !name.ends_with(".lock");
    files(folder)
        .into_iter()
        .filter(|(name, _)| is_kept(name))
        .map(|(name, bytes)| {
            let text = || String::from_utf8(bytes.clone()).unwrap();
            let bytes = if name.ends_with(".jsonl") {
                let lines = text();
                let lines = lines.lines().map(|line| timeless(serde_json::from_str(line).unwrap()) + "\n");
                lines.collect::<String>().into_bytes()
            } else if name.ends_with("/state.json") {
                timeless(serde_json::from_str(&text()).unwrap()).into_bytes()
            } else {
                bytes
            };
            (name, bytes)
        })
        .collect()
}

/// That two runs left the same behind.
pub fn assert_same(wanted: &Path, found: &Path, after: &str) {
    let (wanted, found) = (lasting(wanted), lasting(found));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&wanted), "{after}");
    for (name, bytes) in wanted {
        assert!(found[&name] == bytes, "{name} differs {after}");
    }
}

/// Kills the command at random moments until it ends by itself, and then lets it end; returns how often it was killed. A slower machine is given longer after a while.
pub fn kill_until_done(command: impl Fn() -> Command, between: std::ops::Range<u64>) -> u32 {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut kills = 0;
    for attempt in 0..40 {
        let mut process = command().stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(rng.random_range(between.clone()) * (1 + attempt / 5)));
        if let Some(status) = process.try_wait().unwrap() {
            assert!(status.success(), "{status}");
            break;
        }
        process.kill().unwrap();
        process.wait().unwrap();
        kills += 1;
    }
    let output = command().output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    kills
}
