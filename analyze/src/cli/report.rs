//! `report`: one self-contained page with everything.

mod maps;
mod verdict;
mod words;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::{Value, json};
use vibes_command::Given;
use vibes_data::{RunFolder, is_same_place, whole};

use super::maps::MapOptions;
use super::session::{Input, Session};
use super::{
    Globals, Outcome, clusters, compare, curves, decode, distinct_places, gaps, grid, invariance, nn, probe, say,
    symmetry, umap, wrong,
};
use crate::input::{InputError, Run};
use crate::picture::svg;
use crate::report::{Chapter, Page, Section, Shown, write};
use maps::live_map;
use verdict::{Known, verdict};
use words::{Verb, questions};

/// Write one HTML page about one or more runs: the verdict in one table, every figure and number, and interactive maps.
///
/// On a map, a click shows a row's frame and its nearest neighbours, a slider runs through its episode, and a selected region shows the frames in it;
/// points are coloured by any column. The page needs no network and no other file.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    given: Given,
    /// Tables of latents, or run folders, of which the newest latents*.arrow is taken [default: the newest latents*.arrow below the folder runs, or below the current folder].
    #[arg(value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The recording the latents were encoded from, which also gives what a table of one's own lacks: cells, rewards, the keys of a plain array [default: the one that
    /// their metadata names].
    #[arg(long, value_name = "FOLDER")]
    recording: Option<PathBuf>,
    /// Go on without the recording: no pictures, no task state.
    #[arg(long, conflicts_with = "recording")]
    no_frames: bool,
    /// Where the output goes [default: the folder `figures` beside the first latents].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A line under every title, as in "after 300 updates: barely trained".
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    /// Points of each map that can be chosen, beside those of six episodes that can be played.
    #[arg(long, default_value_t = 600)]
    points: usize,
    /// Columns to colour the maps by, beside those of the recording: of the latents' table or of one that is joined.
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    color: Vec<String>,
    /// A table of your own (CSV, Parquet, Arrow, npz), joined on episode and step, or on episode alone; may be given several times.
    #[arg(long, value_name = "TABLE")]
    join: Vec<PathBuf>,
    /// Latents of the same model that probes of numbers are fitted on, as of a training recording, where the report is of one run; may be given several times
    /// [default: probes are cross-validated].
    #[arg(long, value_name = "LATENTS")]
    fit: Vec<PathBuf>,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if options.points == 0 {
        return Err(wrong("--points is 0, at least 1 is needed"));
    }
    if options.runs.len() > 1 && !options.fit.is_empty() {
        return Err(wrong("--fit names latents of one model, and these are several runs; write a report of each"));
    }
    distinct_places(&options.runs)?;
    let inputs: Vec<Option<&Path>> =
        if options.runs.is_empty() { vec![None] } else { options.runs.iter().map(|r| Some(r.as_path())).collect() };
    let mut page = Page { note: options.note.clone(), ..Page::default() };
    let (mut out, mut known, mut task) = (options.output.clone(), Vec::<Known>::new(), None);
    for &input in &inputs {
        let session = Session::open_with(&source(options, input), globals, "report", json!({}), &options.color)?;
        let whole = out.get_or_insert_with(|| session.out.clone()).clone();
        let title = distinct(&name(&session.path), known.iter().map(|known| known.name.as_str()));
        let folder = if options.runs.len() > 1 { whole.join(&title) } else { whole };
        task = task.or(session.frames()?.map(|frames| frames.recording().manifest().spec.task.clone()));
        let of = input.filter(|path| path.is_dir()).unwrap_or(session.path.parent().unwrap_or(Path::new(".")));
        page.remarks.extend(older_latents(session.latents.source.checkpoint.as_deref(), &session.path, of));
        let run = read_run(of, &title, &mut page.remarks);
        let (chapter, documents) = chapter(options, globals, session, (title, &folder), &mut page)?;
        known.push(Known { name: chapter.title.clone(), documents, run });
        page.chapters.push(chapter);
    }
    let out = out.unwrap_or_default();
    if options.runs.len() > 1 {
        page.chapters.push(side_by_side(options, globals, &out));
    }
    // Why one cannot be read is among the remarks.
    let runs: Vec<PathBuf> = options.runs.iter().filter(|r| Run::read(r).is_ok()).cloned().collect();
    let named: Vec<(&str, &Run)> =
        known.iter().filter_map(|known| Some((known.name.as_str(), known.run.as_ref()?))).collect();
    page.remarks.extend(gaps::remarks(&named, &gaps::GAPS));
    if !runs.is_empty() {
        let mut training = training(options, globals, runs, &out);
        let said = &page.remarks;
        training.sections.iter_mut().for_each(|section| section.remarks.retain(|remark| !said.contains(remark)));
        page.chapters.push(training);
    }
    page.verdict = verdict(&known);
    let names: Vec<&str> = known.iter().map(|known| known.name.as_str()).collect();
    let subject = task.as_ref().map_or_else(|| "Latents".to_string(), |task| format!("Latents of {task}"));
    page.title = format!("{subject}: {}", names.join(", "));
    page.origin = format!(
        "Written by vibes-analyze {}. Numbers, tables and single figures lie in the folder of this page.",
        env!("CARGO_PKG_VERSION")
    );
    let path = out.join("report.html");
    let html = page.html();
    write(&path, &html)?;
    let figures: usize = page.chapters.iter().flat_map(|c| &c.sections).map(|s| s.figures.len()).sum();
    let line = format!(
        "report: {figures} figures of {} tables of latents on one page of {:.1} MB",
        inputs.len(),
        html.len() as f64 / 1e6
    );
    let json = json!({ "report": path, "figures": figures, "bytes": html.len() });
    Ok(Outcome { line, remarks: page.remarks, files: vec![path], json })
}

