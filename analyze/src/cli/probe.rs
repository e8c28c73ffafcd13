//! `probe`: what can be read from the latent?

use std::path::{Path, PathBuf};

use serde_json::json;
use vibes_data::{About, Latents, Readable};

use super::invariance::ends;
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::actions::action_features;
use crate::figures::{Figure, ProbeChart, ProbeMark, ProbeRow};
use crate::input::{Asked, Frames, ReadLatents, UserColumn, find_recording, read_asked};
use crate::output::Column;
use vibes_measure::Table;
use vibes_measure::intervals::Interval;
use vibes_measure::numbers::probe_numbers;
use vibes_measure::probes::{Fit, HoldOut, Probe, ProbeOptions, ProbeScore, Quantity, Sample, Values, probe};

/// Measure what can be read from the latents: task quantities, which should be, and distractors, which should not.
///
/// Linear and nearest-neighbour probes are judged on trajectories that they were not fitted on, beside the same probes of past actions alone and of
/// shuffled quantities. Probes of numbers are fitted on the other trajectories of the same table, or with --fit on the latents of another recording,
/// such as a training recording: the ten states of a grid are few to fit on.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Latents of the same model that probes of numbers are fitted on, as of a training recording (`vibes-train encode RUN RECORDING`).
    #[arg(long, value_name = "LATENTS")]
    fit: Option<PathBuf>,
    /// The recording of the latents to fit on [default: the one that they name].
    #[arg(long, value_name = "FOLDER", requires = "fit")]
    fit_recording: Option<PathBuf>,
    /// Columns to read off as well, of the latents' table or of one that is joined: numbers by R², texts and truth values as classes. With --fit the
    /// latents to fit on need the same columns of numbers; classes are judged on held-out trajectories of the same table.
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    target: Vec<String>,
    /// A table of your own with the columns of --target, joined to the latents to fit on; may be given several times.
    #[arg(long, value_name = "TABLE", requires = "fit", requires = "target")]
    fit_join: Vec<PathBuf>,
}

const TASK: &str = "task: high is good";
const SYMMETRY: &str = "superfluous by symmetry";
const DISTRACTORS: &str = "distractors: at chance is good";
const TARGETS: &str = "columns of your own";

/// The section of what a recording says of itself.
fn section(about: About) -> &'static str {
    match about {
        About::Task => TASK,
        About::Symmetry => SYMMETRY,
        About::Distractor => DISTRACTORS,
    }
}

/// Latents, the features of the same rows' past actions, and their recording.
struct Rows {
    latents: Latents,
    actions: (usize, Vec<f32>),
    frames: Frames,
}

impl Rows {
    fn new(latents: Latents, frames: Frames) -> Self {
        let actions = action_features(&latents, &frames);
        Self { latents, actions, frames }
    }

    fn table<'a>(&'a self, dims: usize, values: &'a [f32]) -> Result<Table<'a>, vibes_measure::Error> {
        let l = &self.latents;
        Table::new(dims, values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)
    }

    /// The tables of the latents and of past actions.
    fn tables(&self) -> Result<[Table<'_>; 2], vibes_measure::Error> {
        Ok([self.table(self.latents.dims, &self.latents.latent)?, self.table(self.actions.0, &self.actions.1)?])
    }

