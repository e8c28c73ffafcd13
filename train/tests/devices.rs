//! Training on every device of this build as on flex, on the real recording in the tree: it trains, saves, goes on, encodes and evaluates, and ends near
//! where flex ends.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use vibes_data::Latents;
use vibes_train::metrics::read_rows;

const DEVICES: &[&str] = &[
    "ndarray",
    #[cfg(feature = "wgpu")]
    "wgpu",
];

fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/sample")
}

fn vibes_train(folder: &Path, device: &str, line: &str) -> Output {
    let sample = sample();
    let words = line.split(' ').map(|word| if word == "SAMPLE" { sample.as_os_str() } else { word.as_ref() });
    let mut command = Command::new(env!("CARGO_BIN_EXE_vibes-train"));
    command.current_dir(folder).args(words).args(["-q", "--device", device]).output().unwrap()
}

fn done(folder: &Path, device: &str, line: &str) -> Output {
    let output = vibes_train(folder, device, line);
    assert!(output.status.success(), "{device}: {line}\n{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// 20 updates with a stop after 12. The large ε keeps gradients that are only rounding from moving weights by whole steps, which would take two devices apart.
fn trained(folder: &Path, device: &str, objective: &str) -> String {
    let run = format!("{device}-{}", objective.split(' ').next().unwrap());
    for updates in [12, 20] {
        let options = format!("--preset tiny --objective {objective} --adam-epsilon 1e-4 --updates {updates} -o {run}");
        done(folder, device, &format!("offline SAMPLE {options}"));
    }
    run
}

fn encoded(folder: &Path, device: &str, run: &str) -> Vec<f32> {
    done(folder, device, &format!("encode {run} SAMPLE -o {run}.arrow"));
    Latents::read(&folder.join(format!("{run}.arrow"))).unwrap().latent
}

/// What is learned is compared: likelihoods, and gradients' norms.
fn measured(folder: &Path, run: &str) -> Vec<(String, f64)> {
    let rows = read_rows(&folder.join(run).join("metrics.jsonl")).unwrap();
    let of = |row: &vibes_train::metrics::Row| {
        let shared = [
            ("objective", row.objective),
            ("dynamics", row.dynamics_log_likelihood),
            ("reward", row.reward_log_likelihood),
            ("gradient norm", row.gradient_norm),
        ];
        let shared = shared.map(|(name, number)| (name.to_owned(), number)).into_iter();
        let (all, update) = (shared.chain(row.stated.clone()), row.update);
        all.map(move |(name, number)| (format!("{name} at update {update}"), number)).collect::<Vec<_>>()
    };
    rows.iter().flat_map(of).collect()
}

fn furthest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    // `f32::max` would pass over a difference that is none.
    apart.inspect(|apart| assert!(apart.is_finite(), "a difference of {apart}")).fold(0.0, f32::max)
}

#[test]
fn a_run_ends_near_the_same_run_on_flex() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // With every auxiliary term: hidden states, rollouts and their gradients run on hand-made kernels here and on plain operations there.
    let terms = "no-adversary --inverse-weight 0.5 --reward-steps 3 --latent-steps 2";
    for objective in ["vibes", "reconstruction", terms] {
        let expected = trained(folder, "flex", objective);
        let (numbers, latents) = (measured(folder, &expected), encoded(folder, "flex", &expected));
        for device in DEVICES {
            let run = trained(folder, device, objective);
            for ((name, found), (_, expected)) in measured(folder, &run).iter().zip(&numbers) {
                let difference = (found - expected).abs() / expected.abs().max(1.0);
                assert!(difference < 2e-3, "{device}, {objective}, {name}: {found} {expected}");
            }
            let here = encoded(folder, device, &run);
            assert!(furthest(&here, &latents) < 1e-2, "{device}, {objective}: {}", furthest(&here, &latents));
            // The checkpoint itself belongs to no device.
            let there = encoded(folder, "flex", &run);
            assert!(furthest(&here, &there) < 1e-4, "{device}, {objective}: {}", furthest(&here, &there));
        }
    }
}

#[test]
fn a_run_is_evaluated_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(folder, "flex", "offline SAMPLE --preset tiny --updates 4 -o run");
    let gap = |device| {
        let found = done(folder, device, "evaluate run SAMPLE --gap-updates 3 --json").stdout;
        let found: serde_json::Value = serde_json::from_slice(&found).unwrap();
        found["gaps"]["dynamics_gap"].as_f64().unwrap()
    };
    let expected = gap("flex");
    for device in DEVICES {
        let found = gap(device);
        assert!((found - expected).abs() < 1e-2, "{device}: {found} {expected}");
    }
}

/// No driver of Vulkan or OpenGL is found where there is no list of them.
#[cfg(all(feature = "wgpu", target_os = "linux"))]
#[test]
fn a_machine_without_a_gpu_is_told_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_vibes-train"));
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"] {
        command.env(variable, "nowhere.json");
    }
    let output = command.args(["bench", "--device", "wgpu"]).current_dir(folder.path()).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("--device wgpu needs") && !errors.contains("panicked"), "{errors}");
}