/// The run that latents lie in, with what must be known of it; none where they lie in no run, or in one that cannot be read.
fn read_run(folder: &Path, name: &str, remarks: &mut Vec<String>) -> Option<Run> {
    match Run::read(folder) {
        Ok(run) => {
            remarks.extend(run.remarks());
            Some(run)
        }
        Err(InputError::NoRun { .. }) => None,
        Err(error) => {
            // Where it lies on this machine is nobody's business.
            let fact = error.to_string().replace(&format!("{}/", folder.display()), "");
            remarks.push(format!(
                "{name} is shown without returns, gaps and curves, since its run cannot be read: {fact}"
            ));
            None
        }
    }
}

/// That latents are of an older checkpoint than the run's newest one, which its returns, gaps and curves on the same page may be of.
fn older_latents(checkpoint: Option<&str>, latents: &Path, run: &Path) -> Option<String> {
    // The checkpoint itself may be gone: a run keeps its last few.
    let encoded = whole(&latents.parent()?.join(checkpoint?));
    let folder = encoded.parent()?;
    let own: u64 = folder.file_name()?.to_str()?.parse().ok()?;
    if !is_same_place(folder.parent()?, &run.join("checkpoints")) {
        return None;
    }
    let newest = RunFolder::at(run).checkpoints().last().copied().filter(|newest| *newest > own)?;
    let (run, latents) = (RunFolder::at(run).name(), latents.file_name()?.to_string_lossy());
    Some(format!(
        "{run}/{latents} was encoded after {} updates, and the run has gone on to {}: returns, gaps and curves here are newer than what is said of the latents; `vibes-train encode` makes new ones",
        own, newest
    ))
}

fn source(options: &Options, input: Option<&Path>) -> Input {
    Input::named(input, options.recording.as_deref(), options.output.as_deref(), options.seed, options.note.as_deref())
        .joined(&options.join)
        .less_frames(options.no_frames)
}

