//! `vibes-collect replay` of a `vibes-distractor-trace/1` file: our camera, colours and background beside the suite's, and pictures on request.

use std::path::Path;

use anyhow::Result;
use serde_json::json;

use super::number::number;
use super::{Outcome, OutputArgs};
use crate::Error;
use crate::distractor_trace::{DistractorTrace, PictureComparison};
use vibes_env::render::Look;
use vibes_env::{Environment, EnvironmentOptions};

/// Largest mean error of a picture in the suite's look, levels of 255.
const SUITE_LEVELS: f64 = 2.0;
/// Smallest peak signal-to-noise ratio of a picture in the fast look, dB.
const FAST_PSNR: f64 = 28.0;

/// What the pictures are drawn with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pictures<'a> {
    pub(super) videos: &'a Path,
    pub(super) look: Look,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(path: &Path, tolerance: f64, pictures: Option<Pictures<'_>>, output: OutputArgs) -> Result<Outcome> {
    let trace = DistractorTrace::read(path)?;
    let environment = Environment::new(&trace.task, EnvironmentOptions::default());
    let mut environment = environment.map_err(|error| Error::from(error).in_file(path))?;
    let overrides = serde_json::from_value(trace.model_overrides.clone()).map_err(|error| {
        Error::malformed(path, format!("model overrides: {error}"), "overrides name fields, objects and numbers")
    })?;
    environment.physics_mut().set_overrides(&overrides).map_err(|error| Error::from(error).in_file(path))?;
    let comparison = trace.compare(&environment).map_err(|error| error.in_file(path))?;
    let draw = |pictures: Pictures<'_>| {
        let drawn = trace.compare_pictures(&environment, pictures.videos, pictures.look);
        drawn.map_err(|error| error.in_file(path))
    };
    let drawn = pictures.map(draw).transpose()?;
    let drawn = drawn.unwrap_or_default();
    if output.json {
        let errors: serde_json::Map<_, _> =
            comparison.errors().map(|(name, error)| (name.to_owned(), number(error))).into_iter().collect();
        println!(
            "{}",
            json!({ "steps": comparison.steps, "errors": errors, "pictures": drawn.iter().map(as_json).collect::<Vec<_>>() })
        );
    } else if !output.quiet {
        let errors = comparison.errors().map(|(name, error)| format!("{name} {error:.3e}")).join(", ");
        println!("largest error over {} steps: {errors}", comparison.steps);
        drawn.iter().for_each(|picture| println!("{}", line(picture)));
    }
    let close = |picture: &PictureComparison| match pictures.map(|pictures| pictures.look) {
        Some(Look::Fast) => picture.psnr >= FAST_PSNR,
        _ => picture.mean_absolute_error <= SUITE_LEVELS,
    };
    let agrees = comparison.is_within(tolerance) && drawn.iter().all(close);
    Ok(if agrees { Outcome::Done } else { Outcome::Failed })
}

fn as_json(picture: &PictureComparison) -> serde_json::Value {
    let PictureComparison { step, size, mean_absolute_error, psnr, .. } = picture;
    json!({ "step": step, "size": size, "mean_absolute_error": number(*mean_absolute_error), "psnr": number(*psnr) })
}

fn line(picture: &PictureComparison) -> String {
    let PictureComparison { step, size, mean_absolute_error, psnr, .. } = picture;
    format!("step {step:4}, {size} px: mean error {mean_absolute_error:.3} of 255, PSNR {psnr:.1} dB")
}
