//! `probe`: what can be read from the latent?

mod rows;
mod shown;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vibes_data::relative_place;

use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::Figure;
use crate::input::{Asked, Frames, ReadLatents, UserColumn, find_recording, read_beside};
use crate::picture::number::fixed;
use rows::{Opened, Rows, usable};
use shown::{DISTRACTORS, Shown, TARGETS, TASK, section};
use vibes_measure::episodes::PROBE_EPISODES;
use vibes_measure::probes::{Fit, ProbeOptions, ProbeScore, Quantity, Sample, Values, held_out_trajectories, probe};
use vibes_measure::{Error, Table};

/// Measure what can be read from the latents: task quantities, which should be, and distractors, which should not.
///
/// Linear and nearest-neighbour probes are judged on trajectories that they were not fitted on, beside the same probes of past actions alone and of
/// shuffled quantities. With --fit, probes of numbers are fitted on the latents of other recordings, such as those that were trained on: these numbers are
/// called `probe/…`. Without it, and always for classes, they are cross-validated over the other trajectories of the same table, of which a grid has few:
/// `probe_cross_validated/…`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Latents of the same model that probes of numbers are fitted on, as of a training recording (`vibes-train encode RUN RECORDING`); given several times,
    /// all of them together, views of one state trajectory as one.
    #[arg(long, value_name = "LATENTS")]
    fit: Vec<PathBuf>,
    /// The recordings of the latents to fit on, in the same order [default: those that they name].
    #[arg(long, value_name = "FOLDER", requires = "fit")]
    fit_recording: Vec<PathBuf>,
    /// Episodes of the latents to fit on that are fitted on, at most.
    #[arg(long, value_name = "N", default_value_t = PROBE_EPISODES, requires = "fit")]
    probe_episodes: usize,
    /// Columns to read off as well, of the latents' table or of one that is joined: numbers by R², texts and truth values as classes. With --fit the
    /// latents to fit on need the same columns of numbers; classes are judged on held-out trajectories of the same table.
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    target: Vec<String>,
    /// A table of your own with the columns of --target, joined to the latents to fit on; may be given several times: all for the one --fit, or one for each.
    #[arg(long, value_name = "TABLE", requires = "fit", requires = "target")]
    fit_join: Vec<PathBuf>,
}

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: Input, fit: &[PathBuf]) -> Self {
        Self {
            input,
            fit: fit.to_vec(),
            fit_recording: Vec::new(),
            probe_episodes: PROBE_EPISODES,
            target: Vec::new(),
            fit_join: Vec::new(),
        }
    }

    /// That the lists beside --fit are as long as it is.
    fn check(&self) -> anyhow::Result<()> {
        let (fits, recordings, joins) = (self.fit.len(), self.fit_recording.len(), self.fit_join.len());
        if self.probe_episodes == 0 {
            return Err(wrong(
                "--probe-episodes is 0, at least 1 is needed (without --fit probes are cross-validated)",
            ));
        }
        if recordings > 0 && recordings != fits {
            return Err(wrong(format!("{recordings} of --fit-recording and {fits} of --fit, one for each is needed")));
        }
        if fits > 1 && joins > 0 && joins != fits {
            return Err(wrong(format!("{joins} of --fit-join and {fits} of --fit, one for each is needed")));
        }
        Ok(())
    }

    /// The tables that are joined to one of those to fit on.
    fn joins_of(&self, at: usize) -> Vec<PathBuf> {
        if self.fit.len() == 1 { self.fit_join.clone() } else { self.fit_join.get(at).cloned().into_iter().collect() }
    }
}

