//! What the command lines of the three programs have in common, through the processes: options from a file, how much is said, exit codes.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::collections::BTreeSet;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use vibes_tests::program;

fn run(folder: &Path, line: &str) -> Output {
    let mut words = line.split_whitespace();
    let program = program(words.next().unwrap());
    Command::new(program).args(words).current_dir(folder).output().unwrap()
}

/// What is said on standard error, for a line that ends with this exit code.
fn said(folder: &Path, line: &str, code: i32) -> String {
    let output = run(folder, line);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{line}\n{said}{}", String::from_utf8_lossy(&output.stdout));
    said
}

/// A verb of each program that does little, and an option of it with a value that is not its default.
const LINES: [(&str, &str, &str); 3] = [
    ("vibes-collect", "--episodes 1 --steps 3 --size 8 --video-count 1 --no-mcap -o made", "seed = 7"),
    ("vibes-train", "bench --preset tiny --size 16 --repeats 1", "batch = 2"),
    ("vibes-analyze", "curves run", "note = \"early\""),
];

/// A folder with a run in it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    std::fs::create_dir_all(&run).unwrap();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("../checkpoints/cartpole-swingup");
    std::fs::copy(kept.join("run.json"), run.join("run.json")).unwrap();
    std::fs::write(run.join("metrics.jsonl"), METRICS).unwrap();
    folder
}

const METRICS: &str = r#"{"update":20,"objective":1.0,"dynamics_log_likelihood":1.0,"reward_log_likelihood":1.0,"gradient_norm":1.0,"encoder_gradient_norm":1.0,"batch_effective_rank":2.0,"latent_variance":0.5,"updates_per_second":3.0,"frames_per_second":30.0,"waiting_share":0.0}
{"update":40,"objective":2.0,"dynamics_log_likelihood":1.5,"reward_log_likelihood":1.0,"gradient_norm":1.0,"encoder_gradient_norm":1.0,"batch_effective_rank":2.5,"latent_variance":0.5,"updates_per_second":3.0,"frames_per_second":30.0,"waiting_share":0.0}
"#;

#[test]
fn options_come_from_a_file_wherever_it_is_named() {
    let folder = folder();
    let folder = folder.path();
    for (name, rest, option) in LINES {
        std::fs::write(folder.join("options.toml"), format!("{option}\nverbose = true\n")).unwrap();
        for line in [
            format!("{name} --config options.toml {rest}"),
            format!("{name} --config=options.toml {rest}"),
            format!("{name} {rest} --config options.toml"),
            format!("{name} {rest} --config=options.toml"),
        ] {
            let (key, value) = option.split_once(" = ").unwrap();
            let shown = format!("--{key} {} (options.toml)", value.trim_matches('"'));
            let said = said(folder, &line, 0);
            assert!(said.contains(&shown) && said.contains("took "), "{line}\n{said}");
            let _ = std::fs::remove_dir_all(folder.join("made"));
        }
    }
}

#[test]
fn what_is_typed_wins_and_saying_more_says_where_every_value_comes_from() {
    let folder = folder();
    let folder = folder.path();
    for (name, rest, option) in LINES {
        let (key, value) = option.split_once(" = ").unwrap();
        let value = value.trim_matches('"');
        std::fs::write(folder.join("options.toml"), format!("{option}\nquiet = true\n")).unwrap();
        let said = said(folder, &format!("{name} {rest} -v --config options.toml --{key} {value}"), 0);
        assert!(
            said.contains(&format!("--{key} {value} (typed)")) && said.contains("--verbose true (typed)"),
            "{said}"
        );
        assert!(said.contains("--json false (default)"), "{said}");
        let _ = std::fs::remove_dir_all(folder.join("made"));
    }
}

#[test]
fn what_would_have_no_effect_is_an_error() {
    let folder = folder();
    let folder = folder.path();
    for (name, rest, _) in LINES {
        for (text, wanted) in [
            ("sed = 1", "no option sed of "),
            ("[sedd]\nk = 1", "no verb sedd; the verbs are "),
            ("verbose = 2", "verbose = 2; it is true or false"),
            ("seed = ", "the options are not TOML"),
        ] {
            std::fs::write(folder.join("options.toml"), text).unwrap();
            let said = said(folder, &format!("{name} {rest} --config options.toml"), 2);
            assert!(said.starts_with(&format!("{name}: ")) && said.contains(wanted), "{name}: {text}\n{said}");
            assert!(said.contains("options.toml") && !folder.join("made").exists(), "{said}");
        }
        let said = said(folder, &format!("{name} {rest} --config nowhere.toml"), 2);
        assert!(said.contains("cannot read the options: nowhere.toml"), "{said}");
    }
}

