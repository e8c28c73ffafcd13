//! Evaluations of an offline run on the way: what is due is saved before them, they can be stopped, and one that a stop or a kill ended is made when the run goes on.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod process;
mod synthetic;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use burn::tensor::Device;
use process::{lines, program, signal, text};
use toml::Table;
use vibes_data::{Recording, RunFolder};
use vibes_train::fit::{End, Event, Go, HeldOut, fit};
use vibes_train::options::Options;
use vibes_train::prepare::prepare;

/// A run on coins, and the grid it is looked at on.
struct Setup {
    recordings: [Recording; 1],
    held_out: HeldOut,
    options: Options,
}

impl Setup {
    fn new(folder: &Path, every: u64, options: &str) -> Self {
        let recordings = [synthetic::recording(&folder.join("coins"), synthetic::SIDE, 4, 20, false)];
        let grid = synthetic::recording(&folder.join("grid"), synthetic::SIDE, 6, 20, true);
        let options = Options::resolve("tiny", &[("the test", options.parse::<Table>().unwrap())]).unwrap();
        Self { recordings, held_out: HeldOut { grid, every, gap_updates: 2 }, options }
    }

    fn go_on(&self, run: &Path, listen: &mut dyn FnMut(Event<'_>) -> Go) -> End {
        let run = prepare(run, &self.recordings, &self.options, None).unwrap();
        fit(&run, &self.recordings, &Device::flex(), Some(&self.held_out), listen).unwrap()
    }
}

/// After how many updates a run was saved, and was evaluated.
fn state(run: &Path) -> (Vec<u64>, Vec<u64>) {
    let evaluated = lines(&run.join("evaluations.jsonl")).iter().map(|line| line["update"].as_u64().unwrap()).collect();
    (RunFolder::at(run).checkpoints(), evaluated)
}

#[test]
fn a_run_that_is_stopped_in_its_evaluations_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let setup = Setup::new(folder.path(), 2, "updates = 4\ncheckpoint_every = 2\nlog_every = 2");
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    assert_eq!(setup.go_on(&whole, &mut |_| Go::On), End::Updates);
    // Stops within the nth evaluation of a call, and looks at what is saved when it begins.
    let stopped_in = |nth: usize| {
        let (mut begun, mut saved) = (0, Vec::new());
        let end = setup.go_on(&parts, &mut |event| match event {
            Event::Evaluating { .. } => {
                begun += 1;
                saved = RunFolder::at(&parts).checkpoints();
                Go::On
            }
            Event::Judging if begun == nth => Go::Stop,
            _ => Go::On,
        });
        (end, saved)
    };
    assert_eq!(stopped_in(1), (End::Stopped, vec![2]), "saved before it is evaluated");
    assert_eq!(state(&parts), (vec![2], Vec::new()));
    assert_eq!(stopped_in(2), (End::Stopped, vec![2, 4]), "that of update 2 is made, and the next one begun");
    assert_eq!(state(&parts), (vec![2, 4], vec![2]));
    assert_eq!(stopped_in(1), (End::Stopped, vec![2, 4]), "the last one is begun anew, and nothing else");
    assert_eq!(setup.go_on(&parts, &mut |_| Go::On), End::Updates);
    assert_eq!(setup.go_on(&parts, &mut |_| Go::On), End::Nothing);
    for file in
        ["evaluations.jsonl", "checkpoints/000004/model.safetensors", "checkpoints/000004/optimizer.safetensors"]
    {
        assert!(fs::read(whole.join(file)).unwrap() == fs::read(parts.join(file)).unwrap(), "{file} differs");
    }
    let page = |run: &Path| fs::read_to_string(run.join("summary.md")).unwrap();
    assert!([&whole, &parts].iter().all(|run| page(run).contains("\n| 4 | ")), "{}", page(&parts));
}

/// Where no checkpoint is due, a stop saves what it interrupts, and a stop before it asks for none.
#[test]
fn an_evaluation_between_checkpoints_is_made_after_the_stop() {
    let folder = tempfile::tempdir().unwrap();
    let setup = Setup::new(folder.path(), 3, "updates = 5\ncheckpoint_every = 100\nlog_every = 100");
    let run = folder.path().join("run");
    let stop_when_begun = &mut |event: Event<'_>| match event {
        Event::Evaluating { .. } => Go::Stop,
        _ => Go::On,
    };
    assert_eq!(setup.go_on(&run, stop_when_begun), End::Stopped);
    assert_eq!(state(&run), (vec![3], Vec::new()));
    let mut evaluated = 0;
    let stop_after_one = &mut |event: Event<'_>| match event {
        Event::Update { update: 4, .. } => Go::Stop,
        Event::Evaluating { .. } => {
            evaluated += 1;
            Go::On
        }
        _ => Go::On,
    };
    assert_eq!(setup.go_on(&run, stop_after_one), End::Stopped);
    assert_eq!(evaluated, 1, "that of update 3, and none of update 4");
    assert_eq!(setup.go_on(&run, &mut |_| Go::On), End::Updates);
    assert_eq!(state(&run), (vec![3, 4, 5], vec![3, 5]));
}

/// Who fits a critic asks more often than who fits none.
#[test]
fn a_stop_is_heard_while_the_critic_of_the_gaps_is_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let evaluated = |name: &str, gap_updates: u64, stop_at: Option<usize>| {
        let folder = folder.path().join(name);
        let mut setup = Setup::new(&folder, 2, "updates = 2\ncheckpoint_every = 2\nlog_every = 2");
        setup.held_out.gap_updates = gap_updates;
        let mut asked = 0;
        let end = setup.go_on(&folder.join("run"), &mut |event| {
            let is_asked = matches!(event, Event::Judging);
            asked += usize::from(is_asked);
            if is_asked && stop_at == Some(asked) { Go::Stop } else { Go::On }
        });
        (end, asked, state(&folder.join("run")).1)
    };
    let (end, without, _) = evaluated("without", 0, None);
    assert_eq!(end, End::Updates);
    assert_eq!(evaluated("with", 25, Some(without + 1)), (End::Stopped, without + 1, Vec::new()));
}

/// Waits until it is so, or the process has ended, or too much time has passed.
fn wait_until(process: &mut Child, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() && process.try_wait().unwrap().is_none() && begun.elapsed() < Duration::from_secs(300) {
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_signal_is_heard_during_an_evaluation() {
    let folder = tempfile::tempdir().unwrap();
    synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false);
    synthetic::recording(&folder.path().join("grid"), synthetic::SIDE, 6, 20, true);
    let run = folder.path().join("run");
    let command = |gap_updates: &str| -> Command {
        let mut command = program();
        command.current_dir(folder.path()).args([
            "offline",
            "coins",
            "--preset",
            "tiny",
            "--updates",
            "2",
            "-o",
            "run",
        ]);
        command.args(["--eval", "grid", "--gap-updates", gap_updates]);
        command
    };
    let mut process = command("100000000").stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    wait_until(&mut process, || run.join("checkpoints/000002").exists());
    signal(&process, "TERM");
    wait_until(&mut process, || false);
    // Ends it where it did not hear.
    let ended = process.try_wait().unwrap();
    process.kill().ok();
    process.wait().unwrap();
    assert_eq!(ended.and_then(|status| status.code()), Some(75), "saved, to be started again");
    assert_eq!(state(&run), (vec![2], Vec::new()));
    let output = command("2").output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    assert_eq!(state(&run), (vec![2], vec![2]));
}