/// Most lines of the chart, so that it can be drawn at all: an imported recording may have hundreds of observations.
const CHARTED: usize = 200;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    options.check()?;
    let most = (!options.fit.is_empty()).then_some(options.probe_episodes);
    let given = json!({
        "fit": options.fit, "probe_episodes": most, "target": options.target, "fit_join": options.fit_join,
        "fit_recording": options.fit_recording,
    });
    let mut session = Session::open_with(&options.input, globals, "probe", given, &options.target)?;
    let judged = open_judged(options, &mut session)?;
    let fitted = open_fitted(options, &judged, &mut session)?;
    let judged = Rows::of(vec![judged], usize::MAX);
    let asked = quantities(&mut session, &judged, fitted.as_ref())?;
    let (tables, tables_to_fit) = (judged.tables()?, fitted.as_ref().map(Rows::tables).transpose()?);
    let asked = asked.that_can_be_held_out(&tables[0], &mut session)?;
    let scores = |at: usize| -> Result<Vec<ProbeScore>, Error> {
        let judged = Sample { table: tables[at], quantities: &asked.own };
        let fit = tables_to_fit
            .map_or(Fit::HeldOut, |tables| Fit::On(Sample { table: tables[at], quantities: &asked.theirs }));
        probe(judged, fit, ProbeOptions::default(), &mut session.rng())
    };
    let (latent, actions) = (scores(0)?, scores(1)?);
    let shown = Shown { sections: &asked.sections, quantities: &asked.own, latent, actions };
    let fitted_on = fitted_on(options, fitted.as_ref(), &session.out);
    shown.write(&mut session, &fitted_on)?;
    let mut chart = shown.chart(session.heading("What can be read from the latent"));
    if chart.rows.len() > CHARTED {
        session.remark(format!(
            "the chart shows the first {CHARTED} of {} quantities; all are in probes.arrow",
            chart.rows.len()
        ));
        chart.rows.truncate(CHARTED);
    }
    session.save(&Figure::ProbeChart(chart), "probes")?;
    let line = line(&shown, &asked.single, fitted.as_ref());
    Ok(session.finish(line))
}

/// What probes of numbers were fitted on: the tables and how many episodes of them, or the judged table itself. Classes are always cross-validated.
fn fitted_on(options: &Options, fitted: Option<&Rows>, out: &Path) -> Value {
    let places: Vec<String> = options.fit.iter().map(|path| relative_place(path, out)).collect();
    let numbers = fitted.map_or_else(
        || json!("cross-validation"),
        |rows| json!({ "latents": places, "episodes": rows.episodes.0, "of_episodes": rows.episodes.1 }),
    );
    json!({ "numbers": numbers, "classes": "cross-validation" })
}

/// The verb's line of result; `single` are the sections of what was left out because it is of one trajectory.
fn line(shown: &Shown<'_>, single: &[&'static str], fitted: Option<&Rows>) -> String {
    let mean = |section: &'static str| {
        let none = if single.contains(&section) { "nothing (none can be held out)" } else { "nothing (none varies)" };
        mean_text(section, &shown.linear(section)).unwrap_or_else(|| none.to_owned())
    };
    let has_own = shown.sections.contains(&TARGETS) || single.contains(&TARGETS);
    let own = if has_own { format!(", of your columns {}", mean(TARGETS)) } else { String::new() };
    let probes = fitted.map_or_else(
        || "cross-validated linear probes".to_owned(),
        |rows| format!("linear probes fitted on {} episodes of other recordings", rows.episodes.0),
    );
    format!(
        "probe: {probes} read of the task {}, of the distractors {}{own} (R², accuracy over chance; below 0 counts as 0 in a mean)",
        mean(TASK),
        mean(DISTRACTORS)
    )
}

/// The mean of a section's scores, which rise, with the one that it may hide: what is read best of the distractors, else what is read worst. An R² has no lower bound,
/// so that one below 0 counts as 0.
fn mean_text(section: &str, scores: &[(&str, f64)]) -> Option<String> {
    let (worst, best) = (scores.first()?, scores.last()?);
    let mean = scores.iter().map(|score| score.1.max(0.0)).sum::<f64>() / scores.len() as f64;
    let (word, (name, score)) = if section == DISTRACTORS { ("best", best) } else { ("worst", worst) };
    let single = if scores.len() > 1 { format!(" ({word}: {name}, {})", fixed(*score, 3)) } else { String::new() };
    Some(format!("a mean of {}{single}", fixed(mean, 3)))
}

/// The session's latents with their recording, and their rows that have all that is asked for.
fn open_judged(options: &Options, session: &mut Session) -> anyhow::Result<Opened> {
    let frames = session.needed_frames("probe")?;
    let (keep, outside) = usable(&session.latents);
    if outside > 0 {
        session.remark(format!("{outside} rows lie outside the grid that the others are on and were left out"));
    }
    let rows: Vec<usize> = keep.iter().copied().filter(|&row| session.columns.iter().all(|c| c.1.has(row))).collect();
    if rows.len() < keep.len() {
        let without = keep.len() - rows.len();
        session.remark(format!("{without} rows have no value of {} and were left out", options.target.join(" or ")));
    }
    if rows.is_empty() {
        let asked = options.target.join(" and ");
        return Err(wrong(format!("no row has a value of {asked}: {}", session.path.display())));
    }
    let (latents, columns) = (std::mem::take(&mut session.latents), std::mem::take(&mut session.columns));
    Ok(Opened { latents, columns, frames, rows })
}

