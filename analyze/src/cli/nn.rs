//! `nn`: what is near what. Queries above their nearest neighbours (Figures 4b and 5 of the paper).

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use rand::Rng;
use rand::seq::index;
use serde::Serialize;
use serde_json::json;
use vibes_data::About;

use super::invariance::text;
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Figure, NeighbourSheet, SheetColumn, Thumb};
use crate::input::Frames;
use crate::output::Column;
use vibes_measure::neighbours::{Exclude, Metric, Neighbours, Space, nearest};
use vibes_measure::state_error::{StateError, state_error};

/// Find the nearest neighbours of rows in the latent space, and draw them.
///
/// neighbours.json holds `metric`, `k`, and for each query its row key `query` as [episode, step], its `neighbours` as [[episode, step], …],
/// nearest first, and their `distance`s. Neighbours come from other episodes, or as --exclude says.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// How many queries to draw.
    #[arg(long, default_value_t = QUERIES)]
    queries: usize,
    /// The queries, named by episode and step, in place of drawn ones.
    #[arg(long, value_name = "EPISODE:STEP,…", value_delimiter = ',', conflicts_with_all = ["queries", "select"])]
    rows: Vec<RowKey>,
    /// Neighbours of each query.
    #[arg(long, short, default_value_t = K)]
    k: usize,
    /// The distance: standardized (each dimension divided by its standard deviation over the table), euclidean or cosine.
    #[arg(long, default_value = "standardized")]
    metric: Metric,
    /// How queries are drawn: `random`, or `mix` of half rows of high and half of low reward (above and below half of the largest; where none is above 0,
    /// the middle between the smallest and the largest).
    #[arg(long, value_enum, default_value_t = Select::Random)]
    select: Select,
    /// Which rows cannot be neighbours: those of the query's `trajectory` (its episode), those of its `state` trajectory on a grid, or only the `row` itself
    /// [default: state on a grid of a task with a symmetry, such as reacher's, so that the sheet shows other states that the latent takes for the
    /// same; else trajectory].
    #[arg(long, value_enum)]
    exclude: Option<Excluded>,
}

/// Queries and neighbours of each, unless other numbers are asked for.
const QUERIES: usize = 20;
const K: usize = 5;

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: Input) -> Self {
        let (metric, select) = (Metric::Standardized, Select::Random);
        Self { input, queries: QUERIES, rows: Vec::new(), k: K, metric, select, exclude: None }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Select {
    Random,
    Mix,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Excluded {
    Trajectory,
    State,
    Row,
}

/// A row key as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct RowKey {
    episode: u32,
    step: u32,
}

impl FromStr for RowKey {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text
            .split_once(':')
            .and_then(|(e, s)| Some(Self { episode: e.trim().parse().ok()?, step: s.trim().parse().ok()? }));
        parsed.ok_or_else(|| format!("{text:?} is no row key; EPISODE:STEP is expected, as in 12:40"))
    }
}

/// One query of `neighbours.json`.
#[derive(Debug, Serialize)]
struct Query {
    query: [u32; 2],
    neighbours: Vec<[u32; 2]>,
    distance: Vec<f64>,
}

/// Rows that every row has outside its own episode, at least.
pub(super) fn rows_elsewhere(episodes: &[u32]) -> usize {
    let mut counts = BTreeMap::new();
    episodes.iter().for_each(|&episode| *counts.entry(episode).or_insert(0) += 1);
    episodes.len() - counts.values().copied().max().unwrap_or(0)
}