/// The name of the folder that latents lie in, with their own unless it is `latents`: a run may hold several tables.
fn name(latents: &Path) -> String {
    let own = latents.file_stem().map_or_else(|| "latents".into(), |name| name.to_string_lossy().into_owned());
    // A folder's name has no ending: what stands behind its last dot may be all that tells it from others.
    match latents.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned()) {
        Some(folder) if own == "latents" => folder,
        Some(folder) => format!("{folder}-{own}"),
        None => own,
    }
}

/// The name, with a number behind it if it is taken: runs in different places may be called alike.
fn distinct<'n>(name: &str, taken: impl Iterator<Item = &'n str>) -> String {
    let taken: Vec<&str> = taken.collect();
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| !taken.contains(&name.as_str())).unwrap_or_default()
}

/// What a decoder draws: the question, and how its answer is read.
const SHOWN: (&str, &str) = (
    "What do the latents show of the pictures?",
    "A decoder fitted on frozen latents can draw no more than they hold. Good: the body where it is, before a grey mean of backgrounds, also in the prediction.",
);

/// The answers about one table of latents, and the documents that they come from.
fn chapter(
    options: &Options,
    globals: &Globals,
    mut session: Session,
    (title, folder): (String, &Path),
    page: &mut Page,
) -> anyhow::Result<(Chapter, BTreeMap<&'static str, Value>)> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    session.out = folder.to_path_buf();
    let frames = session.frames()?;
    if frames.is_none() {
        let fact = if options.no_frames { "are shown without their recording" } else { "name no recording" };
        page.map_remarks.push(format!("the latents of {title} {fact}, so there are no frames"));
    }
    let made = MapOptions::usual(&options.given).map_or_other(&mut session, globals)?;
    take_remarks(options, &mut session, &title, &mut page.remarks);
    page.maps.push(live_map(options, &session, &title, &made, frames.as_ref())?);
    let rotates = frames.as_ref().is_some_and(symmetry::applies);
    let (mut sections, mut documents) = (Vec::new(), BTreeMap::new());
    let spec = frames.as_ref().map(|frames| &frames.recording().manifest().spec);
    for question in questions(spec).into_iter().filter(|question| question.verb != Verb::Symmetry || rotates) {
        let verb = question.verb.name();
        say(globals, format_args!("report: {verb}"));
        let section = Section { title: question.title.into(), reading: question.reading, ..Section::default() };
        let (section, document) = answer(ask(options, question.verb, &session.path, folder), section);
        sections.push(section);
        documents.insert(verb, document);
    }
    if let Some(run) = session.path.parent().filter(|run| run.join("decoded.arrow").is_file()) {
        let section = Section { title: SHOWN.0.into(), reading: SHOWN.1.into(), ..Section::default() };
        sections.push(answer(strips(options, &[run.to_path_buf()], folder), section).0);
    }
    let l = &session.latents;
    // The last names say which checkpoint it is; where it lies on this machine is nobody's business.
    let names = |checkpoint: &str| {
        let names: Vec<&str> = checkpoint.rsplit('/').take(3).filter(|name| *name != "..").collect();
        names.into_iter().rev().collect::<Vec<_>>().join("/")
    };
    let from = l.source.checkpoint.as_deref().map_or_else(String::new, |c| format!(", encoded by {}", names(c)));
    let origin = format!("{} rows of {} dimensions{from}; map: {}", l.len(), l.dims, made.quality_text());
    Ok((Chapter { title, origin, sections }, documents))
}

/// Puts what was said of opening the latents and of their map, such as rows that a joined table lacks, among the page's remarks, each once.
fn take_remarks(options: &Options, session: &mut Session, title: &str, remarks: &mut Vec<String>) {
    let of = if options.runs.len() > 1 { format!("{title}: ") } else { String::new() };
    for remark in std::mem::take(&mut session.outcome.remarks) {
        // Where a joined table lies on this machine is nobody's business.
        let named = options.join.iter().fold(remark, |remark, table| {
            remark.replace(&table.display().to_string(), &shown_names(std::slice::from_ref(table)))
        });
        let remark = format!("{of}{named}");
        if !remarks.contains(&remark) {
            remarks.push(remark);
        }
    }
}