#[test]
fn quiet_says_nothing_and_beside_verbose_it_is_wrong() {
    let folder = folder();
    let folder = folder.path();
    for (name, rest, _) in LINES {
        assert_eq!(said(folder, &format!("{name} {rest} -q"), 0), "", "{name}");
        assert!(said(folder, &format!("{name} {rest} -q -v"), 2).contains("cannot be used with"), "{name}");
        let _ = std::fs::remove_dir_all(folder.join("made"));
    }
}

#[test]
fn an_error_gives_its_cause_once() {
    let folder = folder();
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("run/checkpoints/000020")).unwrap();
    for line in [
        "vibes-collect info nowhere",
        "vibes-collect replay --from nowhere.json",
        "vibes-train info nowhere",
        "vibes-train encode run nowhere",
        "vibes-train encode nowhere.safetensors nowhere",
        "vibes-analyze nn --latents nowhere.arrow",
        "vibes-analyze curves nowhere",
    ] {
        let output = run(folder, line);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(matches!(output.status.code(), Some(1 | 2)), "{line}\n{said}");
        assert!(said.matches("No such file").count() <= 1, "{line}\n{said}");
    }
}

/// The names behind `--` in a verb's help.
fn options_in_help(folder: &Path, line: &str) -> BTreeSet<String> {
    let output = run(folder, &format!("{line} --help"));
    assert!(output.status.success(), "{line}");
    let help = String::from_utf8(output.stdout).unwrap();
    let names = help.lines().filter_map(|line| {
        let line = line.trim_start();
        let line = line.strip_prefix('-').and_then(|rest| rest.split_once(", ")).map_or(line, |(_, rest)| rest);
        let name = line.strip_prefix("--")?;
        Some(name.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect())
    });
    names.collect()
}

/// The verbs that a program's help lists.
fn verbs(folder: &Path, name: &str) -> Vec<String> {
    let help = String::from_utf8(run(folder, &format!("{name} --help")).stdout).unwrap();
    let list = help.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    let first = list.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    first.filter_map(|line| line.split_whitespace().next()).filter(|verb| *verb != "help").map(str::to_owned).collect()
}

/// An option that all verbs take is one that some do not look at, but for how much is said and where options come from.
#[test]
fn no_option_is_every_verbs_but_the_shared_ones() {
    let folder = tempfile::tempdir().unwrap();
    let shared: BTreeSet<String> =
        ["config", "help", "json", "quiet", "verbose", "version"].map(str::to_owned).into_iter().collect();
    for name in ["vibes-collect", "vibes-train", "vibes-analyze"] {
        let verbs = verbs(folder.path(), name);
        assert!(verbs.len() > 5, "{name}: {verbs:?}");
        let of_each = verbs.iter().map(|verb| options_in_help(folder.path(), &format!("{name} {verb}")));
        let every = of_each.reduce(|all, more| &all & &more).unwrap();
        let extra: Vec<_> = every.difference(&shared).collect();
        assert!(extra.is_empty() && every.contains("json"), "{name}: {extra:?} of {every:?}");
    }
}

