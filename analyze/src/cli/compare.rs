//! `compare`: two or more tables of latents of the same recording side by side, as from several objectives or checkpoints.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::invariance::{Named, ends, named, past_actions, table, text, write_intervals};
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Bar, BarGroup, Bars, Figure};
use vibes_measure::intervals::Interval;
use vibes_measure::invariance::{Dropped, Grid};
use vibes_measure::neighbours::{Exclude, Metric, Neighbours, Space, nearest};
use vibes_measure::numbers::{GridOptions, Numbers, grid_numbers};

/// Compare several tables of latents of one recording: how invariant each is, and how many neighbours they have in common.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Tables of latents, or run folders; at least two.
    #[arg(value_name = "LATENTS", required = true, num_args = 2..)]
    tables: Vec<PathBuf>,
    /// Where the output goes [default: the folder `figures` beside the first table].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// The recording that all were encoded from, whose past actions are the control [default: the one that their metadata names].
    #[arg(long, value_name = "FOLDER")]
    recording: Option<PathBuf>,
    /// Go on without the recording: no control.
    #[arg(long, conflicts_with = "recording")]
    no_frames: bool,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A line under the title of every figure.
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(tables: &[PathBuf], output: &Path, seed: u64, note: Option<&str>) -> Self {
        let output = Some(output.to_path_buf());
        Self { tables: tables.to_vec(), output, recording: None, no_frames: false, seed, note: note.map(String::from) }
    }

    /// The same with the recording named, or left out.
    pub(super) fn with_recording(self, recording: Option<&Path>, no_frames: bool) -> Self {
        Self { recording: recording.map(Path::to_path_buf), no_frames, ..self }
    }
}

/// The numbers of one table.
struct Row {
    name: String,
    /// Of the grid; none of latents that lie on none.
    numbers: Numbers,
    near: Neighbours,
}

impl Row {
    fn named(&self, agreement: f64) -> Vec<Named> {
        let alone = Interval { estimate: agreement, low: f64::NAN, high: f64::NAN };
        let common = (self.name.clone(), "neighbours in common with the first".to_string(), alone, f64::NAN);
        let of = |source: &str| match source {
            "latent" => self.name.clone(),
            _ => format!("{}: past actions", self.name),
        };
        let own =
            named(&self.numbers).into_iter().map(|(source, name, value, chance)| (of(&source), name, value, chance));
        own.chain([common]).collect()
    }
}

/// Rows whose neighbours are compared.
const QUERIES: usize = 500;
/// Neighbours compared.
const K: usize = 10;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let mut sessions = Vec::new();
    for table in &options.tables {
        let out = options.output.clone().or_else(|| sessions.first().map(|s: &Session| s.out.clone()));
        let recording = options.recording.as_deref();
        let input = Input::named(Some(table), recording, out.as_deref(), options.seed, options.note.as_deref())
            .less_frames(options.no_frames);
        sessions.push(Session::open(&input, globals, "compare", json!({ "tables": options.tables }))?);
    }
    same_rows(&sessions)?;
    let names: Vec<String> = sessions.iter().map(|session| names(&sessions, session)).collect();
    let rows = sessions.iter_mut().zip(&names).map(|(session, name)| measure(session, name));
    let rows = rows.collect::<anyhow::Result<Vec<_>>>()?;
    let remarks: Vec<String> = sessions[1..].iter_mut().flat_map(|s| std::mem::take(&mut s.outcome.remarks)).collect();
    let agreement: Vec<f64> = rows.iter().map(|r| rows[0].near.shared_with(&r.near)).collect();
    let mut session = sessions.remove(0);
    for remark in remarks {
        if !session.outcome.remarks.contains(&remark) {
            session.remark(remark);
        }
    }
    session.save(&Figure::Bars(draw(&session, &rows, &agreement)), "compare")?;
    let tables: Vec<Value> = rows
        .iter()
        .zip(&agreement)
        .map(|(r, a)| json!({ "name": r.name, "numbers": r.numbers, "neighbours_shared_with_first": a }))
        .collect();
    session.write_json("compare", &json!({ "tables": tables }))?;
    let numbers: Vec<Named> = rows.iter().zip(&agreement).flat_map(|(row, &agreement)| row.named(agreement)).collect();
    write_intervals(&mut session, "compare", "table", &numbers)?;
    let parts: Vec<String> = rows
        .iter()
        .map(|r| {
            format!("{} {}", r.name, r.numbers.get("state_share").map_or_else(|| "no grid".into(), |n| text(&n.value)))
        })
        .collect();
    Ok(session.finish(format!("compare: share of variance the state explains: {}", parts.join(", "))))
}

