//! `report`: one self-contained page with everything.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Parser;
use rand::seq::index;
use serde_json::json;

use super::maps::{MadeMap, MapOptions};
use super::session::{Input, Session};
use super::{Cli, Globals, Outcome, dispatch, say};
use crate::input::{Frames, Run};
use crate::picture::Pixels;
use crate::report::{Chapter, LiveMap, LivePoint, Section, Shown, page, write};
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};

/// One HTML page with all figures and numbers of one or more runs; hovering over a point of the map shows its frame and its neighbours.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Run folders, or tables of latents; the newest latents unless named.
    #[arg(value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The recording the latents were encoded from; the one their metadata names unless given.
    #[arg(long, value_name = "FOLDER")]
    recording: Option<PathBuf>,
    /// Where the output goes [default: the folder `figures` beside the first latents].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A line under every title, as in "after 300 updates: barely trained".
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    /// Points of each map that can be hovered over.
    #[arg(long, default_value_t = 800)]
    points: usize,
}

/// A verb of the report: what it asks and how to read its answer.
const QUESTIONS: [(&str, &str, &str); 6] = [
    (
        "nn",
        "What is near what?",
        "Each column: a query on top, its nearest rows from other episodes beneath. Good: same arm and goal, other background.",
    ),
    (
        "umap",
        "What does the latent space look like?",
        "Every point a row of the recording. Good: states lie apart, distractors are mixed.",
    ),
    (
        "grid",
        "Does a trajectory keep its place under other distractors?",
        "Panels of one row share the state, panels of one column the distractor. Good: equal along rows, different along columns.",
    ),
    (
        "invariance",
        "How invariant is it?",
        "Good: state near 1, distractor near 0, retrieval far above chance; compare with the action-only control.",
    ),
    (
        "probe",
        "What can be read from it?",
        "Good: task quantities high and above the action-only control, distractors at chance.",
    ),
    (
        "symmetry",
        "Is it symmetric under rotation?",
        "Reacher's arm and goal turned together change nothing that matters. Good: a ratio near 0; 1 if the latent knows nothing of it.",
    ),
];

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let inputs: Vec<Option<&Path>> =
        if options.runs.is_empty() { vec![None] } else { options.runs.iter().map(|r| Some(r.as_path())).collect() };
    let mut chapters = Vec::new();
    let mut out: Option<PathBuf> = options.output.clone();
    for input in inputs {
        let session = Session::open(&source(options, input), globals, "report", json!({}))?;
        let folder = out.get_or_insert_with(|| session.out.clone()).join(if options.runs.len() > 1 {
            name(&session.path)
        } else {
            String::new()
        });
        chapters.push(chapter(options, globals, session, &folder)?);
    }
    let out = out.unwrap_or_default();
    if options.runs.len() > 1 {
        chapters.push(side_by_side(options, globals, &out));
    }
    let tables = options.runs.len().max(1);
    let runs: Vec<&PathBuf> = options.runs.iter().filter(|r| Run::read(r).is_ok()).collect();
    if !runs.is_empty() {
        chapters.push(training(options, globals, &runs, &out));
    }
    let path = out.join("report.html");
    let html = page("Looking into the latent space", options.note.as_deref(), &chapters);
    write(&path, &html)?;
    let figures: usize = chapters.iter().flat_map(|c| &c.sections).map(|s| s.figures.len()).sum();
    let line = format!(
        "report: {figures} figures of {} tables of latents on one page of {:.1} MB",
        tables,
        html.len() as f64 / 1e6
    );
    let json = json!({ "report": path, "figures": figures, "bytes": html.len() });
    Ok(Outcome { line, remarks: Vec::new(), files: vec![path], json })
}

fn source(options: &Options, input: Option<&Path>) -> Input {
    Input::named(input, options.recording.as_deref(), options.output.as_deref(), options.seed, options.note.as_deref())
}

/// The name of the folder that latents lie in, with their own unless it is `latents`: a run may hold several tables.
fn name(latents: &Path) -> String {
    let stem = |p: &Path| p.file_stem().map(|n| n.to_string_lossy().into_owned());
    let own = stem(latents).unwrap_or_else(|| "latents".into());
    match latents.parent().and_then(stem) {
        Some(folder) if own == "latents" => folder,
        Some(folder) => format!("{folder}-{own}"),
        None => own,
    }
}

fn chapter(options: &Options, globals: &Globals, mut session: Session, folder: &Path) -> anyhow::Result<Chapter> {
    let mut sections = vec![live_section(options, globals, &mut session, folder)?];
    let rotates = session.frames()?.is_some_and(|frames| super::symmetry::applies(&frames));
    for (verb, title, reading) in QUESTIONS.into_iter().filter(|(verb, ..)| *verb != "symmetry" || rotates) {
        say(globals, format_args!("report: {verb}"));
        let latents = session.path.display().to_string();
        let section = Section { title: title.into(), reading: reading.into(), ..Section::default() };
        sections.push(answer(options, &[verb, &latents], folder, section));
    }
    let l = &session.latents;
    let from = l.source.checkpoint.as_ref().map_or_else(String::new, |c| format!(", encoded by {c}"));
    let origin = format!("{} rows of {} dimensions from {}{from}", l.len(), l.dims, session.path.display());
    Ok(Chapter { title: name(&session.path), origin, sections })
}

