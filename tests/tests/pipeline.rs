//! The three programs, one after the other, on a tiny real recording: MuJoCo to Arrow to Burn to figures. They meet only on
//! disk, so nothing of theirs is linked here.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::path::Path;
use std::process::Command;

use vibes_data::{Latents, Recording};
use vibes_tests::program;

fn run(folder: &Path, line: &str) -> String {
    let mut words = line.split_whitespace();
    let mut command = Command::new(program(words.next().unwrap()));
    let output = command.args(words).current_dir(folder).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_recording_becomes_latents_becomes_figures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(folder, "vibes-collect --episodes 4 --steps 24 --video-count 2 --seed 1 -o recordings/train");
    run(folder, "vibes-collect --grid 3x3 --steps 24 --video-set val --video-count 2 --seed 2 -o recordings/grid");
    run(folder, "vibes-train offline recordings/train --preset tiny --updates 6 -o runs/tiny");
    run(folder, "vibes-train encode runs/tiny recordings/grid");

    let latents = Latents::read(&folder.join("runs/tiny/latents.arrow")).unwrap();
    let grid = Recording::open(&folder.join("recordings/grid")).unwrap();
    assert_eq!(latents.len(), 9 * 25, "a latent for every row, the last ones too");
    for row in 0..latents.len() {
        let view = grid.episode(latents.episode[row]).unwrap();
        let step = latents.step[row] as usize;
        let reward = (step < view.steps()).then(|| view.reward(step));
        assert_eq!(latents.reward[row], reward, "the reward of its own row");
        assert_eq!(view.cell().map(|cell| cell.state), latents.state[row]);
        assert_eq!(view.cell().map(|cell| cell.distractor), latents.distractor[row]);
        let norm: f32 = latents.row(row).iter().map(|number| number * number).sum();
        assert!((norm - 1.0).abs() < 1e-4, "posterior means have unit norm");
    }

    // As typed, with no input named: the newest latents are found and said.
    assert!(run(folder, "vibes-analyze nn --queries 4").contains("neighbours"));
    run(folder, "vibes-analyze umap");
    run(folder, "vibes-analyze grid --panels 3x3");
    run(folder, "vibes-analyze invariance");
    run(folder, "vibes-analyze scene");
    let figures = folder.join("runs/tiny/figures");
    for picture in ["neighbours", "map-by-state", "grid"] {
        is_a_picture(&figures.join(picture));
    }
    let map = vibes_data::read_table(&figures.join("map.arrow")).unwrap();
    assert_eq!(map.iter().map(|batch| batch.num_rows()).sum::<usize>(), latents.len(), "a point for every row");
    let scene = std::fs::read(figures.join("scene.rrd")).unwrap();
    assert!(scene.starts_with(b"RRF2"), "not a Rerun recording: {:?}", &scene[..scene.len().min(8)]);
    assert!(
        scene.len() > latents.len() * 2 * size_of::<f32>(),
        "less than a place for every row: {} bytes",
        scene.len()
    );
    let text = std::fs::read_to_string(figures.join("invariance.json")).unwrap();
    let invariance: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(text.contains("retrieval_same_step@1") && invariance.is_object(), "{text}");
    let text = std::fs::read_to_string(figures.join("neighbours.json")).unwrap();
    let neighbours: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(neighbours["queries"].as_array().map(Vec::len), Some(4), "{text}");
}

/// A figure lies there in both forms: a whole PNG of some size, and an SVG in which something is drawn.
fn is_a_picture(stem: &Path) {
    let png = std::fs::read(stem.with_extension("png")).unwrap();
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.ends_with(b"IEND\xaeB`\x82"), "{}", stem.display());
    let side = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
    assert!(side(16) >= 200 && side(20) >= 200, "{}: {} × {} pixels", stem.display(), side(16), side(20));
    let svg = std::fs::read_to_string(stem.with_extension("svg")).unwrap();
    assert!(svg.contains("<svg") && svg.trim_end().ends_with("</svg>"), "{}: {svg:.100}", stem.display());
    assert!(svg.contains("<path") || svg.contains("<image"), "{}: nothing is drawn: {svg:.300}", stem.display());
}

/// Agents without a world model, stacks and a GRU: a run of theirs is a policy, and its latents are encoded, evaluated and drawn like any other's.
#[test]
fn a_run_without_a_world_model_is_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (system, rows) in [("sac-drq", 8), ("core", 64)] {
        let line = "vibes-train online --task reacher-easy --agent sac --size 32 --steps 16 --prefill 2 --video-count 1 --evaluation-episodes 1";
        let more = "--final-episodes 1 --control-steps 192";
        run(folder, &format!("{line} {more} --system {system} --transitions {rows} -o runs/{system}"));
        let record = "vibes-collect --steps 16 --size 32 --video-set val --video-count 1 --no-mcap";
        run(folder, &format!("{record} --policy runs/{system} --grid 2x2 -o recordings/{system}"));
        let grid = Recording::open(&folder.join(format!("recordings/{system}"))).unwrap();
        assert_eq!(grid.episodes().len(), 4);
        assert_eq!(grid.manifest().options["acting"][0]["run"], system);
        run(folder, &format!("vibes-train encode runs/{system} recordings/{system}"));
        assert_eq!(Latents::read(&folder.join(format!("runs/{system}/latents.arrow"))).unwrap().len(), 4 * 17);
        let said = run(folder, &format!("vibes-train evaluate runs/{system} recordings/{system} --json"));
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert!(said["report"]["numbers"]["retrieval_same_step@1"].is_object(), "{said}");
        assert!(said["gaps"].is_null(), "{said}");
        assert!(run(folder, &format!("vibes-analyze table runs/{system}")).contains(system));
    }
}

