//! `decode`: what a latent shows of the picture.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use serde_json::json;
use vibes_data::{Decoded, DecodedRow, relative_place};

use super::compare::names;
use super::{Globals, Outcome, wrong};
use crate::figures::{Figure, Heading, Strip, StripLine, Strips};
use crate::output;
use crate::picture::Pixels;

/// Show what of the picture is in the latents, as strips of pictures drawn from them, of several runs side by side.
///
/// A strip shows the recorded frames, what a decoder draws from their latents, and what it draws from the latents that the dynamics predict from one step
/// on under the recorded actions. Latents that ignore distractors show the body in front of a mean of backgrounds; latents that keep them show the
/// background. The pictures are made by `vibes-train decode RUN RECORDING`, which does not change the encoder.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Run folders with a decoded.arrow, or such files.
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<PathBuf>,
    /// Most strips to draw.
    #[arg(long, value_name = "N", default_value_t = STRIPS)]
    strips: usize,
    /// Where the output goes [default: the folder `figures` in the first run].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// A line under the title of the figure.
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

/// Strips that are drawn unless another number is asked for.
const STRIPS: usize = 3;

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(runs: &[PathBuf], output: &Path, note: Option<&str>) -> Self {
        let output = Some(output.to_path_buf());
        Self { runs: runs.to_vec(), strips: STRIPS, output, note: note.map(String::from) }
    }
}

/// One run's pictures.
struct Source {
    name: String,
    decoded: Decoded,
}

/// Where a run's pictures lie.
pub(super) fn decoded_path(run: &Path) -> PathBuf {
    if run.is_file() { run.to_path_buf() } else { run.join("decoded.arrow") }
}

pub(super) fn run(options: &Options, _globals: &Globals) -> anyhow::Result<Outcome> {
    let opened =
        |(name, run): (String, &PathBuf)| -> anyhow::Result<Source> { Ok(Source { name, decoded: open(run)? }) };
    let files: Vec<PathBuf> = options.runs.iter().map(|run| decoded_path(run)).collect();
    let sources = names(&files).into_iter().zip(&options.runs).map(opened).collect::<anyhow::Result<Vec<_>>>()?;
    let drawn = figure(options, &sources)?;
    let count = drawn.strips.len();
    let folder =
        if options.runs[0].is_file() { options.runs[0].parent().unwrap_or(Path::new("")) } else { &options.runs[0] };
    let out = options.output.clone().unwrap_or_else(|| folder.join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let mut outcome = Outcome::default();
    let runs = sources.iter().zip(&options.runs).map(|(source, path)| {
        let decoded = &source.decoded;
        json!({
            "name": source.name, "decoded": relative_place(&decoded_path(path), &out), "recording": decoded.recording,
            "checkpoint": decoded.checkpoint, "objective": decoded.objective, "explained": decoded.explained,
        })
    });
    let document = output::document(
        &json!({ "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": "decode", "strips": options.strips, "note": options.note }),
        &json!({ "runs": runs.collect::<Vec<_>>() }),
    )?;
    let path = out.join("decoded.json");
    output::write_json(&path, &document)?;
    outcome.files.push(path);
    outcome.json = document;
    outcome.save(&Figure::Strips(drawn), &out, "decoded")?;
    let explained =
        sources.iter().filter_map(|source| Some(format!("{} {:.0}%", source.name, 100.0 * source.decoded.explained?)));
    outcome.line = format!(
        "decode: {count} strips; pixel variance that the latent shows: {}",
        explained.collect::<Vec<_>>().join(", ")
    );
    Ok(outcome)
}

fn open(run: &Path) -> anyhow::Result<Decoded> {
    let path = decoded_path(run);
    if !path.is_file() {
        return Err(wrong(format!(
            "no pictures here yet; make them with `vibes-train decode {} RECORDING`: {}",
            run.display(),
            path.display()
        )));
    }
    Ok(Decoded::read(&path)?)
}

/// The strips that all runs have.
fn figure(options: &Options, sources: &[Source]) -> anyhow::Result<Strips> {
    let first = &sources[0].decoded;
    let numbers: std::collections::BTreeSet<u32> = first.rows.iter().map(|row| row.strip).collect();
    let mut strips = Vec::new();
    for &number in numbers.iter().take(options.strips) {
        let rows: Vec<&DecodedRow> = first.rows.iter().filter(|row| row.strip == number).collect();
        let Some(start) = rows.first().map(|row| row.start) else { continue };
        let picture =
            |size: (u32, u32), rgb: &[u8]| Some(Arc::new(Pixels { width: size.1, height: size.0, rgb: rgb.to_vec() }));
        let recorded = rows.iter().map(|row| picture(first.size, &row.recorded)).collect();
        let mut lines = vec![StripLine { name: "recorded".into(), pictures: recorded }];
        for source in sources {
            // Two recordings number their episodes alike: only the pictures say that a row is the same.
            let is_same = |row: &DecodedRow, other: &DecodedRow| {
                (other.episode, other.step, other.start) == (row.episode, row.step, row.start)
                    && other.recorded == row.recorded
            };
            let same = |row: &&DecodedRow| source.decoded.rows.iter().find(|other| is_same(row, other));
            let own: Vec<Option<&DecodedRow>> = rows.iter().map(same).collect();
            if own.iter().any(Option::is_none) {
                return Err(wrong(format!(
                    "the runs show different rows or recordings; decode them with the same recording (--show) and the same options: {}",
                    source.name
                )));
            }
            let several = sources.len() > 1;
            let name = |what: &str| if several { format!("{}: {what}", source.name) } else { what.to_string() };
            let of = |bytes: &dyn Fn(&DecodedRow) -> Option<Vec<u8>>| {
                own.iter().map(|row| picture(source.decoded.size, &bytes((*row)?)?)).collect::<Vec<_>>()
            };
            lines.push(StripLine { name: name("shown"), pictures: of(&|row| Some(row.shown.clone())) });
            lines.push(StripLine { name: name("predicted"), pictures: of(&|row| row.predicted.clone()) });
        }
        let title = rows.first().map_or_else(String::new, |row| format!("episode {}", row.episode));
        strips.push(Strip { title, steps: rows.iter().map(|row| row.step).collect(), start, lines });
    }
    if strips.is_empty() {
        return Err(wrong("there are no strips in it; its episodes were shorter than the prediction"));
    }
    let heading = Heading::new("What the latents show of the pictures").with_note(options.note.clone());
    let foot = "shown: a decoder's picture of the latent; predicted: from the line on, of latents that the dynamics predict under the recorded actions alone";
    Ok(Strips { heading, strips, foot: foot.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(name: &str, shade: u8) -> Source {
        let row = |step: u32| DecodedRow {
            episode: 1,
            step,
            start: 1,
            recorded: vec![shade; 12],
            shown: vec![9; 12],
            ..DecodedRow::default()
        };
        let decoded = Decoded { size: (2, 2), rows: (0..3).map(row).collect(), ..Decoded::default() };
        Source { name: name.into(), decoded }
    }

    #[test]
    fn runs_decoded_from_two_recordings_are_not_drawn_under_the_frames_of_one() {
        let options = Options::of(&[], Path::new("figures"), None);
        let drawn = figure(&options, &[source("a", 200), source("b", 200)]).expect("strips");
        assert_eq!((drawn.strips.len(), drawn.strips[0].lines.len()), (1, 5));
        let fault = figure(&options, &[source("a", 200), source("b", 201)]).expect_err("another recording").to_string();
        assert!(fault.contains("decode them with the same recording") && fault.ends_with(": b"), "{fault}");
    }
}