/// Runs a verb as if it had been typed and puts its figures and its line into the section; a verb that fails says why.
fn answer(options: &Options, words: &[&str], folder: &Path, mut section: Section) -> Section {
    let folder = folder.display().to_string();
    let seed = options.seed.to_string();
    let mut typed: Vec<String> = [&["vibes-analyze"], words, &["--quiet", "-o", &folder, "--seed", &seed]]
        .concat()
        .into_iter()
        .map(String::from)
        .collect();
    if let Some(note) = &options.note {
        typed.extend(["--note".into(), note.clone()]);
    }
    if let Some(recording) = options.recording.as_ref().filter(|_| !["curves", "compare"].contains(&words[0])) {
        typed.extend(["--recording".into(), recording.display().to_string()]);
    }
    let outcome = Cli::try_parse_from(typed).map_err(anyhow::Error::from).and_then(|cli| dispatch(&cli));
    match outcome {
        Ok(outcome) => {
            let svg = outcome.files.iter().filter(|f| f.extension().is_some_and(|e| e == "svg"));
            let shown = |f: &PathBuf| {
                Some(Shown {
                    svg: std::fs::read_to_string(f).ok()?,
                    alt: format!("{}: {}", section.title, outcome.line),
                })
            };
            section.figures = svg.filter_map(shown).collect();
            section.result = outcome.line;
            section.remarks = outcome.remarks;
            section.numbers = Some(format!("{:#}", outcome.json)).filter(|n| n.len() < 200_000);
        }
        Err(error) => section.result = format!("not available: {error:#}"),
    }
    section
}

/// The chapter on several tables of latents: which is better?
fn side_by_side(options: &Options, globals: &Globals, out: &Path) -> Chapter {
    say(globals, "report: compare");
    let names: Vec<String> = options.runs.iter().map(|r| r.display().to_string()).collect();
    let words: Vec<&str> = std::iter::once("compare").chain(names.iter().map(String::as_str)).collect();
    let reading = "Tables of the same recording. Good: state high, distractor low, retrieval far above chance.";
    let section = Section { title: "Which is more invariant?".into(), reading: reading.into(), ..Section::default() };
    Chapter {
        title: "Side by side".into(),
        origin: names.join(", "),
        sections: vec![answer(options, &words, out, section)],
    }
}

/// The chapter on training: curves over all runs.
fn training(options: &Options, globals: &Globals, runs: &[&PathBuf], out: &Path) -> Chapter {
    say(globals, "report: curves");
    let names: Vec<String> = runs.iter().map(|r| r.display().to_string()).collect();
    let words: Vec<&str> = std::iter::once("curves").chain(names.iter().map(String::as_str)).collect();
    let reading = "Log-likelihoods in nats a row; the gap is the adversary's minus the dynamics', and falls to 0 for a bisimulation.";
    let section = Section { title: "How did training go?".into(), reading: reading.into(), ..Section::default() };
    Chapter {
        title: "Training".into(),
        origin: names.join(", "),
        sections: vec![answer(options, &words, out, section)],
    }
}

/// The map to hover over.
fn live_section(options: &Options, globals: &Globals, session: &mut Session, folder: &Path) -> anyhow::Result<Section> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    session.out = folder.to_path_buf();
    let frames = session.frames()?;
    let made = MapOptions::default().map(session, globals)?;
    let mut section = Section {
        title: "A map to hover over".into(),
        reading: "Hover over a coloured point: its frame, and the frames of its nearest neighbours from other episodes. Arrow keys walk through time.".into(),
        result: format!("map of {} latents, {}", session.latents.len(), made.quality_text()),
        ..Section::default()
    };
    if frames.is_none() {
        section.remarks.push("these latents name no recording, so there are no frames".into());
    }
    section.map = Some(live_map(options, session, &made, frames.as_ref())?);
    Ok(section)
}

fn live_map(options: &Options, session: &Session, made: &MadeMap, frames: Option<&Frames>) -> anyhow::Result<LiveMap> {
    let l = &session.latents;
    let mut rows = index::sample(&mut session.rng(), l.len(), options.points.clamp(1, l.len())).into_vec();
    rows.sort_by_key(|&row| (l.episode[row], l.step[row]));
    let near = nearest(&Space::new(session.table()?, Metric::Standardized)?, &rows, 5, Exclude::Trajectory)?;
    let mut pictures: Vec<Pixels> = Vec::new();
    let mut known: BTreeMap<usize, Option<usize>> = BTreeMap::new();
    let mut frame = |row: usize| {
        *known.entry(row).or_insert_with(|| {
            let picture = frames?.picture(l.episode[row], l.step[row])?;
            pictures.push((*picture).clone());
            Some(pictures.len() - 1)
        })
    };
    let key = |row: usize| format!("{}:{}", l.episode[row], l.step[row]);
    let longest = l.step.iter().max().copied().unwrap_or(1).max(1) as f32;
    let mut points = Vec::new();
    for (i, &row) in rows.iter().enumerate() {
        let neighbours = near
            .rows(i)
            .iter()
            .zip(near.distances(i))
            .map(|(&n, d)| (format!("{}  {d:.2}", key(n as usize)), frame(n as usize)))
            .collect();
        let cell = l.state[row]
            .zip(l.distractor[row])
            .map_or_else(String::new, |(s, d)| format!(", state {s}, distractor {d}"));
        let reward = l.reward[row].map_or_else(String::new, |r| format!(", reward {r:.3}"));
        let [x, y] = made.positions[row];
        let text = format!("episode {}, step {}{cell}{reward}", l.episode[row], l.step[row]);
        points.push(LivePoint { x, y, text, color: l.step[row] as f32 / longest, frame: frame(row), neighbours });
    }
    let every = made.positions.len().div_ceil(20_000).max(1);
    let background = made.positions.iter().step_by(every).copied().collect();
    Ok(LiveMap { color_name: "step".into(), background, points, frames: pictures })
}