/// The rows to fit on; none without --fit.
fn open_fitted(options: &Options, judged: &Opened, session: &mut Session) -> anyhow::Result<Option<Rows>> {
    if options.fit.is_empty() {
        return Ok(None);
    }
    let open = |at: usize| open_to_fit(options, at, judged, session);
    let tables = (0..options.fit.len()).map(open).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Some(Rows::of(tables, options.probe_episodes)))
}

/// One table of latents to fit on, with its recording and with those columns of the judged ones that are numbers.
fn open_to_fit(options: &Options, at: usize, judged: &Opened, session: &mut Session) -> anyhow::Result<Opened> {
    let path = options.fit[at].as_path();
    let is_number = |column: &&(String, UserColumn)| matches!(column.1, UserColumn::Numbers(_));
    let numbers: Vec<String> = judged.columns.iter().filter(is_number).map(|column| column.0.clone()).collect();
    let recording = options.fit_recording.get(at).cloned();
    let asked = Asked { rows: None, joins: options.joins_of(at), columns: numbers, recording };
    let ReadLatents { latents, columns, remarks } = read_beside(path, &asked, &session.origin)?;
    remarks.into_iter().for_each(|remark| session.remark(format!("to fit on: {remark}")));
    if let Some((name, _)) = columns.iter().find(|column| !is_number(column)) {
        return Err(wrong(format!(
            "--target {name}: it holds numbers in the latents that are judged, and texts or truth values in those to fit on: {}",
            path.display()
        )));
    }
    let usable = usable(&latents).0;
    let rows: Vec<usize> = usable.iter().copied().filter(|&row| columns.iter().all(|c| c.1.has(row))).collect();
    if rows.is_empty() {
        let asked = asked.columns.join(" and ");
        return Err(wrong(format!("no row of the latents to fit on has a value of {asked}: {}", path.display())));
    }
    if rows.len() < usable.len() {
        let (without, asked) = (usable.len() - rows.len(), asked.columns.join(" or "));
        session.remark(format!("{without} rows of the latents to fit on have no value of {asked} and were left out"));
    }
    let named = latents.source.recording.as_deref().and_then(|named| find_recording(named, path));
    let recording = options.fit_recording.get(at).cloned().or(named).ok_or_else(|| {
        wrong(format!(
            "the recording of the latents to fit on is not there; name it with --fit-recording: {}",
            path.display()
        ))
    })?;
    let frames = Frames::open(&recording, &latents)?;
    let width = |of: &Opened| (of.latents.dims, of.frames.recording().manifest().spec.action_len());
    let opened = Opened { latents, columns, frames, rows };
    if width(&opened) != width(judged) {
        let ((dims, axes), (own, own_axes)) = (width(&opened), width(judged));
        return Err(wrong(format!(
            "the latents to fit on have {dims} dimensions and {axes} actions, those that are judged {own} and {own_axes}; both must be of one model: {}",
            path.display()
        )));
    }
    if !files(&opened).is_disjoint(&files(judged)) {
        session.remark(format!(
            "an episode that is judged is among those to fit on, so that the numbers say nothing of new episodes: {}",
            path.display()
        ));
    }
    Ok(opened)
}

/// What the files of the episodes hold that the latents are of, by their checksums, which know a copy.
fn files(opened: &Opened) -> HashSet<&str> {
    let encoded: HashSet<u32> = opened.latents.episode.iter().copied().collect();
    let episodes = opened.frames.recording().episodes().iter();
    episodes.filter(|entry| encoded.contains(&entry.index)).map(|entry| entry.arrow.sha256.as_str()).collect()
}

/// What is read: the quantities that vary with the section of each, and their values in the rows to fit on, which are empty without --fit.
#[derive(Default)]
struct Read {
    sections: Vec<&'static str>,
    own: Vec<Quantity>,
    theirs: Vec<Quantity>,
    /// The sections of quantities that vary, but have one trajectory alone.
    single: Vec<&'static str>,
}

