//! Sweeps through the process: what is done stays done, what was stopped goes on, what differs is refused, and every engine's script works.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

mod process;
mod sweep_plan;
mod synthetic;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use process::signal;
use sweep_plan::{PLAN, PROGRAM, command, folder, run, said, script, states, wait_for, write_plan};

/// Bytes of everything that a run holds and that may not depend on how it was run.
fn results(run: &Path) -> Vec<Vec<u8>> {
    let checkpoints = std::fs::read_dir(run.join("checkpoints")).unwrap();
    let newest = checkpoints.map(|entry| entry.unwrap().path()).max().unwrap();
    [newest.join("model.safetensors"), newest.join("optimizer.safetensors"), run.join("latents.arrow")]
        .map(|path| std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
        .to_vec()
}

#[test]
fn a_plan_is_listed_done_once_and_refused_when_it_changes() {
    let folder = folder(3);
    let folder = folder.path();
    let listed = said(folder, "sweep plan.toml --list", 0);
    assert!(
        listed.contains("3  runs/sweep/latent=6,seed=1")
            && listed.contains("vibes-train encode runs/sweep/latent=4,seed=0 coins")
    );
    assert!(!folder.join("runs").exists(), "listing does nothing");
    assert_eq!(states(folder), ["waiting"; 4]);

    assert!(said(folder, "sweep plan.toml --index 1", 0).contains("run 1 is done"));
    assert_eq!(states(folder), ["waiting", "done", "waiting", "waiting"]);
    let before =
        std::fs::metadata(folder.join("runs/sweep/latent=4,seed=1/latents.arrow")).unwrap().modified().unwrap();
    assert!(said(folder, "sweep plan.toml --index 0-1 -q", 0).is_empty());
    assert!(said(folder, "sweep plan.toml --index 1", 0).contains("run 1 is done already"));
    let after = std::fs::metadata(folder.join("runs/sweep/latent=4,seed=1/latents.arrow")).unwrap().modified().unwrap();
    assert_eq!(before, after, "what is done is not done again");

    write_plan(folder, 5);
    let refused = said(folder, "sweep plan.toml --index 1", 1);
    assert!(refused.contains("stage 1 --updates is 3, in the plan 5") && !refused.contains("--latent is"), "{refused}");
    // Of the four runs two were made by the plan as it was; the table has all of them.
    let table = said(folder, "sweep plan.toml --status", 0);
    assert!(table.contains("made by another plan") && table.contains("2 failed, 2 waiting"), "{table}");
}

#[test]
fn a_damaged_folder_hides_no_other_from_the_table() {
    let folder = folder(3);
    let folder = folder.path();
    let damaged = folder.join("runs/sweep/latent=6,seed=0");
    std::fs::create_dir_all(&damaged).unwrap();
    std::fs::write(damaged.join("sweep.json"), "").unwrap();
    assert_eq!(states(folder), ["waiting", "waiting", "failed", "waiting"]);
    let table = said(folder, "sweep plan.toml --status", 0);
    assert!(table.contains("a sweep.json as `vibes-train sweep` writes it") && table.contains("3 waiting"), "{table}");
}

/// Options come from a file in a stage as they do where it is typed, also from one that the stage before has written.
#[test]
fn a_stage_takes_its_options_from_a_file() {
    let folder = folder(2);
    let folder = folder.path();
    let options = "preset = 'tiny'\nbatch = 2\nlength = 6\ndepth = 4\nhidden = 16\nhead = 16\nupdates = 2\n";
    std::fs::write(folder.join("tiny.toml"), options).unwrap();
    let plan = r#"
output = "runs/sweep"
seeds = 2
stages = [
    "vibes-train offline coins --config tiny.toml --seed {seed} -o {run}/first",
    "vibes-train offline coins --config={run}/first/config.toml --updates 3 -o {run}/second",
]
"#;
    std::fs::write(folder.join("files.toml"), plan).unwrap();
    said(folder, "sweep files.toml --index 1", 0);
    let run = folder.join("runs/sweep/seed=1");
    assert!(run.join("first/checkpoints/000002").exists() && run.join("second/checkpoints/000003").exists());
    for (wrong, right, told) in [
        ("--updtes", "--updates", "--updtes"),
        ("--config tinny.toml", "--config tiny.toml", "cannot read the options: tinny.toml"),
    ] {
        std::fs::write(folder.join("bad.toml"), plan.replace(right, wrong)).unwrap();
        assert!(said(folder, "sweep bad.toml --list", 2).contains(told), "{wrong}");
    }
    // A file that an earlier stage has yet to write is no fault, and a word that no file can mend is.
    let later = plan.replace("{run}/first/config.toml", "{run}/later.toml");
    std::fs::write(folder.join("later.toml"), &later).unwrap();
    said(folder, "sweep later.toml --list", 0);
    std::fs::write(folder.join("bad.toml"), later.replace("--updates", "--updtes")).unwrap();
    assert!(said(folder, "sweep bad.toml --list", 2).contains("--updtes"));
}

#[test]
fn all_runs_at_once_end_with_the_bytes_of_one_after_the_other() {
    let (one, many) = (folder(3), folder(3));
    said(one.path(), "sweep plan.toml --index 0-3", 0);
    said(many.path(), "sweep plan.toml --jobs 3", 0);
    for name in ["latent=4,seed=0", "latent=4,seed=1", "latent=6,seed=0", "latent=6,seed=1"] {
        let place = Path::new("runs/sweep").join(name);
        assert_eq!(results(&one.path().join(&place)), results(&many.path().join(&place)), "{name}");
    }
    assert_eq!(states(many.path()), ["done"; 4]);
}

#[test]
fn every_signal_saves_and_the_same_command_goes_on_to_the_same_bytes() {
    let undisturbed = folder(2000);
    let whole = undisturbed.path();
    write_plan(whole, 12);
    said(whole, "sweep plan.toml --index 2", 0);
    for name in ["TERM", "INT", "USR1", "USR2"] {
        let folder = folder(12);
        let folder = folder.path();
        let run = folder.join("runs/sweep/latent=6,seed=0");
        // Long enough to be met in the middle; the plan's own number of updates afterwards.
        let mut child =
            command(folder, "sweep plan.toml --index 2").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_for(&mut child, || run.join("checkpoints/000002").exists());
        signal(&child, name);
        let code = child.wait().unwrap().code();
        // A run that was quicker than the signal is done.
        assert!(matches!(code, Some(75 | 0)), "{name}: {code:?}");
        if code == Some(75) {
            assert_eq!(states(folder)[2], "saved");
        }
        said(folder, "sweep plan.toml --index 2", 0);
        assert_eq!(results(&run), results(&whole.join("runs/sweep/latent=6,seed=0")), "{name}");
    }
}

#[test]
fn killed_at_any_moment_it_goes_on_to_the_same_bytes() {
    let (whole, killed) = (folder(8), folder(8));
    said(whole.path(), "sweep plan.toml --index 0", 0);
    let place = Path::new("runs/sweep/latent=4,seed=0");
    for file in ["sweep.json", "run.json", "checkpoints/000002", "checkpoints/000006", "latents.arrow"] {
        let mut child = command(killed.path(), "sweep plan.toml --index 0")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        while !killed.path().join(place).join(file).exists() && child.try_wait().unwrap().is_none() {
            assert!(begun.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(1));
        }
        let _ = child.kill();
        child.wait().unwrap();
    }
    said(killed.path(), "sweep plan.toml --index 0", 0);
    assert_eq!(results(&whole.path().join(place)), results(&killed.path().join(place)));
}

#[test]
fn of_two_who_begin_the_same_run_one_is_told_to_come_again() {
    let folder = folder(400);
    let folder = folder.path();
    let mut first =
        command(folder, "sweep plan.toml --index 0").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(&mut first, || folder.join("runs/sweep/latent=4,seed=0/checkpoints/000002").exists());
    let second = said(folder, "sweep plan.toml --index 0", 75);
    assert!(second.contains("is writing here") && second.contains(&format!("process {}", first.id())), "{second}");
    assert_eq!(states(folder)[0], "running");
    let direct = said(folder, "offline coins --preset tiny -o runs/sweep/latent=4,seed=0", 75);
    assert!(direct.contains("is writing here"), "{direct}");
    signal(&first, "TERM");
    assert_eq!(first.wait().unwrap().code(), Some(75));
}

#[test]
fn one_failing_run_keeps_no_other_from_being_done_and_is_tried_again() {
    let folder = folder(2);
    let folder = folder.path();
    let plan = std::fs::read_to_string(folder.join("plan.toml"))
        .unwrap()
        .replace("encode {run} coins", "encode {run} coins{latent}");
    std::fs::write(folder.join("plan.toml"), plan).unwrap();
    std::os::unix::fs::symlink(folder.join("coins"), folder.join("coins4")).unwrap();
    let failed = said(folder, "sweep plan.toml --jobs 2", 1);
    assert!(failed.contains("2 of 4 runs failed: 2, 3"), "{failed}");
    assert_eq!(states(folder), ["done", "done", "failed", "failed"]);
    let table = said(folder, "sweep plan.toml --status", 0);
    assert!(table.contains("no recording here") && table.contains("2 done, 0 running, 0 saved, 2 failed"), "{table}");
    std::os::unix::fs::symlink(folder.join("coins"), folder.join("coins6")).unwrap();
    said(folder, "sweep plan.toml --jobs 2", 0);
    assert_eq!(states(folder), ["done"; 4]);
}

#[test]
fn a_time_limit_saves_without_any_signal() {
    let folder = folder(100_000);
    let folder = folder.path();
    let told = said(folder, "sweep plan.toml --jobs 2 --stop-after 3s", 75);
    assert!(told.contains("the same command goes on"), "{told}");
    assert_eq!(states(folder)[0], "saved");
    assert!(said(folder, "sweep plan.toml --stop-after 3s", 2).contains("add --index N or --jobs K"));
}

#[test]
fn a_stage_that_could_not_be_read_is_refused_before_anything_runs() {
    let folder = folder(2);
    let folder = folder.path();
    for (find, put, wanted) in [
        ("--latent", "--latnet", "--latnet"),
        ("vibes-train encode {run} coins", "vibes-train sweep plan.toml", "a sweep inside a sweep"),
        ("{seed}", "{sed}", "no stage uses the setting seed"),
        ("--preset tiny", "--preset tinny", "no preset `tinny`"),
        ("--batch 2", "--batch 2 --objective nonsense", "no objective `nonsense`"),
        ("--batch 2", "--batch 2 --objective no-adversary --clip none", "--clip has no effect"),
        ("--batch 2", "--batch 0", "--batch is 0"),
        ("offline coins --preset tiny", "online --task known-slide --preset tinny", "no preset `tinny`"),
    ] {
        let text = PLAN.replace("UPDATES", "2").replace(find, put);
        std::fs::write(folder.join("bad.toml"), text).unwrap();
        let told = said(folder, "sweep bad.toml --index 0", 2);
        assert!(told.contains(wanted), "{told}");
        assert!(!folder.join("runs").exists());
    }
    assert!(said(folder, "sweep plan.toml --index slurm", 2).contains("SLURM_ARRAY_TASK_ID"));
    assert!(said(folder, "sweep plan.toml --index 4", 2).contains("0 to 3"));
}

/// What a stage waits for is said once, in the table too, and its command line is not said again whenever it is tried.
#[test]
fn a_stage_whose_folder_is_busy_says_once_what_it_waits_for() {
    let folder = folder(2);
    let folder = folder.path();
    let text =
        PLAN.replace("UPDATES", "2").replace("-o {run}", "-o {run}/own").replace("encode {run}", "encode {run}/own");
    std::fs::write(folder.join("plan.toml"), text).unwrap();
    let busy = folder.join("runs/sweep/latent=4,seed=0/own");
    let lock = vibes_data::FolderLock::acquire(&busy).unwrap();
    let mut sweep =
        command(folder, "sweep plan.toml --index 0").stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let table = || said(folder, "sweep plan.toml --status", 0);
    wait_for(&mut sweep, || table().contains("; waiting: "));
    assert!(table().contains("is writing here") && states(folder)[0] == "running", "{}", table());
    // Long enough for the stage to be tried again.
    std::thread::sleep(Duration::from_millis(1500));
    drop(lock);
    let output = sweep.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert_eq!((told.matches("waiting: ").count(), told.matches("vibes-train offline ").count()), (1, 1), "{told}");
    assert!(states(folder)[0] == "done" && !table().contains("waiting: "), "{}", table());
}

#[test]
fn slurms_script_saves_on_the_signal_queues_itself_again_and_finishes() {
    let folder = folder(60);
    let folder = folder.path();
    let text = String::from_utf8(run(folder, "sweep plan.toml --script slurm --jobs 2").stdout).unwrap();
    assert!(text.contains("#SBATCH --array=0-3%2") && text.contains("#SBATCH --signal=B:USR1@120"), "{text}");
    std::fs::write(folder.join("job.sh"), &text).unwrap();
    // Stand-ins: sbatch runs every element and, once for each, signals the batch shell as soon as there is a checkpoint; scontrol keeps a list of
    // what is queued again, which sbatch then runs from the beginning with the same index, as Slurm does.
    let tools = folder.join("tools");
    std::fs::create_dir_all(&tools).unwrap();
    std::os::unix::fs::symlink(PROGRAM, tools.join("vibes-train")).unwrap();
    script(&tools.join("scontrol"), "#!/bin/bash\n[ \"$1\" = requeue ] || exit 1\necho \"$2\" >>requeued\n");
    script(
        &tools.join("sbatch"),
        r#"#!/bin/bash
export SLURM_ARRAY_JOB_ID=7
for index in 0 1 2 3; do
    export SLURM_ARRAY_TASK_ID=$index
    for attempt in 1 2 3 4; do
        before=$(cat requeued 2>/dev/null | wc -l)
        bash "$1" & job=$!
        if [ $attempt = 1 ]; then
            until [ "$(ls -d runs/sweep/*/checkpoints/[0-9]* 2>/dev/null | cut -d/ -f3 | sort -u | wc -l)" -gt $index ]; do
                kill -0 $job 2>/dev/null || break
                sleep 0.02
            done
            kill -USR1 $job
        fi
        wait $job; echo "$index $attempt $?" >>codes
        [ "$(cat requeued 2>/dev/null | wc -l)" -gt "$before" ] || break
    done
done
"#,
    );
    let path = format!("{}:{}", tools.display(), std::env::var("PATH").unwrap());
    let output =
        Command::new("bash").args(["-c", "sbatch job.sh"]).current_dir(folder).env("PATH", path).output().unwrap();
    let codes = std::fs::read_to_string(folder.join("codes")).unwrap();
    assert_eq!(states(folder), ["done"; 4], "{codes}\n{}", String::from_utf8_lossy(&output.stderr));
    let requeued = std::fs::read_to_string(folder.join("requeued")).unwrap_or_default();
    assert!(
        requeued.lines().count() >= 3 && requeued.lines().all(|line| line.starts_with("7_")),
        "{requeued}\n{codes}"
    );
    for line in codes.lines() {
        assert!(line.ends_with(" 75") || line.ends_with(" 0"), "{codes}");
    }
}

#[test]
fn the_script_for_xargs_does_every_run() {
    let folder = folder(2);
    let folder = folder.path();
    let text = String::from_utf8(run(folder, "sweep plan.toml --script xargs --jobs 2").stdout).unwrap();
    let tools = Path::new(PROGRAM).parent().unwrap();
    let path = format!("{}:{}", tools.display(), std::env::var("PATH").unwrap());
    let status = Command::new("bash").args(["-c", &text]).current_dir("/").env("PATH", path).output().unwrap();
    assert!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    assert_eq!(states(folder), ["done"; 4]);
    // Its numbers mean the runs of the plan that it was made from, and no others.
    let other = PLAN.replace("UPDATES", "2").replace("[4, 6]", "[4, 8]");
    std::fs::write(folder.join("plan.toml"), other).unwrap();
    let path = format!("{}:{}", tools.display(), std::env::var("PATH").unwrap());
    let refused = Command::new("bash").args(["-c", &text]).current_dir("/").env("PATH", path).output().unwrap();
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && told.contains("print it again with --script"), "{told}");
    assert_eq!(states(folder), ["done", "done", "waiting", "waiting"]);
    let parallel = String::from_utf8(run(folder, "sweep plan.toml --script parallel").stdout).unwrap();
    assert!(parallel.contains("parallel -q --jobs") && parallel.contains("--index {}"), "{parallel}");
}