/// Queries on the sheet, at most; more make no picture that anybody looks at, but narrower intervals.
const SHOWN: usize = 40;
/// Most neighbours of each on it.
const SHOWN_DEEP: usize = 40;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if options.k == 0 {
        return Err(wrong("--k is 0, at least 1 is needed"));
    }
    let given = json!({
        "queries": options.queries, "rows": options.rows.iter().map(|r| [r.episode, r.step]).collect::<Vec<_>>(), "k": options.k,
        "metric": options.metric.name(), "select": format!("{:?}", options.select).to_lowercase(),
        "exclude": options.exclude.map(|e| format!("{e:?}").to_lowercase()),
    });
    let mut session = Session::open(&options.input, globals, "nn", given)?;
    let queries = choose(options, &mut session)?;
    let frames = session.frames()?;
    let excluded = options.exclude.unwrap_or_else(|| usual_exclusion(&session, frames.as_ref()));
    let labels = state_labels(excluded, &session)?;
    let exclude = match (excluded, &labels) {
        (Excluded::State, Some(labels)) => Exclude::Group(labels),
        (Excluded::Row, _) => Exclude::Itself,
        _ => Exclude::Trajectory,
    };
    let (found, constant, error) = {
        let space = Space::new(session.table()?, options.metric)?;
        let found = nearest(&space, &queries, options.k, exclude)?;
        let of = |frames: &Frames| state_error_of(&session, frames, &space, &queries, (&found, exclude));
        let error = frames.as_ref().and_then(of);
        (found, space.constant_dims().to_vec(), error)
    };
    if !constant.is_empty() && options.metric == Metric::Standardized {
        session.remark(format!("latent dimensions {constant:?} are constant and were left out of the distance"));
    }
    write_numbers(options, excluded, &mut session, &queries, &found, error)?;
    let line = draw(options, &mut session, frames.as_ref(), &queries, &found)?;
    let error = error.map_or_else(String::new, |e| {
        format!("; task state off by {} of a random pair's {}", text(&e.neighbours), text(&e.random))
    });
    Ok(session.finish(line + &error))
}

/// How far the neighbours' task state is from the query's; none if the recording's observations do not vary.
fn state_error_of(
    session: &Session,
    frames: &Frames,
    space: &Space<'_>,
    queries: &[usize],
    (found, exclude): (&Neighbours, Exclude<'_>),
) -> Option<StateError> {
    let states = frames.task_state(&session.latents);
    state_error(space, &states, queries, found, exclude, &mut session.rng())
}

/// The rows to query, by index: those named, or drawn.
fn choose(options: &Options, session: &mut Session) -> anyhow::Result<Vec<usize>> {
    if !options.rows.is_empty() {
        return named(&options.rows, session);
    }
    let mut rng = session.rng();
    let rows = session.latents.len();
    if options.queries == 0 {
        return Err(wrong("--queries is 0, at least 1 is needed"));
    }
    let mut chosen = match options.select {
        Select::Random => index::sample(&mut rng, rows, options.queries.min(rows)).into_vec(),
        Select::Mix => mix(session, options.queries, &mut rng)?,
    };
    chosen.sort_by_key(|&row| (session.latents.episode[row], session.latents.step[row]));
    if chosen.len() < options.queries {
        session.remark(format!("only {} queries could be drawn, {} were asked for", chosen.len(), options.queries));
    }
    Ok(chosen)
}

/// The rows of these keys, each once: a row that is asked for twice would count twice.
fn named(keys: &[RowKey], session: &mut Session) -> anyhow::Result<Vec<usize>> {
    let (once, repeated) = once(keys);
    let table = session.table()?;
    let find = |key: &RowKey| {
        let missing = || wrong(format!("no row {}:{} in {}", key.episode, key.step, session.path.display()));
        table.find(key.episode, key.step).ok_or_else(missing)
    };
    let found = once.iter().map(find).collect::<anyhow::Result<Vec<_>>>()?;
    if !repeated.is_empty() {
        let repeated: Vec<String> = repeated.iter().map(|key| format!("{}:{}", key.episode, key.step)).collect();
        session.remark(format!("--rows names these more than once, and they count once: {}", repeated.join(", ")));
    }
    Ok(found)
}

/// The different keys in their order, and those that occur again.
fn once(keys: &[RowKey]) -> (Vec<RowKey>, Vec<RowKey>) {
    let (mut once, mut repeated) = (Vec::new(), Vec::new());
    for key in keys {
        let list = if once.contains(key) { &mut repeated } else { &mut once };
        if !list.contains(key) {
            list.push(*key);
        }
    }
    (once, repeated)
}

/// Half the queries of high reward, half of low; if there are too few of one kind, more of the other.
fn mix(session: &Session, queries: usize, rng: &mut impl Rng) -> anyhow::Result<Vec<usize>> {
    let Some(high) = high_reward(&session.latents.reward) else {
        return Err(wrong(
            "--select mix needs rewards that differ, these latents have none (or all the same); use --select random",
        ));
    };
    let side = |is_high: bool| -> Vec<usize> {
        let reward = &session.latents.reward;
        (0..reward.len()).filter(|&row| reward[row].is_some_and(|r| (r >= high) == is_high)).collect()
    };
    let (above, below) = (side(true), side(false));
    let from_below = queries.div_ceil(2).min(below.len());
    let from_above = (queries - from_below).min(above.len());
    let from_below = (queries - from_above).min(below.len());
    let mut draw = |rows: &[usize], count: usize| -> Vec<usize> {
        index::sample(rng, rows.len(), count).into_iter().map(|i| rows[i]).collect()
    };
    let mut chosen = draw(&above, from_above);
    chosen.extend(draw(&below, from_below));
    Ok(chosen)
}

/// From where on a reward is high: half the largest, or the middle of all where none is above 0, as where rewards are costs. None without rewards that differ.
fn high_reward(rewards: &[Option<f32>]) -> Option<f32> {
    let rewards = rewards.iter().flatten().copied().filter(|r| r.is_finite());
    let (lo, hi) = rewards.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), r| (lo.min(r), hi.max(r)));
    (lo < hi).then_some(if hi > 0.0 { hi / 2.0 } else { lo / 2.0 + hi / 2.0 })
}

