//! `compare`: two or more tables of latents of the same recording side by side, as from several objectives or checkpoints.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vibes_data::{Latents, is_same_place};

use super::invariance::{Named, ends, named, past_actions, table, text, write_intervals};
use super::nn::rows_elsewhere;
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Bar, BarGroup, Bars, Figure};
use crate::input::{differ, find_recording};
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
    /// None of latents of one episode, whose own rows do not count.
    near: Option<Neighbours>,
}

impl Row {
    /// The share of the neighbours of another table's rows that are among those of this one's.
    fn shared_with(&self, first: &Self) -> Option<f64> {
        Some(first.near.as_ref()?.shared_with(self.near.as_ref()?))
    }

    fn named(&self, agreement: Option<f64>) -> Vec<Named> {
        let alone = |estimate: f64| Interval { estimate, low: f64::NAN, high: f64::NAN };
        let common = agreement.map(|shared| (self.name.clone(), SHARED.to_owned(), alone(shared), f64::NAN));
        let of = |source: &str| match source {
            "latent" => self.name.clone(),
            _ => format!("{}: past actions", self.name),
        };
        let own =
            named(&self.numbers).into_iter().map(|(source, name, value, chance)| (of(&source), name, value, chance));
        own.chain(common).collect()
    }
}

/// Rows whose neighbours are compared.
const QUERIES: usize = 500;
/// Neighbours compared, where a row has as many.
const K: usize = 10;
/// What the share of neighbours in common is called.
const SHARED: &str = "neighbours_shared_with_first";

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
    let names = names(&sessions.iter().map(|session| session.path.clone()).collect::<Vec<_>>());
    let others = sessions.iter().zip(&names).skip(1);
    let first = (&sessions[0], names[0].as_str());
    let of_two: Vec<String> =
        others.filter_map(|(other, name)| two_recordings(first, (other, name.as_str()))).collect();
    let rows = sessions.iter_mut().zip(&names).map(|(session, name)| measure(session, name));
    let rows = rows.collect::<anyhow::Result<Vec<_>>>()?;
    let remarks: Vec<String> = sessions[1..].iter_mut().flat_map(|s| std::mem::take(&mut s.outcome.remarks)).collect();
    let agreement: Vec<Option<f64>> = rows.iter().map(|row| row.shared_with(&rows[0])).collect();
    let mut session = sessions.remove(0);
    for remark in of_two.into_iter().chain(remarks) {
        if !session.outcome.remarks.contains(&remark) {
            session.remark(remark);
        }
    }
    let bars = draw(&session, &rows, &agreement);
    if bars.groups.is_empty() {
        let out = session.out.clone();
        session.outcome.leave_out(&out, "compare", "there is nothing to compare in it");
    } else {
        session.save(&Figure::Bars(bars), "compare")?;
    }
    let tables: Vec<Value> =
        rows.iter().zip(&agreement).map(|(r, a)| json!({ "name": r.name, "numbers": r.numbers, SHARED: a })).collect();
    session.write_json("compare", &json!({ "tables": tables, "k": rows[0].near.as_ref().map(Neighbours::k) }))?;
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
        if let Some(fact) = difference(&first.latents, &other.latents) {
            return Err(wrong(format!(
                "these latents are not of the same rows ({fact}); encode the same recording with each run: {} and {}",
                first.path.display(),
                other.path.display()
            )));
        }
    }
    Ok(())
}

/// How the rows of two tables differ: in number or order, or in what both say of one row. Recordings may have the same episodes and steps and nothing else in common.
fn difference(a: &Latents, b: &Latents) -> Option<String> {
    if a.len() != b.len() {
        return Some(format!("{} and {}", a.len(), b.len()));
    }
    let key = |l: &Latents, row: usize| format!("step {} of episode {}", l.step[row], l.episode[row]);
    if let Some(row) = (0..a.len()).find(|&row| (a.episode[row], a.step[row]) != (b.episode[row], b.step[row])) {
        return Some(format!("row {row}, counted from 0, is {} and {}", key(a, row), key(b, row)));
    }
    let of_row = |row: usize| {
        let of_cells = |name: &str, a: Option<u32>, b: Option<u32>| {
            a.zip(b).filter(|(a, b)| a != b).map(|(a, b)| format!("{name} {a} and {b}"))
        };
        let of_rewards = || {
            a.reward[row].zip(b.reward[row]).filter(|(a, b)| differ(*a, *b)).map(|(a, b)| format!("reward {a} and {b}"))
        };
        of_cells("state", a.state[row], b.state[row])
            .or_else(|| of_cells("distractor", a.distractor[row], b.distractor[row]))
            .or_else(of_rewards)
            .map(|fact| format!("{fact} at {}", key(a, row)))
    };
    (0..a.len()).find_map(of_row)
}

/// That two tables with the same rows name two recordings, as where one was drawn anew from the other.
fn two_recordings((one, name): (&Session, &str), (other, other_name): (&Session, &str)) -> Option<String> {
    let named = |session: &Session| session.latents.source.recording.clone();
    let (recording, other_recording) = named(one).zip(named(other))?;
    let found = find_recording(&recording, &one.path).zip(find_recording(&other_recording, &other.path));
    let is_one = match &found {
        Some((found, other_found)) => is_same_place(found, other_found),
        // Recordings that are gone are known by their names alone; the way to them depends on where the latents lie.
        None => Path::new(&recording).file_name() == Path::new(&other_recording).file_name(),
    };
    (!is_one).then(|| {
        format!("{name} was encoded from {recording} and {other_name} from {other_recording}, whose rows have the same keys, cells and rewards")
    })
}