impl Read {
    fn push(&mut self, section: &'static str, own: Quantity, theirs: Option<Quantity>) {
        self.sections.push(section);
        self.own.push(own);
        self.theirs.extend(theirs);
    }

    /// Without the quantities that are cross-validated and have one trajectory alone, as the videos of a grid of one column; an error where that are all.
    fn that_can_be_held_out(self, table: &Table<'_>, session: &mut Session) -> anyhow::Result<Self> {
        let (mut kept, mut single) = (Self::default(), Vec::new());
        let mut theirs = self.theirs.into_iter();
        for (section, own) in self.sections.into_iter().zip(self.own) {
            let theirs = theirs.next();
            let is_fitted_elsewhere = theirs.is_some() && !matches!(own.values, Values::Classes(_));
            if is_fitted_elsewhere || held_out_trajectories(table, own.hold_out)? > 1 {
                kept.push(section, own, theirs);
            } else {
                kept.single.push(section);
                single.push(own.name);
            }
        }
        if kept.own.is_empty() {
            return Err(Error::TooFewRows { what: "a probe: trajectories", needed: 2, found: 1 }.into());
        }
        if !single.is_empty() {
            let names = single.join(", ");
            session.remark(format!(
                "{names} are of one trajectory here, where a probe has none to be judged on, and were left out"
            ));
        }
        Ok(kept)
    }
}

/// All that can be read of the judged rows: what their recording says, and the user's own columns.
fn quantities(session: &mut Session, judged: &Rows, fitted: Option<&Rows>) -> anyhow::Result<Read> {
    let mut read = recorded(session, judged, fitted);
    for target in &judged.targets {
        let name = &target.name;
        if read.own.iter().any(|quantity| quantity.name == *name) {
            return Err(wrong(format!(
                "--target {name}: a quantity of the recording has this name; rename the column"
            )));
        }
        if target.values.vary() {
            // Classes are never fitted elsewhere; any values keep their place.
            let theirs = fitted.map(|rows| rows.targets.iter().find(|theirs| theirs.name == *name).unwrap_or(target));
            read.push(TARGETS, target.clone(), theirs.cloned());
        } else {
            session.remark(format!("{name} does not vary and was left out"));
        }
    }
    if read.own.is_empty() {
        anyhow::bail!(
            "there is nothing to read off these {} latents: nothing in their recording varies: {}",
            judged.len(),
            session.path.display()
        );
    }
    Ok(read)
}

/// What the recording says of the judged rows and what varies among them.
fn recorded(session: &mut Session, judged: &Rows, fitted: Option<&Rows>) -> Read {
    let (mut read, mut flat, mut unnamed) = (Read::default(), Vec::new(), Vec::new());
    for readable in judged.readable() {
        let Some(quantity) = judged.quantity(&readable.name) else { continue };
        if !quantity.values.vary() {
            flat.push(quantity.name);
            continue;
        }
        let theirs = fitted.map(|rows| rows.quantity(&readable.name));
        let theirs = match theirs {
            // Classes are never fitted elsewhere; any values keep their place.
            Some(None) if readable.is_class() => Some(quantity.clone()),
            Some(None) => {
                unnamed.push(quantity.name);
                continue;
            }
            Some(same) => same,
            None => None,
        };
        read.push(section(readable.about), quantity, theirs);
    }
    if !flat.is_empty() {
        session.remark(format!("{} do not vary in this recording and were left out", flat.join(", ")));
    }
    if !unnamed.is_empty() {
        let names = unnamed.join(", ");
        session.remark(format!("the recordings to fit on do not name {names}, which were left out"));
    }
    read
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_hides_neither_the_distractor_that_is_read_nor_the_task_that_is_not() {
        let scores = [("camera r", -2.0), ("colour", 0.06), ("video", 0.94)];
        assert_eq!(mean_text(DISTRACTORS, &scores).as_deref(), Some("a mean of 0.333 (best: video, 0.940)"));
        assert_eq!(mean_text(TASK, &scores).as_deref(), Some("a mean of 0.333 (worst: camera r, -2.000)"));
        assert_eq!(mean_text(TASK, &scores[1..2]).as_deref(), Some("a mean of 0.060"));
        assert_eq!(mean_text(TASK, &[]), None);
    }
}
