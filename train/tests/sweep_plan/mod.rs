//! A small plan, and sweeps of it as processes: what they say, what they exit with, and how far every run is.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test program uses some of these, and fails by panicking"
)]

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output};
use std::time::{Duration, Instant};

use crate::synthetic;

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_vibes-train");

pub const PLAN: &str = r#"
output = "runs/sweep"
seeds = 2
stages = [
    "vibes-train offline coins --preset tiny --batch 2 --length 6 --depth 4 --hidden 16 --head 16 --latent {latent} --updates UPDATES --checkpoint-every 2 --log-every 1 --seed {seed} -o {run}",
    "vibes-train encode {run} coins",
]
[grid]
latent = [4, 6]
"#;

pub fn folder(updates: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 3, 20, false);
    write_plan(folder.path(), updates);
    folder
}

pub fn write_plan(folder: &Path, updates: u32) {
    std::fs::write(folder.join("plan.toml"), PLAN.replace("UPDATES", &updates.to_string())).unwrap();
}

pub fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(arguments.split_whitespace()).current_dir(folder).env("RAYON_NUM_THREADS", "1");
    command
}

pub fn run(folder: &Path, arguments: &str) -> Output {
    command(folder, arguments).output().unwrap()
}

/// What a command that ends with this code says on both streams.
pub fn said(folder: &Path, arguments: &str, code: i32) -> String {
    let output = run(folder, arguments);
    let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments}\n{said}");
    said
}

pub fn states(folder: &Path) -> Vec<String> {
    let output = run(folder, "sweep plan.toml --status --json");
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    all.as_array().unwrap().iter().map(|status| status["state"].as_str().unwrap().to_owned()).collect()
}

pub fn wait_for(child: &mut Child, moment: impl Fn() -> bool) {
    let begun = Instant::now();
    while !moment() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before the moment came");
        assert!(begun.elapsed() < Duration::from_secs(120), "the moment never comes");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Writes an executable script.
pub fn script(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, PermissionsExt::from_mode(0o755)).unwrap();
}