    /// The values of a quantity; none if some row has none.
    fn quantity(&self, readable: &Readable) -> Option<Quantity> {
        let l = &self.latents;
        let of = |row: usize| readable.value(self.frames.view(l.episode[row])?, l.step[row] as usize);
        let values: Vec<f64> = (0..l.len()).map(of).collect::<Option<_>>()?;
        let on_grid = l.state.iter().all(Option::is_some);
        let hold_out = match readable.about {
            About::Distractor => HoldOut::of_distractor(readable.is_class(), on_grid),
            _ => HoldOut::State,
        };
        let values = if readable.is_class() {
            Values::Classes(values.into_iter().map(|class| class as u32).collect())
        } else {
            Values::Numbers(values)
        };
        Some(Quantity { name: readable.name.clone(), hold_out, values })
    }
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let given = json!({ "fit": options.fit, "target": options.target, "fit_join": options.fit_join });
    let mut session = Session::open_with(&options.input, globals, "probe", given, &options.target)?;
    let frames = session.needed_frames("probe")?;
    let (keep, outside) = usable(&session.latents);
    if outside > 0 {
        session.remark(format!("{outside} rows lie outside the grid that the others are on and were left out"));
    }
    let whole: Vec<usize> = keep.iter().copied().filter(|&row| session.columns.iter().all(|c| c.1.has(row))).collect();
    if whole.len() < keep.len() {
        let without = keep.len() - whole.len();
        session.remark(format!("{without} rows have no value of {} and were left out", options.target.join(" or ")));
    }
    if whole.is_empty() {
        return Err(wrong(format!(
            "no row has a value of {}: {}",
            options.target.join(" and "),
            session.path.display()
        )));
    }
    let judged = Rows::new(chosen(&session.latents, &whole), frames);
    let fitted = options.fit.as_deref().map(|path| open_to_fit(path, options, &mut session)).transpose()?;
    let (fitted, their_targets) = fitted.unzip();
    let (mut sections, mut quantities, mut to_fit) = quantities(&mut session, &judged, fitted.as_ref());
    for (name, column) in session.columns.clone() {
        if quantities.iter().any(|quantity| quantity.name == name) {
            return Err(wrong(format!(
                "--target {name}: a quantity of the recording has this name; rename the column"
            )));
        }
        let target = target(&name, &column, &whole);
        if target.values.vary() {
            sections.push(TARGETS);
            if let Some(theirs) = &their_targets {
                let theirs = theirs.iter().find(|theirs| theirs.name == name);
                // Classes are never fitted elsewhere; any values keep their place.
                to_fit.push(theirs.unwrap_or(&target).clone());
            }
            quantities.push(target);
        } else {
            session.remark(format!("{name} does not vary and was left out"));
        }
    }
    if quantities.is_empty() {
        anyhow::bail!(
            "there is nothing to read off these {} latents: nothing in their recording varies: {}",
            judged.latents.len(),
            session.path.display()
        );
    }
    let tables = judged.tables()?;
    let tables_to_fit = fitted.as_ref().map(Rows::tables).transpose()?;
    let scores = |at: usize| {
        let judged = Sample { table: tables[at], quantities: &quantities };
        let fit =
            tables_to_fit.map_or(Fit::HeldOut, |tables| Fit::On(Sample { table: tables[at], quantities: &to_fit }));
        probe(judged, fit, ProbeOptions::default(), &mut session.rng())
    };
    let (of_latent, of_actions) = (scores(0)?, scores(1)?);
    session.save(&Figure::ProbeChart(draw(&session, &sections, &quantities, &of_latent, &of_actions)), "probes")?;
    write(&mut session, &sections, &quantities, &of_latent, &of_actions)?;
    let mean = |section: &str| {
        let mean = mean_score(section, &sections, &quantities, &of_latent);
        mean.map_or_else(|| "nothing (none varies)".into(), |mean| format!("a mean of {mean:.3}"))
    };
    let own = if sections.contains(&TARGETS) { format!(", of your columns {}", mean(TARGETS)) } else { String::new() };
    let line = format!(
        "probe: linear probes read of the task {}, of the distractors {}{own} (R², accuracy over chance)",
        mean(TASK),
        mean(DISTRACTORS)
    );
    Ok(session.finish(line))
}

/// The latents to fit on, with their recording, and their values of those targets that are numbers.
fn open_to_fit(path: &Path, options: &Options, session: &mut Session) -> anyhow::Result<(Rows, Vec<Quantity>)> {
    let is_number = |column: &&(String, UserColumn)| matches!(column.1, UserColumn::Numbers(_));
    let numbers: Vec<String> = session.columns.iter().filter(is_number).map(|column| column.0.clone()).collect();
    let asked = Asked { rows: None, joins: options.fit_join.clone(), columns: numbers };
    let ReadLatents { latents: read, columns, remarks } = read_asked(path, &asked)?;
    remarks.into_iter().for_each(|remark| session.remark(format!("to fit on: {remark}")));
    if let Some((name, _)) = columns.iter().find(|column| !is_number(column)) {
        return Err(wrong(format!(
            "--target {name}: it holds numbers in the latents that are judged, and texts or truth values in those to fit on: {}",
            path.display()
        )));
    }
    let usable = usable(&read).0;
    let kept: Vec<usize> = usable.iter().copied().filter(|&row| columns.iter().all(|c| c.1.has(row))).collect();
    if kept.is_empty() {
        return Err(wrong(format!(
            "no row of the latents to fit on has a value of {}: {}",
            asked.columns.join(" and "),
            path.display()
        )));
    }
    if kept.len() < usable.len() {
        let without = usable.len() - kept.len();
        session.remark(format!(
            "{without} rows of the latents to fit on have no value of {} and were left out",
            asked.columns.join(" or ")
        ));
    }
    let targets = columns.iter().map(|(name, column)| target(name, column, &kept)).collect();
    let latents = chosen(&read, &kept);
    let recording = options.fit_recording.as_deref();
    let named = latents.source.recording.as_deref().and_then(|named| find_recording(named, path));
    let missing = || {
        wrong(format!(
            "the recording of the latents to fit on is not there; name it with --fit-recording: {}",
            path.display()
        ))
    };
    let recording = recording.map(Path::to_path_buf).or(named).ok_or_else(missing)?;
    let frames = Frames::open(&recording, &latents)?;
    Ok((Rows::new(latents, frames), targets))
}