/// Short names of tables: a table's folder's; where two are the same its file's too, and as many folders more as it takes.
pub(super) fn names(tables: &[PathBuf]) -> Vec<String> {
    let parts = |table: &PathBuf| -> Vec<String> {
        let whole = std::path::absolute(table).unwrap_or_else(|_e| table.clone()).with_extension("");
        whole.iter().map(|part| part.to_string_lossy().into_owned()).collect()
    };
    let all: Vec<Vec<String>> = tables.iter().map(parts).collect();
    all.iter().map(|mine| name(&all, mine)).collect()
}

/// The name of one table by the parts of its path, among those of all.
fn name(all: &[Vec<String>], mine: &[String]) -> String {
    let folder = |parts: &[String]| parts.iter().rev().nth(1).cloned().unwrap_or_default();
    let is_alone = |name: &dyn Fn(&[String]) -> String| {
        all.iter().filter(|parts| name(parts.as_slice()) == name(mine)).count() <= 1
    };
    if is_alone(&folder) {
        return folder(mine);
    }
    let last = |parts: &[String], count: usize| parts[parts.len().saturating_sub(count)..].join("/");
    let enough = (2..=mine.len()).find(|&count| is_alone(&|parts| last(parts, count)));
    last(mine, enough.unwrap_or(mine.len()))
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
    let k = K.min(rows_elsewhere(&session.latents.episode));
    let near = if k == 0 { None } else { Some(nearest(&space, &queries, k, Exclude::Trajectory)?) };
    if let Some(remark) = fewer_neighbours(k) {
        session.remark(remark);
    }
    Ok(Row { name: name.into(), numbers, near })
}

/// What is to be said where a row has fewer neighbours than are compared elsewhere.
fn fewer_neighbours(k: usize) -> Option<String> {
    match k {
        0 => Some(format!(
            "{SHARED} is left out: these latents are of one episode, whose own rows do not count as neighbours"
        )),
        K.. => None,
        _ => Some(format!("{SHARED} is of {k} neighbours rather than {K}: there are no more that count")),
    }
}

fn draw(session: &Session, rows: &[Row], agreement: &[Option<f64>]) -> Bars {
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
    let bar = |(r, &shared): (&Row, &Option<f64>)| {
        shared.map(|value| Bar { label: r.name.clone(), value, interval: None, chance: None })
    };
    if let Some(near) = &rows[0].near {
        groups.push(BarGroup {
            axis: format!("share of {} neighbours in common with {}", near.k(), rows[0].name),
            range: whole,
            bars: rows.iter().zip(agreement).filter_map(bar).collect(),
        });
    }
    Bars { heading: session.heading("Latents of one recording side by side"), groups }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn latents() -> Latents {
        Latents {
            episode: vec![0, 0, 1],
            step: vec![0, 1, 0],
            state: vec![Some(0), Some(0), None],
            distractor: vec![Some(2), Some(2), None],
            reward: vec![Some(0.5), None, Some(1.0)],
            ..Latents::default()
        }
    }

    #[test]
    fn tables_of_two_recordings_are_told_apart_by_cells_and_rewards() {
        let of = |change: &dyn Fn(&mut Latents)| {
            let mut other = latents();
            change(&mut other);
            difference(&latents(), &other)
        };
        assert_eq!(of(&|_| {}), None);
        assert_eq!(
            of(&|l| l.step[2] = 7),
            Some("row 2, counted from 0, is step 0 of episode 1 and step 7 of episode 1".into())
        );
        let shorter = Latents { episode: vec![0, 0], step: vec![0, 1], ..latents() };
        assert_eq!(difference(&latents(), &shorter), Some("3 and 2".into()));
        assert_eq!(of(&|l| l.state[1] = Some(1)), Some("state 0 and 1 at step 1 of episode 0".into()));
        assert_eq!(of(&|l| l.distractor[0] = Some(0)), Some("distractor 2 and 0 at step 0 of episode 0".into()));
        assert_eq!(of(&|l| l.reward[2] = Some(0.25)), Some("reward 1 and 0.25 at step 0 of episode 1".into()));
        // What one of them does not say, and what rounding makes of a reward, is no difference.
        assert_eq!(of(&|l| (l.state[0], l.reward[0], l.reward[2]) = (None, None, Some(1.0001))), None);
    }

    #[test]
    fn a_table_is_named_by_its_folder_and_by_more_where_that_is_not_enough() {
        let of = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(of(&["/runs/weight=0.03/latents.arrow", "/runs/b/latents.arrow"]), ["weight=0.03", "b"]);
        assert_eq!(of(&["/runs/b/latents.arrow", "/runs/b/later.arrow"]), ["b/latents", "b/later"]);
        assert_eq!(of(&["/x/run/latents.arrow", "/y/run/latents.arrow"]), ["x/run/latents", "y/run/latents"]);
    }
}