#[test]
fn an_option_that_has_no_effect_is_an_error() {
    let folder = folder();
    let folder = folder.path();
    std::fs::create_dir(folder.join("sample")).unwrap();
    let latents = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/sample/latents.arrow");
    std::fs::copy(latents, folder.join("sample/latents.arrow")).unwrap();
    std::fs::write(folder.join("notes.csv"), "episode,weather\n0,rain\n").unwrap();
    let trace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../collect/tests/golden");
    std::fs::copy(trace.join("physics/reacher-easy-0.json"), folder.join("trace.json")).unwrap();
    let walk = std::fs::read_dir(trace.join("dcs")).unwrap().map(|entry| entry.unwrap().path());
    let walk = walk.filter(|path| path.extension().is_some_and(|extension| extension == "json")).min().unwrap();
    std::fs::copy(walk, folder.join("walk.json")).unwrap();
    std::fs::create_dir_all(folder.join("lived/replay")).unwrap();
    std::fs::write(folder.join("lived/replay/manifest.json"), "{}").unwrap();
    for (line, option) in [
        ("vibes-collect --episodes 1 --distract none --video-count 3 -o made", "--video-count"),
        ("vibes-collect --episodes 1 --distract background --camera-seed 3 -o made", "--camera-seed"),
        ("vibes-collect --episodes 1 --distract none --difficulty easy -o made", "--difficulty"),
        ("vibes-collect --episodes 1 --no-pixels --size 32 -o made", "--size"),
        ("vibes-collect --episodes 1 --no-pixels --render suite -o made", "--render"),
        ("vibes-collect --task cartpole-swingup --raw-torques -o made", "--raw-torques"),
        ("vibes-collect --episodes 1 --no-pixels --video-count 3 -o made", "--video-count"),
        ("vibes-collect render nowhere --distract color --videos procedural -o made", "--videos"),
        ("vibes-collect replay trace.json --episode 1", "--episode"),
        ("vibes-collect replay trace.json --videos made", "--videos"),
        ("vibes-collect replay trace.json --size 32", "--size"),
        ("vibes-collect replay walk.json --out made", "--out"),
        ("vibes-collect replay walk.json --frames made", "--frames"),
        ("vibes-collect replay walk.json --render fast", "--render"),
        ("vibes-collect replay sample --videos made", "--videos"),
        ("vibes-collect replay sample --render fast", "--render"),
        ("vibes-collect info sample --episodes --json", "--episodes"),
        ("vibes-train offline nowhere --objective deepmdp --clip none -o made", "--clip"),
        ("vibes-train offline nowhere --objective no-adversary --adversary-lr 0.1 -o made", "--adversary-lr"),
        ("vibes-train offline nowhere --preset tiny --inverse-steps 3 -o made", "--inverse-steps"),
        ("vibes-train online --task cartpole-swingup --system sac-drq -o made", "--system"),
        ("vibes-train online --task cartpole-swingup --agent sac --hidden 20 -o made", "--hidden"),
        ("vibes-train online --task cartpole-swingup --agent sac --rows-per-step 20 -o made", "--rows-per-step"),
        ("vibes-train online --task cartpole-swingup --distract camera --video-count 2 -o made", "--video-count"),
        ("vibes-train online --task cartpole-swingup --guard-members 3 -o made", "--guard-members"),
        ("vibes-train online --task cartpole-swingup --updates 30 -o made", "--updates"),
        ("vibes-train online --task cartpole-swingup --log-every 3 -o made", "--log-every"),
        ("vibes-train online --task cartpole-swingup --given-share 0.2 -o made", "--given-share"),
        ("vibes-train online --task cartpole-swingup --agent sac --exploration 0.1 -o made", "--exploration"),
        ("vibes-train online --task cartpole-swingup --preset curl --hidden 20 -o made", "--hidden"),
        ("vibes-train online run --preset tiny -o made", "--preset"),
        ("vibes-train online run --calibrate false -o made", "--calibrate"),
        ("vibes-train online --task cartpole-swingup --agent sac --guard 2 -o made", "--guard"),
        ("vibes-train offline sample --from run --reward-floor 0.2 -o made", "--reward-floor"),
        ("vibes-train info run --device flex", "--device"),
        ("vibes-train evaluate run nowhere --probe-episodes 3", "--probe-episodes"),
        ("vibes-train bench --system rsac --batch 3", "--batch"),
        ("vibes-train bench --system sac-drq --preset tiny", "--preset"),
        ("vibes-train bench --system sar --inverse-weight 3", "--inverse-weight"),
        ("vibes-train bench --online cartpole-swingup --size 32", "--size"),
        ("vibes-train bench --system sac-drq --recipe", "--recipe"),
        ("vibes-analyze curves run --seed 3", "--seed"),
        ("vibes-analyze umap sample --method pca --epochs 3", "--epochs"),
        ("vibes-analyze umap sample --perplexity 12", "--perplexity"),
        ("vibes-analyze umap sample --join notes.csv", "--join"),
        ("vibes-analyze grid sample --no-frames", "--no-frames"),
        ("vibes-analyze grid sample --panels 2x2 --states 0 --distractors 0", "--panels"),
        ("vibes-analyze nn sample --no-frames --rows 0:3 --queries 4", "--queries"),
        ("vibes-analyze nn sample --no-frames --rows 0:3 --select mix", "--select"),
        ("vibes-analyze invariance sample --no-frames --join notes.csv", "--join"),
        ("vibes-analyze clusters sample --no-frames --reach 2", "--reach"),
        ("vibes-analyze clusters sample --no-frames --by dbscan --clusters 3", "--clusters"),
        ("vibes-analyze probe sample --fit-join notes.csv --target weather", "--fit"),
        ("vibes-analyze scene sample --no-frames --episodes 0 --max-rows 9", "--max-rows"),
        ("vibes-analyze scene lived --replay --color weather", "--color"),
        ("vibes-analyze scene lived --replay --method pca", "--method"),
        ("vibes-analyze scene lived --seed 3", "--seed"),
        ("vibes-analyze table run --metrics batch_effective_rank --lower gap", "--lower"),
        ("vibes-analyze report sample --join notes.csv", "--join"),
    ] {
        let said = said(folder, line, 2);
        assert!(said.contains(option), "{line}\n{said}");
        assert!(!folder.join("made").exists(), "{line}");
    }
}

#[test]
fn a_reader_that_stops_reading_ends_the_program_without_a_panic() {
    let folder = folder();
    for (name, rest, _) in LINES {
        let mut command = Command::new(program(name));
        command.args(rest.split_whitespace()).arg("--json").current_dir(folder.path());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!errors.contains("panicked"), "{name} {rest}\n{errors}");
        assert!(output.status.success() || output.status.signal() == Some(SIGPIPE), "{name}: {}", output.status);
    }
}

/// What a process gets that writes where nobody reads.
const SIGPIPE: i32 = 13;
