//! Sweeps that are disturbed: killed between a stage's work and its note, beside another process that is at one of the runs, under a plan that changes meanwhile.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

mod process;
mod sweep_plan;
mod synthetic;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use process::text;
use sweep_plan::{PLAN, PROGRAM, command, folder, said, script, states, wait_for, write_plan};
use vibes_data::FolderLock;

/// Like the program of that name it makes a folder that must not be there yet, whole or not at all. The first time, the sweep is killed as soon as it is there.
const COLLECT: &str = r#"#!/bin/bash
out=$5
if [ -e "$out" ]; then
    echo "something is here already; name a new folder with -o: $out" >&2
    exit 1
fi
cp -r "$2" "$out.making" && mv "$out.making" "$out" || exit 1
[ -e killed ] && exit 0
touch killed
kill -KILL $PPID
"#;

const MERGING: &str = r#"
output = "runs/sweep"
stages = [
    "vibes-collect merge coins coins -o {run}/all",
    "vibes-train offline {run}/all --preset tiny --batch 2 --length 6 --depth 4 --hidden 16 --head 16 --updates 2 -o {run}/own",
    "vibes-train keep {run}/own -o {run}/small",
]
"#;

/// The program in a folder where the stand-in for `vibes-collect` is the one beside it.
fn with_stand_in(folder: &Path) -> PathBuf {
    let programs = folder.join("programs");
    std::fs::create_dir(&programs).unwrap();
    script(&programs.join("vibes-collect"), COLLECT);
    let own = programs.join("vibes-train");
    // The simulator's library is looked for beside the program. Another disk takes a copy.
    std::os::unix::fs::symlink(Path::new(PROGRAM).with_file_name("lib"), programs.join("lib")).unwrap();
    std::fs::hard_link(PROGRAM, &own).or_else(|_| std::fs::copy(PROGRAM, &own).map(|_bytes| ())).unwrap();
    own
}

fn sweep(program: &Path, folder: &Path) -> Output {
    let mut command = Command::new(program);
    command.args(["sweep", "plan.toml", "--index", "0"]).current_dir(folder).env("RAYON_NUM_THREADS", "1");
    command.output().unwrap()
}

fn mark(run: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(run.join("sweep.json")).unwrap()).unwrap()
}

/// Takes the last stage for one that was killed when all that it made was there, `makes` being what it had noted before.
fn as_killed(run: &Path, makes: &[&str]) {
    let mut mark = mark(run);
    mark["finished"] = 2.into();
    mark["makes"] = makes.into();
    std::fs::write(run.join("sweep.json"), mark.to_string()).unwrap();
}

#[test]
fn killed_behind_a_stage_that_refuses_its_own_output_it_goes_on() {
    let folder = folder(2);
    let folder = folder.path();
    std::fs::write(folder.join("plan.toml"), MERGING).unwrap();
    let program = with_stand_in(folder);
    let run = folder.join("runs/sweep/run");
    let killed = sweep(&program, folder);
    assert_eq!(killed.status.code(), None, "it was killed: {}", text(&killed));
    assert!(run.join("all/manifest.json").is_file() && mark(&run)["finished"] == 0, "{}", mark(&run));
    let done = sweep(&program, folder);
    assert!(done.status.success(), "{}", text(&done));
    assert!(run.join("small/run.json").is_file() && mark(&run)["makes"].is_null(), "{}", mark(&run));
    let page = || std::fs::read_to_string(run.join("small/summary.md")).unwrap();
    assert!(page().starts_with("# small\n"), "{}", page());

    // The same of `keep`, which a kill may also meet in the middle of its copy.
    as_killed(&run, &["small"]);
    std::fs::create_dir_all(run.join(".small.making/small")).unwrap();
    std::fs::write(run.join(".small.making/small/half"), "").unwrap();
    let done = sweep(&program, folder);
    assert!(done.status.success(), "{}", text(&done));
    assert!(run.join("small/run.json").is_file() && !run.join("small/half").exists());
    assert!(!run.join(".small.making").exists(), "nothing of the half copy is left");

    // What nobody has noted was there before the stage, and stays.
    as_killed(&run, &[]);
    std::fs::write(run.join("small/mine"), "").unwrap();
    for _ in 0..2 {
        let refused = sweep(&program, folder);
        assert!(text(&refused).contains("name a folder that is not there yet"), "{}", text(&refused));
        assert!(refused.status.code() == Some(2) && run.join("small/mine").is_file(), "{}", text(&refused));
    }
}