/// The tables hold the same rows in the same order.
fn same_rows(sessions: &[Session]) -> anyhow::Result<()> {
    let first = &sessions[0];
    for other in &sessions[1..] {
        if other.latents.episode != first.latents.episode || other.latents.step != first.latents.step {
            return Err(wrong(format!(
                "these latents are not of the same rows ({} and {}); encode the same recording with each run: {} and {}",
                first.latents.len(),
                other.latents.len(),
                first.path.display(),
                other.path.display()
            )));
        }
    }
    Ok(())
}

/// A short name for a table: its folder's; where two are the same its file's too, and as many folders more as it takes.
fn names(sessions: &[Session], one: &Session) -> String {
    let parts = |session: &Session| -> Vec<String> {
        let whole = std::path::absolute(&session.path).unwrap_or_else(|_e| session.path.clone()).with_extension("");
        whole.iter().map(|part| part.to_string_lossy().into_owned()).collect()
    };
    let mine = parts(one);
    let folder = |parts: &[String]| parts.iter().rev().nth(1).cloned().unwrap_or_default();
    let is_alone = |name: &dyn Fn(&[String]) -> String| {
        sessions.iter().filter(|session| name(&parts(session)) == name(&mine)).count() <= 1
    };
    if is_alone(&folder) {
        return folder(&mine);
    }
    let last = |parts: &[String], count: usize| parts[parts.len().saturating_sub(count)..].join("/");
    let enough = (2..=mine.len()).find(|&count| is_alone(&|parts| last(parts, count)));
    last(&mine, enough.unwrap_or(mine.len()))
}

fn measure(session: &mut Session, name: &str) -> anyhow::Result<Row> {
    let options = GridOptions { seed: session.seed, ..GridOptions::default() };
    // Latents that are not of a grid, or of one with a single row or column, still have neighbours to compare.
    let dropped = match Grid::of_complete_part(session.table()?) {
        Ok(grid) => Some(grid.dropped().clone()),
        Err(vibes_measure::Error::NoGrid | vibes_measure::Error::TooFewRows { .. }) => None,
        Err(other) => return Err(other.into()),
    };
    let is_grid = dropped.is_some();
    dropped.iter().flat_map(Dropped::remarks).for_each(|remark| session.remark(format!("{name}: {remark}")));
    let numbers = if is_grid {
        let actions = past_actions(session)?;
        let control = actions.as_ref().map(|actions| table(session, actions)).transpose()?;
        let control = control.map(Grid::of_complete_part).transpose()?;
        grid_numbers(&Grid::of_complete_part(session.table()?)?, control.as_ref(), &options)?
    } else {
        Numbers::default()
    };
    let space = Space::new(session.table()?, Metric::Standardized)?;
    let count = session.latents.len();
    let queries: Vec<usize> = (0..QUERIES.min(count)).map(|i| i * count / QUERIES.min(count)).collect();
    let near = nearest(&space, &queries, K, Exclude::Trajectory)?;
    Ok(Row { name: name.into(), numbers, near })
}

fn draw(session: &Session, rows: &[Row], agreement: &[f64]) -> Bars {
    let whole = Some((0.0, 1.0));
    let group = |axis: &str, name: &str| {
        let bar = |r: &Row| {
            r.numbers.get(name).map(|n| Bar {
                label: r.name.clone(),
                value: n.value.estimate,
                interval: ends(&n.value),
                chance: n.chance.is_finite().then_some(n.chance),
            })
        };
        BarGroup { axis: axis.into(), range: whole, bars: rows.iter().filter_map(bar).collect() }
    };
    let mut groups = vec![
        group("variance the state explains", "state_share"),
        group("variance the distractor explains", "distractor_share"),
        group("retrieval_same_step@1: same state, among all cells of the step", "retrieval_same_step@1"),
        group("retrieval_any_step@1: same state, under another distractor", "retrieval_any_step@1"),
    ];
    groups.retain(|g| !g.bars.is_empty());
    let bar = |(r, &value): (&Row, &f64)| Bar { label: r.name.clone(), value, interval: None, chance: None };
    groups.push(BarGroup {
        axis: format!("share of {K} neighbours in common with {}", rows[0].name),
        range: whole,
        bars: rows.iter().zip(agreement).map(bar).collect(),
    });
    Bars { heading: session.heading("Latents of one recording side by side"), groups }
}