/// The quantities that vary with the section of each, and their values in the rows to fit on.
fn quantities(
    session: &mut Session,
    judged: &Rows,
    fitted: Option<&Rows>,
) -> (Vec<&'static str>, Vec<Quantity>, Vec<Quantity>) {
    let (mut sections, mut own, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    let (mut flat, mut unnamed) = (Vec::new(), Vec::new());
    let others = fitted.map(|rows| rows.frames.recording().manifest().spec.readable()).unwrap_or_default();
    for readable in judged.frames.recording().manifest().spec.readable() {
        let Some(quantity) = judged.quantity(&readable) else { continue };
        if !quantity.values.vary() {
            flat.push(quantity.name);
            continue;
        }
        if let Some(rows) = fitted {
            let same = others.iter().find(|other| other.name == readable.name).and_then(|other| rows.quantity(other));
            match same {
                Some(same) => theirs.push(same),
                // Classes are never fitted elsewhere; any values keep their place.
                None if readable.is_class() => theirs.push(quantity.clone()),
                None => {
                    unnamed.push(quantity.name);
                    continue;
                }
            }
        }
        sections.push(section(readable.about));
        own.push(quantity);
    }
    if !flat.is_empty() {
        session.remark(format!("{} do not vary in this recording and were left out", flat.join(", ")));
    }
    if !unnamed.is_empty() {
        let names = unnamed.join(", ");
        session.remark(format!("the recording to fit on does not name {names}, which were left out"));
    }
    (sections, own, theirs)
}

/// A column of the user's own as a quantity of the chosen rows, all of which have a value.
fn target(name: &str, column: &UserColumn, rows: &[usize]) -> Quantity {
    let values = match column {
        UserColumn::Numbers(values) => Values::Numbers(rows.iter().map(|&row| values[row]).collect()),
        UserColumn::Kinds { of_row, .. } => Values::Classes(rows.iter().filter_map(|&row| of_row[row]).collect()),
    };
    Quantity { name: name.to_owned(), hold_out: HoldOut::State, values }
}

/// The rows that have a reward, so that every quantity has a value in every row (all rows if none has), and a cell if any has one, so that no
/// cell of a held-out state is left among the others. Also returns how many rows that have none are left out.
fn usable(l: &Latents) -> (Vec<usize>, usize) {
    let rewarded = |row: &usize| l.reward[*row].is_some_and(f32::is_finite);
    let on_grid = |row: &usize| l.state[*row].is_some() && l.distractor[*row].is_some();
    let mut keep: Vec<usize> = (0..l.len()).filter(rewarded).collect();
    if keep.is_empty() {
        keep = (0..l.len()).collect();
    }
    let all = keep.len();
    if keep.iter().any(on_grid) {
        keep.retain(on_grid);
    }
    let outside = all - keep.len();
    (keep, outside)
}

/// These rows of a table.
fn chosen(l: &Latents, keep: &[usize]) -> Latents {
    Latents {
        episode: keep.iter().map(|&r| l.episode[r]).collect(),
        step: keep.iter().map(|&r| l.step[r]).collect(),
        state: keep.iter().map(|&r| l.state[r]).collect(),
        distractor: keep.iter().map(|&r| l.distractor[r]).collect(),
        reward: keep.iter().map(|&r| l.reward[r]).collect(),
        dims: l.dims,
        latent: keep.iter().flat_map(|&r| l.row(r).iter().copied()).collect(),
        source: l.source.clone(),
    }
}

/// A score on the chart's scale: R² as it is; an accuracy as its share of the way from chance to 1.
fn scaled(i: &Interval, score: &ProbeScore) -> Interval {
    if score.measure != "accuracy" {
        return *i;
    }
    let over = |v: f64| (v - score.chance) / (1.0 - score.chance).max(1e-12);
    Interval { estimate: over(i.estimate), low: over(i.low), high: over(i.high) }
}

fn find<'s>(scores: &'s [ProbeScore], name: &str, which: Probe) -> Option<&'s ProbeScore> {
    scores.iter().find(|s| s.quantity == name && s.probe == which)
}