#[test]
fn a_run_that_the_plan_has_lost_meanwhile_is_not_done_by_its_number() {
    let folder = folder(60);
    let folder = folder.path();
    let mut sweep =
        command(folder, "sweep plan.toml --jobs 1").stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(&mut sweep, || folder.join("runs/sweep/latent=4,seed=0/checkpoints/000002").exists());
    let changed = PLAN.replace("UPDATES", "60").replace("[4, 6]", "[4, 8]");
    std::fs::write(folder.join("plan.toml"), changed).unwrap();
    let ended = sweep.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(1), "{}", text(&ended));
    assert!(text(&ended).contains("2 of 4 runs failed: 2, 3; the others are done"), "{}", text(&ended));
    let log = std::fs::read_to_string(folder.join("runs/sweep/latent=6,seed=0/sweep.log")).unwrap();
    assert!(log.contains("run 2 of the plan is latent=8,seed=0 now"), "{log}");
    assert!(!folder.join("runs/sweep/latent=8,seed=0").exists(), "nobody has asked for it");
    assert_eq!(states(folder), ["done", "done", "waiting", "waiting"]);
    let listed = said(folder, "sweep plan.toml --list --json", 0);
    let listed: serde_json::Value = serde_json::from_str(&listed).unwrap();
    let digest = listed[0]["digest"].as_str().unwrap();
    said(folder, &format!("sweep plan.toml --index 0 --run-is {digest}"), 0);
    said(folder, &format!("sweep plan.toml --index 1 --run-is {digest}"), 2);
    // A run of the same name that does something else is another, too.
    write_plan(folder, 61);
    let refused = said(folder, &format!("sweep plan.toml --index 0 --run-is {digest}"), 2);
    assert!(refused.contains("not as it was when the sweep began"), "{refused}");
}

#[test]
fn a_busy_run_keeps_no_other_from_being_done_and_is_not_called_saved() {
    let folder = folder(2);
    let folder = folder.path();
    let plan = PLAN.replace("UPDATES", "2").replace("encode {run} coins", "encode {run} coins{latent}");
    std::fs::write(folder.join("plan.toml"), plan).unwrap();
    std::os::unix::fs::symlink(folder.join("coins"), folder.join("coins4")).unwrap();
    let lock = FolderLock::acquire_beside(&folder.join("runs/sweep/latent=4,seed=0")).unwrap();
    let process = format!("(process {}", std::process::id());
    let says_saved = |told: &str| ["and saved", "is saved"].iter().any(|word| told.contains(*word));
    for way in ["--index 0-3", "--jobs 2"] {
        let told = said(folder, &format!("sweep plan.toml {way}"), 1);
        let wanted = "2 of 4 runs failed: 2, 3; 1 of 4 runs are busy with another process: 0; the others are done";
        assert!(told.contains(wanted) && told.contains("run 0 is busy: ") && told.contains(&process), "{way}: {told}");
        assert!(!says_saved(&told), "{way}: {told}");
    }
    assert_eq!(states(folder), ["running", "done", "failed", "failed"]);
    std::os::unix::fs::symlink(folder.join("coins"), folder.join("coins6")).unwrap();
    for way in ["--index 0-3", "--jobs 2"] {
        let told = said(folder, &format!("sweep plan.toml {way}"), 75);
        let wanted = "1 of 4 runs are busy with another process: 0; the others are done; the same command goes on";
        assert!(told.contains(wanted) && !says_saved(&told), "{way}: {told}");
    }
    assert!(said(folder, "sweep plan.toml --index 0", 75).contains("is writing here"), "one alone says who it is");
    drop(lock);
    said(folder, "sweep plan.toml --index 0-3", 0);
    assert_eq!(states(folder), ["done"; 4]);
}
