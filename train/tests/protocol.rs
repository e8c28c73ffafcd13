//! A run under a protocol as a process: that it is named in all that is said of it. The protocol's 500,000 control steps take hours, so that a run of its settings is lived through for two
//! episodes here, and then said to have come to its end.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;

use std::path::Path;
use std::process::Output;

use burn::tensor::Device;
use serde_json::Value as Json;
use vibes_data::{Recording, RunFolder};
use vibes_train::fit::{End, Go};
use vibes_train::online::options::OnlineOptions;
use vibes_train::online::prepare::{default_options, default_world, from_nothing};
use vibes_train::online::protocol::Protocol;
use vibes_train::online::{Setup, online};
use vibes_train::options::Options;

const NAME: &str = "dcs-easy-dynamic-500k";

/// A run with the protocol's settings at `path`, whose newest checkpoint says that it has come to its end.
fn run_at_its_end(path: &Path) {
    let mut options = default_options(default_world("cartpole-swingup").unwrap(), false);
    options.settle(Protocol::DcsEasyDynamic500k);
    options.prefill = 1;
    let prepared = from_nothing(path, &Options::preset("tiny").unwrap(), options).unwrap();
    let brief = OnlineOptions {
        control_steps: 2000,
        rows_per_step: 1.0,
        first_updates: 2,
        evaluate_every: 0,
        final_episodes: 1,
        ..prepared.options.clone()
    };
    let setup = Setup { run: &prepared.run, options: &brief, given: &[], device: &Device::flex() };
    assert_eq!(online(&setup, &mut |_| Go::On).unwrap(), End::Updates);
    let file = RunFolder::at(path).newest_checkpoint().unwrap().join("online.json");
    let mut state: Json = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    state["control_steps"] = 500_000.into();
    std::fs::write(&file, state.to_string()).unwrap();
}

/// What a verb says of the run.
fn said(verb: &str, run: &Path, more: &[&str]) -> Output {
    let output = process::program().arg(verb).arg(run).args(more).output().unwrap();
    assert!(output.status.success(), "{verb}: {}", process::text(&output));
    output
}

#[test]
fn the_protocol_is_named_in_all_that_is_said_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    run_at_its_end(&run);
    let stdout = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned();
    let ended = said("online", &run, &[]);
    assert!(stdout(&ended).contains(&format!("already, under {NAME} (videos procedural); mean return")), "at the end");
    assert!(String::from_utf8_lossy(&ended.stderr).contains(&format!(", under {NAME} (videos")), "at the start");
    let json = |verb: &str| -> Json { serde_json::from_slice(&said(verb, &run, &["--json"]).stdout).unwrap() };
    let (ended, info) = (json("online"), json("info"));
    assert_eq!((&ended["protocol"], &ended["evaluation"]["protocol"]), (&NAME.into(), &NAME.into()));
    assert_eq!(info["online"]["protocol"], NAME);
    assert!(stdout(&said("info", &run, &[])).contains(&format!("protocol     {NAME}, videos procedural")));
    for file in ["metrics.jsonl", "evaluations.jsonl"] {
        let lines = process::lines(&run.join(file));
        assert!(!lines.is_empty() && lines.iter().all(|line| line["protocol"] == NAME), "{file}");
    }
    let page = std::fs::read_to_string(run.join("summary.md")).unwrap();
    assert!(
        page.contains(&format!("* protocol {NAME}, videos procedural; its last evaluation is the last one")),
        "{page}"
    );
    assert_eq!(Recording::open(&run.join("replay")).unwrap().manifest().options["protocol"], NAME);
}
