//! The runs in `checkpoints/`: each one opens, encodes its own task, and acts if it was trained to; all are small enough for a repository.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::path::{Path, PathBuf};
use std::process::Command;

use vibes_data::Latents;
use vibes_tests::program;

/// Most bytes of all runs that were trained offline, and of all that were trained online.
const MOST: u64 = 10_000_000;

fn json(folder: &Path, line: &[&str]) -> serde_json::Value {
    let output = Command::new(program(line[0])).args(&line[1..]).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{line:?}\n{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What `vibes-train keep` writes into a copy. Beside it lie figures, latents and evaluations of whoever has used the copy, which git ignores.
const WRITTEN: [&str; 7] =
    ["checkpoints", "config.toml", "evaluations.jsonl", "metrics.jsonl", "online.json", "run.json", "summary.md"];

/// Bytes of what `keep` has written.
fn bytes(run: &Path) -> u64 {
    fn whole(path: &Path) -> u64 {
        if path.is_dir() {
            return std::fs::read_dir(path).unwrap().map(|entry| whole(&entry.unwrap().path())).sum();
        }
        let is_table = path.extension().is_some_and(|extension| extension == "arrow");
        if is_table { 0 } else { path.metadata().unwrap().len() }
    }
    let written = WRITTEN.iter().map(|name| run.join(name)).filter(|path| path.exists());
    written.map(|path| whole(&path)).sum()
}

/// The runs, and whether each can act.
fn kept() -> Vec<(PathBuf, bool)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../checkpoints").canonicalize().unwrap();
    let mut runs: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    runs.retain(|path| path.is_dir());
    runs.sort();
    runs.into_iter().map(|run| (run.clone(), run.join("online.json").exists())).collect()
}

#[test]
fn every_kept_run_encodes_its_task_and_acts_if_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for acts in [false, true] {
        assert!(kept().iter().filter(|kept| kept.1 == acts).count() >= 2, "two tasks, acting: {acts}");
    }
    for (run, acts) in kept() {
        let name = run.file_name().unwrap().to_str().unwrap().to_owned();
        let path = run.to_str().unwrap();
        let info = json(folder, &["vibes-train", "info", path, "--json"]);
        let model = &info["info"]["model"];
        let (task, latent) = (model["task"].as_str().unwrap(), model["latent"].as_u64().unwrap());
        let policy = if acts { path } else { "random" };
        let recording = format!("recordings/{name}");
        let mut record = vec!["vibes-collect", "--policy", policy, "--episodes", "1", "--steps", "12"];
        record.extend(["--no-mcap", "--json", "-o", &recording]);
        // A run that acts knows its task and its world.
        if !acts {
            record.extend(["--task", task, "--video-set", "val", "--video-count", "1"]);
        }
        let said = json(folder, &record);
        assert_eq!(said["returns"].as_array().unwrap().len(), 1, "{name}: {said}");
        let output = format!("{name}.arrow");
        json(folder, &["vibes-train", "encode", path, &recording, "-o", &output, "--json"]);
        let latents = Latents::read(&folder.join(&output)).unwrap();
        assert_eq!((latents.len(), latents.dims as u64), (13, latent), "{name}");
        assert!(latents.latent.iter().all(|number| number.is_finite()), "{name}");
    }
}

#[test]
fn the_kept_runs_are_small() {
    for online in [false, true] {
        let sizes = kept().into_iter().filter(|(_, acts)| *acts == online).map(|(run, _)| bytes(&run));
        let total: u64 = sizes.sum();
        assert!(total <= MOST, "{total} bytes of kept runs, online: {online}");
        assert!(total > MOST / 100, "{total} bytes of kept runs, online: {online}: the test reads the wrong files");
    }
}

#[test]
fn what_is_made_from_a_kept_run_does_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path();
    let file = |name: &str, size: usize| {
        let path = run.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, vec![0; size]).unwrap();
    };
    file("run.json", 1);
    file("checkpoints/000002/model.safetensors", 20);
    assert_eq!(bytes(run), 21);
    for name in ["latents.arrow", "figures/grid.png", "evaluation.json", "checkpoints/000002/latents.arrow"] {
        file(name, 300);
    }
    assert_eq!(bytes(run), 21);
}