/// On a grid the nearest are usually other views of the query's own state, which shows invariance. Where a task has a symmetry, the question is which
/// *other* states come together.
fn usual_exclusion(session: &Session, frames: Option<&Frames>) -> Excluded {
    let has_symmetry = frames.is_some_and(|frames| {
        frames.recording().manifest().spec.quantities.iter().any(|quantity| quantity.about == About::Symmetry)
    });
    let states: BTreeSet<Option<u32>> = session.latents.state.iter().copied().collect();
    if has_symmetry && states.len() > 1 && !states.contains(&None) { Excluded::State } else { Excluded::Trajectory }
}

/// One label a state trajectory, for `--exclude state`.
fn state_labels(excluded: Excluded, session: &Session) -> anyhow::Result<Option<Vec<u32>>> {
    if excluded != Excluded::State {
        return Ok(None);
    }
    let labels: Option<Vec<u32>> = session.latents.state.iter().copied().collect();
    labels.map(Some).ok_or_else(|| wrong("--exclude state needs latents of a grid (a column state without gaps)"))
}

fn write_numbers(
    options: &Options,
    excluded: Excluded,
    session: &mut Session,
    queries: &[usize],
    found: &Neighbours,
    error: Option<StateError>,
) -> anyhow::Result<()> {
    let key = |row: usize| [session.latents.episode[row], session.latents.step[row]];
    let list: Vec<Query> = (0..queries.len())
        .map(|q| Query {
            query: key(queries[q]),
            neighbours: found.rows(q).iter().map(|&row| key(row as usize)).collect(),
            distance: found.distances(q).to_vec(),
        })
        .collect();
    let column = |of: &dyn Fn(&Query, usize) -> u32| {
        Column::UInt32(
            list.iter().flat_map(|q| (0..q.neighbours.len()).map(|i| of(q, i)).collect::<Vec<_>>()).collect(),
        )
    };
    let table = [
        ("query_episode", column(&|q, _| q.query[0])),
        ("query_step", column(&|q, _| q.query[1])),
        ("rank", column(&|_, i| i as u32 + 1)),
        ("episode", column(&|q, i| q.neighbours[i][0])),
        ("step", column(&|q, i| q.neighbours[i][1])),
        ("distance", Column::Float64(list.iter().flat_map(|q| q.distance.clone()).collect())),
    ];
    session.write_json(
        "neighbours",
        &json!({ "metric": options.metric.name(), "k": options.k, "excluded": format!("{excluded:?}").to_lowercase(), "queries": list, "state_error": error }),
    )?;
    session.write_arrow("neighbours", &table)
}