/// What the verbs that a report runs may print: nothing.
const SILENT: Globals = Globals { verbose: false, quiet: true, json: false };

/// Runs a verb on one table of latents.
fn ask(options: &Options, verb: Verb, latents: &Path, folder: &Path) -> anyhow::Result<Outcome> {
    let (recording, note) = (options.recording.as_deref(), options.note.as_deref());
    let input = Input::named(Some(latents), recording, Some(folder), options.seed, note).less_frames(options.no_frames);
    match verb {
        Verb::Nn => nn::run(&nn::Options::of(input), &SILENT),
        Verb::Umap => umap::run(&umap::Options::of(input.into_table()), &SILENT),
        Verb::Grid => grid::run(&grid::Options::of(input.into_table()), &SILENT),
        Verb::Clusters => clusters::run(&clusters::Options::of(input), &SILENT),
        Verb::Invariance => invariance::run(&invariance::Options::of(input), &SILENT),
        Verb::Probe => probe::run(&probe::Options::of(input, &options.fit), &SILENT),
        Verb::Symmetry => symmetry::run(&symmetry::Options::of(input), &SILENT),
    }
}

/// What decoders draw from the latents of some runs.
fn strips(options: &Options, runs: &[PathBuf], folder: &Path) -> anyhow::Result<Outcome> {
    decode::run(&decode::Options::of(runs, folder, options.note.as_deref()), &SILENT)
}

/// Puts the figures and the line of a verb into the section; a verb that failed says why.
fn answer(outcome: anyhow::Result<Outcome>, mut section: Section) -> (Section, Value) {
    match outcome {
        Ok(outcome) => {
            let svg = outcome.files.iter().filter(|f| f.extension().is_some_and(|e| e == "svg"));
            let read = |f: &PathBuf| Some(shown(std::fs::read_to_string(f).ok()?, &section.title, &outcome.line));
            section.figures = svg.filter_map(read).collect();
            section.result = outcome.line;
            section.remarks = outcome.remarks;
            section.numbers = Some(format!("{:#}", outcome.json)).filter(|n| n.len() < 200_000);
            (section, outcome.json)
        }
        Err(error) => {
            section.result = format!("not available: {error:#}");
            (section, Value::Null)
        }
    }
}

/// A figure with its own title for those who cannot see it: several under one question show different things. One without a title, or with one of a word ("Training"), has the
/// question and its answer.
fn shown(document: String, question: &str, line: &str) -> Shown {
    let own = svg::title(&document).filter(|title| title.contains(' '));
    Shown::new(document, own.unwrap_or_else(|| format!("{question} {line}")))
}

/// The chapter on several tables of latents: which is better?
fn side_by_side(options: &Options, globals: &Globals, out: &Path) -> Chapter {
    say(globals, "report: compare");
    let reading = "Tables of the same recording. Good: the share of the state high, that of the distractor low, the same state found far more often than by chance.";
    let section = Section { title: "Which is more invariant?".into(), reading: reading.into(), ..Section::default() };
    let compared = compare::Options::of(&options.runs, out, options.seed, options.note.as_deref())
        .with_recording(options.recording.as_deref(), options.no_frames);
    let mut sections = vec![answer(compare::run(&compared, &SILENT), section).0];
    if options.runs.iter().all(|run| run.join("decoded.arrow").is_file()) {
        let section = Section { title: SHOWN.0.into(), reading: SHOWN.1.into(), ..Section::default() };
        sections.push(answer(strips(options, &options.runs, out), section).0);
    }
    Chapter { title: "Side by side".into(), origin: shown_names(&options.runs), sections }
}

