//! The traces of `tests/golden/dcs`, written by the Distracting Control Suite itself: camera, colours and background agree to 1e-9; pictures
//! in the suite's look within 2 levels of 255 on average, in the fast look above 28 dB.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking, and says how close pictures are"
)]

use std::fs;
use std::path::PathBuf;

use vibes_collect::distractor_trace::{DistractorTrace, PictureComparison};
use vibes_env::render::Look;
use vibes_env::{Environment, EnvironmentOptions};

fn golden(folder: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden")).join(folder)
}

fn traces() -> Vec<DistractorTrace> {
    let mut paths: Vec<PathBuf> = fs::read_dir(golden("dcs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == "json"));
    paths.sort();
    assert!(!paths.is_empty());
    paths.iter().map(|path| DistractorTrace::read(path).unwrap()).collect()
}

fn in_its_world<T>(trace: &DistractorTrace, compare: impl FnOnce(&Environment) -> T) -> T {
    let mut environment = Environment::new(&trace.task, EnvironmentOptions::default()).unwrap();
    let overrides = serde_json::from_value(trace.model_overrides.clone()).unwrap();
    environment.physics_mut().set_overrides(&overrides).unwrap();
    compare(&environment)
}

#[test]
fn camera_colours_and_background_agree_to_1e_9() {
    for trace in traces() {
        let comparison = in_its_world(&trace, |environment| trace.compare(environment)).unwrap();
        println!("{}: {comparison:?}", trace.task);
        assert_eq!(comparison.steps, trace.steps.len());
        assert!(comparison.is_within(1e-9), "{}: {comparison:?}", trace.task);
    }
}

/// A comparison that finds no difference in anything would prove nothing.
#[test]
fn a_changed_draw_is_noticed() {
    for mut trace in traces() {
        trace.steps[10].camera_draws.velocity[1] += 1e-3;
        trace.steps[10].color_draws[3] += 1e-3;
        trace.steps[20].background.0 += 1;
        trace.ground_alpha += 0.1;
        let comparison = in_its_world(&trace, |environment| trace.compare(environment)).unwrap();
        assert!(comparison.position > 1e-9 && comparison.color > 1e-9, "{comparison:?}");
        assert_eq!(comparison.wrong_frames, 1);
        assert!((comparison.ground_alpha - 0.1).abs() < 1e-6, "{comparison:?}");
    }
}

fn pictures(trace: &DistractorTrace, look: Look) -> Vec<PictureComparison> {
    let pictures =
        in_its_world(trace, |environment| trace.compare_pictures(environment, &golden("videos"), look)).unwrap();
    for PictureComparison { step, size, mean_absolute_error, psnr, .. } in &pictures {
        println!("{} {look} step {step} size {size}: {mean_absolute_error:.2} levels, {psnr:.1} dB", trace.task);
    }
    pictures
}

#[test]
fn the_suites_look_is_the_suites() {
    for trace in traces() {
        let pictures = pictures(&trace, Look::Suite);
        assert_eq!(pictures.len(), 6);
        assert!(pictures.iter().all(|picture| picture.mean_absolute_error <= 2.0));
    }
}

#[test]
fn the_fast_look_is_close() {
    for trace in traces() {
        assert!(pictures(&trace, Look::Fast).iter().all(|picture| picture.psnr > 28.0));
    }
}
