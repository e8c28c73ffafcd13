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

/// One definition for every number: latents measured by the trainer, and the same latents measured from disk by the analyzer, give the same numbers under the same
/// names, to the last digit.
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

#[test]
fn both_programs_print_the_same_numbers_under_the_same_names() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(folder, "vibes-collect --episodes 4 --steps 24 --video-count 2 --seed 1 -o recordings/train");
    run(folder, "vibes-collect --grid 3x3 --steps 24 --video-set val --video-count 3 --seed 2 -o recordings/grid");
    run(folder, "vibes-train offline recordings/train --preset tiny --updates 6 -o runs/tiny");
    run(folder, "vibes-train encode runs/tiny recordings/grid");
    run(folder, "vibes-train encode runs/tiny recordings/train -o runs/tiny/training.arrow");
    let json = |line: &str| -> serde_json::Value { serde_json::from_str(&run(folder, line)).unwrap() };
    let alike = |trained: &serde_json::Value, analyzed: &serde_json::Value, least: usize| {
        let analyzed = analyzed["numbers"].as_object().unwrap();
        assert!(analyzed.len() >= least, "{analyzed:?}");
        for (name, number) in analyzed {
            assert_eq!(&trained["report"]["numbers"][name], number, "{name}");
        }
    };
    let grid = "recordings/grid --gap-updates 0 --json";
    let fitted_on_training = json(&format!("vibes-train evaluate runs/tiny {grid}"));
    alike(&fitted_on_training, &json("vibes-analyze invariance runs/tiny/latents.arrow --json"), 10);
    let fit = "--fit runs/tiny/training.arrow";
    alike(&fitted_on_training, &json(&format!("vibes-analyze probe runs/tiny/latents.arrow {fit} --json")), 16);
    let held_out = json(&format!("vibes-train evaluate runs/tiny {grid} --probe-episodes 0"));
    alike(&held_out, &json("vibes-analyze probe runs/tiny/latents.arrow --json"), 16);
    assert!(held_out["report"]["numbers"]["probe/target in arm's frame, ahead/s"].is_object(), "{held_out}");
}

#[test]
fn every_program_has_help_and_lists_what_it_knows() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["vibes-collect", "vibes-train", "vibes-analyze"] {
        assert!(run(folder.path(), &format!("{name} --help")).contains("Usage"), "{name}");
        assert!(run(folder.path(), &format!("{name} --version")).contains(env!("CARGO_PKG_VERSION")), "{name}");
    }
}