/// Draws the sheet, if there are pictures, and words the result.
fn draw(
    options: &Options,
    session: &mut Session,
    frames: Option<&Frames>,
    queries: &[usize],
    found: &Neighbours,
) -> anyhow::Result<String> {
    let nearest: f64 = (0..queries.len()).map(|q| found.distances(q)[0]).sum::<f64>() / queries.len() as f64;
    let line = format!(
        "nn: {} queries, {} neighbours each, mean distance of the first {nearest:.3} ({})",
        queries.len(),
        found.k(),
        options.metric.name()
    );
    let Some(frames) = frames else {
        if !session.without_frames() {
            session.remark("these latents name no recording, so there are numbers and no sheet of pictures (name one with --recording)");
        }
        return Ok(line);
    };
    if frames.recording().manifest().spec.pixels.is_none() {
        session.remark("the recording holds no pictures, so there are numbers and no sheet");
        return Ok(line);
    }
    if queries.len() > SHOWN {
        session
            .remark(format!("the sheet shows the first {SHOWN} of {} queries; the numbers are of all", queries.len()));
    }
    if found.k() > SHOWN_DEEP {
        session.remark(format!(
            "the sheet shows the nearest {SHOWN_DEEP} of {} neighbours; the numbers are of all",
            found.k()
        ));
    }
    let high = high_reward(&session.latents.reward);
    let latents = &session.latents;
    let thumb = |row: usize| {
        let (episode, step) = (latents.episode[row], latents.step[row]);
        Thumb { name: format!("{episode}:{step}"), pixels: frames.picture(episode, step) }
    };
    let remark = |row: usize| match (high, latents.reward[row]) {
        (Some(high), Some(reward)) => if reward >= high { "high reward" } else { "low reward" }.to_string(),
        _ => String::new(),
    };
    let neighbours = |q: usize| {
        let near = found.rows(q).iter().zip(found.distances(q)).take(SHOWN_DEEP);
        near.map(|(&row, &d)| (thumb(row as usize), d)).collect()
    };
    let columns: Vec<SheetColumn> = queries
        .iter()
        .take(SHOWN)
        .enumerate()
        .map(|(q, &row)| SheetColumn { query: thumb(row), remark: remark(row), neighbours: neighbours(q) })
        .collect();
    let missing = columns
        .iter()
        .flat_map(|c| std::iter::once(&c.query).chain(c.neighbours.iter().map(|n| &n.0)))
        .filter(|t| t.pixels.is_none())
        .count();
    let distance = match options.metric {
        Metric::Standardized => "standardized L2 distance",
        Metric::Euclidean => "Euclidean distance",
        Metric::Cosine => "cosine distance",
    };
    let sheet = NeighbourSheet {
        heading: session.heading("Queries (top) and their nearest neighbours in the latent space"),
        distance: distance.into(),
        rows: Vec::new(),
        columns,
    };
    session.save(&Figure::NeighbourSheet(sheet), "neighbours")?;
    if missing > 0 {
        session.remark(format!("{missing} pictures are missing from the recording and drawn as empty frames"));
    }
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_is_named_again_counts_once() {
        let key = |episode, step| RowKey { episode, step };
        let (kept, repeated) = once(&[key(0, 1), key(2, 3), key(0, 1), key(0, 1), key(1, 0)]);
        assert_eq!(kept, [key(0, 1), key(2, 3), key(1, 0)]);
        assert_eq!(repeated, [key(0, 1)]);
    }

    #[test]
    fn rewards_are_high_from_half_the_largest_on_and_costs_from_their_middle() {
        assert_eq!(high_reward(&[Some(0.0), None, Some(1.0)]), Some(0.5));
        assert_eq!(high_reward(&[Some(-2.0), Some(4.0)]), Some(2.0));
        assert_eq!(high_reward(&[Some(-3.0), Some(-1.0), None]), Some(-2.0));
        assert_eq!(high_reward(&[Some(-3.0), Some(0.0)]), Some(-1.5));
        assert_eq!((high_reward(&[Some(-3.0), Some(-3.0)]), high_reward(&[None])), (None, None));
    }
}