fn mean_score(section: &str, sections: &[&str], quantities: &[Quantity], scores: &[ProbeScore]) -> Option<f64> {
    let of = |q: &Quantity| find(scores, &q.name, Probe::Linear).map(|s| scaled(&s.score, s).estimate);
    let values: Vec<f64> = sections
        .iter()
        .zip(quantities)
        .filter(|(s, _)| **s == section)
        .filter_map(|(_, q)| of(q))
        .filter(|v| v.is_finite())
        .collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn draw(
    session: &Session,
    sections: &[&str],
    quantities: &[Quantity],
    scores: &[ProbeScore],
    control: &[ProbeScore],
) -> ProbeChart {
    let row = |(section, q): (&&str, &Quantity)| {
        let mut marks = Vec::new();
        let mut mark = |source: usize, score: Option<&ProbeScore>, shuffled: bool| {
            if let Some(s) = score {
                let i = scaled(if shuffled { &s.shuffled } else { &s.score }, s);
                marks.push(ProbeMark { source, score: i.estimate, interval: ends(&i) });
            }
        };
        mark(0, find(scores, &q.name, Probe::Linear), false);
        mark(1, find(scores, &q.name, Probe::Knn), false);
        mark(2, find(control, &q.name, Probe::Linear), false);
        mark(3, find(scores, &q.name, Probe::Linear), true);
        ProbeRow { section: (*section).into(), quantity: q.name.clone(), marks }
    };
    let (colors, single): (Vec<_>, Vec<_>) = sections.iter().zip(quantities).partition(|(_, q)| is_color(&q.name));
    let mut rows: Vec<ProbeRow> = single.into_iter().map(row).collect();
    // A task has up to a dozen materials of three channels: one line for all of them, each by itself in the table.
    let all: Vec<ProbeRow> = colors.into_iter().map(row).collect();
    rows.extend(mean_row(&all));
    ProbeChart {
        heading: session.heading("What can be read from the latent"),
        axis: "R², held-out trajectories (video: accuracy, 0 = chance)".into(),
        sources: ["latent, linear", "latent, kNN", "past actions, linear", "shuffled, linear"]
            .map(String::from)
            .to_vec(),
        rows,
    }
}

/// Whether a quantity is a channel of a material's colour.
fn is_color(name: &str) -> bool {
    [" red", " green", " blue"].iter().any(|channel| name.ends_with(channel))
}

/// The mean of several rows, source by source, without an interval.
fn mean_row(rows: &[ProbeRow]) -> Option<ProbeRow> {
    let first = rows.first()?;
    let mean = |source: usize| {
        let scores: Vec<f64> = rows
            .iter()
            .flat_map(|r| &r.marks)
            .filter(|m| m.source == source && m.score.is_finite())
            .map(|m| m.score)
            .collect();
        (!scores.is_empty()).then(|| ProbeMark {
            source,
            score: scores.iter().sum::<f64>() / scores.len() as f64,
            interval: None,
        })
    };
    let marks = (0..4).filter_map(mean).collect();
    Some(ProbeRow { section: first.section.clone(), quantity: format!("colours, mean of {}", rows.len()), marks })
}

fn write(
    session: &mut Session,
    sections: &[&str],
    quantities: &[Quantity],
    scores: &[ProbeScore],
    control: &[ProbeScore],
) -> anyhow::Result<()> {
    let section = |name: &str| quantities.iter().position(|q| q.name == name).map_or("", |i| short(sections[i]));
    let all: Vec<(&str, &ProbeScore)> =
        scores.iter().map(|s| ("latent", s)).chain(control.iter().map(|s| ("past_actions", s))).collect();
    let texts =
        |of: &dyn Fn(&str, &ProbeScore) -> String| Column::Text(all.iter().map(|(source, s)| of(source, s)).collect());
    let numbers = |of: &dyn Fn(&ProbeScore) -> f64| Column::Float64(all.iter().map(|(_, s)| of(s)).collect());
    let table = [
        ("source", texts(&|source, _| source.into())),
        ("section", texts(&|_, s| section(&s.quantity).into())),
        ("quantity", texts(&|_, s| s.quantity.clone())),
        ("probe", texts(&|_, s| format!("{:?}", s.probe).to_lowercase())),
        ("measure", texts(&|_, s| s.measure.into())),
        ("score", numbers(&|s| s.score.estimate)),
        ("low", numbers(&|s| s.score.low)),
        ("high", numbers(&|s| s.score.high)),
        ("shuffled", numbers(&|s| s.shuffled.estimate)),
        ("chance", numbers(&|s| s.chance)),
    ];
    session.write_arrow("probes", &table)?;
    let sections: Vec<_> =
        sections.iter().zip(quantities).map(|(s, q)| json!({ "quantity": q.name, "section": short(s) })).collect();
    let numbers = probe_numbers("s", scores, Some(control));
    let all = json!({ "numbers": numbers, "quantities": sections, "latent": scores, "past_actions": control });
    session.write_json("probes", &all)
}

/// A section's name in tables.
fn short(section: &str) -> &'static str {
    [About::Task, About::Symmetry, About::Distractor]
        .into_iter()
        .find(|about| self::section(*about) == section)
        .map_or("target", About::name)
}