/// Runs as they are named in the page: by their folders, not by where these lie on this machine.
fn shown_names(paths: &[PathBuf]) -> String {
    let name = |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    paths.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// The chapter on training: curves over all runs.
fn training(options: &Options, globals: &Globals, runs: Vec<PathBuf>, out: &Path) -> Chapter {
    say(globals, "report: curves");
    let reading = "Log-likelihoods in nats a row, on the batches of training. A held-out gap is by how much a critic that sees the whole history predicts better than heads refitted on the model's own state and the action (h, s, a); it falls to 0 for a bisimulation.";
    let section = Section { title: "How did training go?".into(), reading: reading.into(), ..Section::default() };
    let origin = shown_names(&runs);
    let curves = curves::run(&curves::Options::of(runs, out, options.note.as_deref()), &SILENT);
    Chapter { title: "Training".into(), origin, sections: vec![answer(curves, section).0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Picture;

    #[test]
    fn a_folder_keeps_all_of_its_name() {
        assert_eq!(name(Path::new("runs/dynamics_weight=0.03,seed=0/latents.arrow")), "dynamics_weight=0.03,seed=0");
        assert_eq!(name(Path::new("runs/v1.5/latents-grid.arrow")), "v1.5-latents-grid");
        assert_eq!(name(Path::new("later.arrow")), "later");
    }

    #[test]
    fn figures_under_one_question_are_told_apart_without_being_seen() {
        let dir = tempfile::tempdir().expect("folder");
        let file = |title: &str| {
            let path = dir.path().join(format!("{title}.svg"));
            std::fs::write(&path, svg::render(&Picture::new(9.0, 9.0, format!("coloured by {title}"))))
                .expect("figure");
            path
        };
        let outcome =
            Outcome { line: "umap: 9 latents".into(), files: vec![file("time"), file("reward")], ..Outcome::default() };
        let (section, _) = answer(Ok(outcome), Section { title: "What is near?".into(), ..Section::default() });
        let alts: Vec<&str> = section.figures.iter().map(|figure| figure.alt.as_str()).collect();
        assert_eq!(alts, ["coloured by time", "coloured by reward"]);
        assert_eq!(shown("<svg/>".into(), "What?", "nothing").alt, "What? nothing");
    }

    #[test]
    fn a_run_that_cannot_be_read_is_said_to_be_left_out() {
        let run = tempfile::tempdir().expect("folder");
        let mut remarks = Vec::new();
        assert!(read_run(run.path(), "mine", &mut remarks).is_none() && remarks.is_empty(), "no run: {remarks:?}");
        std::fs::write(run.path().join("metrics.jsonl"), "{\"update\":10,\"loss\":2.5}\n").expect("metrics");
        assert!(read_run(run.path(), "mine", &mut remarks).is_some() && remarks.is_empty(), "{remarks:?}");
        std::fs::write(run.path().join("evaluation.json"), "{\"report\":").expect("evaluation");
        assert!(read_run(run.path(), "mine", &mut remarks).is_none());
        assert!(
            remarks[0].starts_with("mine is shown without") && remarks[0].contains("evaluation.json"),
            "{remarks:?}"
        );
    }

    #[test]
    fn latents_of_an_older_checkpoint_are_said_to_be() {
        let run = tempfile::tempdir().expect("folder");
        for update in ["000010", "000020"] {
            let folder = run.path().join("checkpoints").join(update);
            std::fs::create_dir_all(&folder).expect("folder");
            std::fs::write(folder.join("model.safetensors"), "weights").expect("file");
        }
        let latents = run.path().join("latents.arrow");
        let of = |update: &str| {
            older_latents(Some(&format!("checkpoints/{update}/model.safetensors")), &latents, run.path())
        };
        std::fs::remove_dir_all(run.path().join("checkpoints/000010")).expect("folder");
        let said = of("000010").expect("remark, though it is no longer kept");
        assert!(said.contains("after 10 updates, and the run has gone on to 20"), "{said}");
        assert_eq!((of("000020"), of("000030"), older_latents(None, &latents, run.path())), (None, None, None));
    }
}