/// A run that began from nothing learned from its replay: that is a recording like any other, which is encoded, searched for neighbours (the paper's twenty queries) and fits the
/// probes and the gaps of an evaluation, whose numbers stand beside the run's returns.
#[test]
fn an_online_run_is_analysed_on_its_replay_as_it_lies() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let line = "vibes-train online --task reacher-easy --preset tiny --size 16 --steps 20 --prefill 2 --video-count 1 --first-updates 4";
    run(
        folder,
        &format!("{line} --control-steps 240 --rows-per-step 8 --evaluation-episodes 1 --final-episodes 1 -o runs/own"),
    );
    run(folder, "vibes-train encode runs/own runs/own/replay -o replay.arrow");
    assert_eq!(Latents::read(&folder.join("replay.arrow")).unwrap().len(), 3 * 21);
    let said = run(folder, "vibes-analyze nn --latents replay.arrow --queries 20 --json");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["queries"].as_array().map(Vec::len), Some(20), "{said}");
    run(
        folder,
        "vibes-collect --policy runs/own --grid 2x2 --steps 20 --size 16 --video-set val --no-mcap -o recordings/grid",
    );
    let said = run(folder, "vibes-train evaluate runs/own recordings/grid --gap-updates 2 --json");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(said["gaps"]["dynamics_gap"].is_number(), "{said}");
    let table =
        run(folder, "vibes-analyze table runs/own --metrics retrieval_same_step@1,held_out.held_out.mean_return");
    assert!(table.contains("vibes"), "{table}");
}

/// One definition for every number: latents measured by the trainer, and the same latents measured from disk by the analyzer, give the same numbers under the same
/// names, to the last digit: fitted on several recordings, one of which shows another's states again, too.
#[test]
fn both_programs_print_the_same_numbers_under_the_same_names() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(folder, "vibes-collect --episodes 4 --steps 24 --video-count 2 --seed 1 -o recordings/train");
    run(folder, "vibes-collect render recordings/train --seed 9 --video-count 2 --no-mcap -o recordings/view");
    run(folder, "vibes-collect --episodes 3 --steps 24 --video-count 2 --seed 5 --no-mcap -o recordings/more");
    run(folder, "vibes-collect --grid 3x3 --steps 24 --video-set val --video-count 3 --seed 2 -o recordings/grid");
    let recordings = ["train", "view", "more"];
    let trained_on = recordings.map(|name| format!("recordings/{name}")).join(" ");
    run(folder, &format!("vibes-train offline {trained_on} --preset tiny --updates 6 -o runs/tiny"));
    run(folder, "vibes-train encode runs/tiny recordings/grid");
    for name in recordings {
        run(folder, &format!("vibes-train encode runs/tiny recordings/{name} -o runs/tiny/fit-{name}.arrow"));
    }
    let json = |line: &str| -> serde_json::Value { serde_json::from_str(&run(folder, line)).unwrap() };
    let alike = |trained: &serde_json::Value, analyzed: &serde_json::Value, least: usize| {
        let analyzed = analyzed["numbers"].as_object().unwrap();
        assert!(analyzed.len() >= least, "{analyzed:?}");
        for (name, number) in analyzed {
            assert_eq!(&trained["report"]["numbers"][name], number, "{name}");
        }
    };
    let evaluate = "vibes-train evaluate runs/tiny recordings/grid --gap-updates 0 --json";
    let probe = "vibes-analyze probe runs/tiny/latents.arrow --json";
    let fits = recordings.map(|name| format!("--fit runs/tiny/fit-{name}.arrow")).join(" ");
    let named = |document: &serde_json::Value, family: &str| {
        let numbers = document["numbers"].as_object().unwrap();
        numbers.keys().filter(|name| name.split('/').next() == Some(family)).count()
    };
    let fitted_on_training = json(evaluate);
    alike(&fitted_on_training, &json("vibes-analyze invariance runs/tiny/latents.arrow --json"), 10);
    let probed = json(&format!("{probe} {fits}"));
    alike(&fitted_on_training, &probed, 16);
    assert!(named(&probed, "probe") > 5 && named(&probed, "probe_cross_validated") == 1, "{probed}");
    assert_eq!(probed["fitted_on"]["numbers"]["episodes"], fitted_on_training["report"]["fitted_on"]);
    // The cap on episodes spreads over all recordings, in both alike.
    let few = json(&format!("{evaluate} --probe-episodes 4"));
    assert_eq!(few["report"]["fitted_on"], 4);
    alike(&few, &json(&format!("{probe} {fits} --probe-episodes 4")), 16);
    let cross_validated = json(&format!("{evaluate} --probe-episodes 0"));
    let probed = json(probe);
    alike(&cross_validated, &probed, 16);
    assert_eq!((named(&probed, "probe"), named(&probed, "probe_knn")), (0, 0), "{probed}");
    let name = "probe_cross_validated/target in arm's frame, ahead/s";
    assert!(cross_validated["report"]["numbers"][name].is_object(), "{cross_validated}");
}

#[test]
fn every_program_has_help_and_lists_what_it_knows() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["vibes-collect", "vibes-train", "vibes-analyze"] {
        assert!(run(folder.path(), &format!("{name} --help")).contains("Usage"), "{name}");
        assert!(run(folder.path(), &format!("{name} --version")).contains(env!("CARGO_PKG_VERSION")), "{name}");
    }
}
