//! The live map of one run: which rows can be chosen, what they can be coloured by, and the frames that go along.

use std::collections::BTreeMap;

use rand::seq::index;
use vibes_data::Latents;
use vibes_measure::clusters::{Method, clusters};
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};

use super::super::maps::MadeMap;
use super::super::nn::rows_elsewhere;
use super::super::session::Session;
use super::Options;
use crate::input::{Frames, UserColumn};
use crate::picture::Pixels;
use crate::report::{LiveColumn, LiveMap};

/// Neighbours a row shows.
const K: usize = 5;
/// Groups by k-means that the points can be coloured by.
const GROUPS: usize = 8;
/// Episodes that are shown as films, and frames of each.
const FILMS: usize = 6;
const FILM_FRAMES: usize = 120;

pub(super) fn live_map(
    options: &Options,
    session: &Session,
    name: &str,
    made: &MadeMap,
    frames: Option<&Frames>,
) -> anyhow::Result<LiveMap> {
    let l = &session.latents;
    let alive = alive(options, session);
    // Rows of a row's own episode are not its neighbours; a table of one episode has none.
    let k = K.min(rows_elsewhere(&l.episode));
    let (rows, distance) = if k == 0 {
        (Vec::new(), Vec::new())
    } else {
        let near = nearest(&Space::new(session.table()?, Metric::Standardized)?, &alive, k, Exclude::Trajectory)?;
        (near.all_rows().to_vec(), near.all_distances().iter().map(|&distance| distance as f32).collect())
    };
    let mut framed: Vec<u32> = alive.iter().map(|&row| row as u32).chain(rows.iter().copied()).collect();
    framed.sort_unstable();
    framed.dedup();
    let picture = |row: u32| Some((row, (*frames?.picture(l.episode[row as usize], l.step[row as usize])?).clone()));
    let (framed, pictures): (Vec<u32>, Vec<Pixels>) = framed.into_iter().filter_map(picture).unzip();
    Ok(LiveMap {
        name: name.into(),
        episode: l.episode.clone(),
        step: l.step.clone(),
        positions: made.positions.clone(),
        columns: columns(session, frames),
        alive: alive.iter().map(|&row| row as u32).collect(),
        k,
        near: rows,
        distance,
        framed,
        frames: pictures,
    })
}

/// The rows that can be chosen: some of everywhere, and a few episodes nearly whole, so that they can be seen as films; in order of time.
fn alive(options: &Options, session: &Session) -> Vec<usize> {
    let l = &session.latents;
    let mut rows = index::sample(&mut session.rng(), l.len(), options.points.clamp(1, l.len())).into_vec();
    let mut episodes: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for row in 0..l.len() {
        episodes.entry(l.episode[row]).or_default().push(row);
    }
    let every = episodes.len().div_ceil(FILMS).max(1);
    for film in episodes.values_mut().step_by(every) {
        film.sort_by_key(|&row| l.step[row]);
        rows.extend(film.iter().step_by(film.len().div_ceil(FILM_FRAMES).max(1)));
    }
    rows.sort_by_key(|&row| (l.episode[row], l.step[row]));
    rows.dedup();
    rows
}

/// Everything that the points can be coloured by.
fn columns(session: &Session, frames: Option<&Frames>) -> Vec<LiveColumn> {
    let l = &session.latents;
    let numbers = |name: &str, values: Vec<f32>| LiveColumn { name: name.into(), values, kinds: Vec::new() };
    let whole = |of: &[u32]| of.iter().map(|&v| v as f32).collect::<Vec<f32>>();
    let mut all = vec![numbers("step", whole(&l.step))];
    for (name, cells) in [("state", &l.state), ("distractor", &l.distractor)] {
        if cells.iter().any(Option::is_some) {
            all.push(cell_column(name, cells));
        }
    }
    if l.reward.iter().any(Option::is_some) {
        all.push(numbers("reward", l.reward.iter().map(|r| r.unwrap_or(f32::NAN)).collect()));
    }
    if let Ok(labels) =
        session.table().and_then(|table| clusters(&table, Method::KMeans { k: GROUPS }, &mut session.rng()))
    {
        all.push(cell_column("cluster", &labels));
    }
    all.extend(session.columns.iter().map(|(name, column)| user_column(name, column)));
    all.extend(frames.into_iter().flat_map(|frames| recorded(l, frames)));
    all.push(numbers("episode", whole(&l.episode)));
    all
}

fn cell_column(name: &str, cells: &[Option<u32>]) -> LiveColumn {
    let kinds: std::collections::BTreeSet<u32> = cells.iter().flatten().copied().collect();
    let number: BTreeMap<u32, usize> = kinds.iter().enumerate().map(|(i, &kind)| (kind, i)).collect();
    let values = cells.iter().map(|cell| cell.and_then(|c| number.get(&c)).map_or(f32::NAN, |&i| i as f32)).collect();
    LiveColumn { name: name.into(), values, kinds: kinds.iter().map(ToString::to_string).collect() }
}

fn user_column(name: &str, column: &UserColumn) -> LiveColumn {
    match column {
        UserColumn::Numbers(values) => {
            LiveColumn { name: name.into(), values: values.iter().map(|&v| v as f32).collect(), kinds: Vec::new() }
        }
        UserColumn::Kinds { of_row, names } => {
            let values = of_row.iter().map(|kind| kind.map_or(f32::NAN, |kind| kind as f32)).collect();
            LiveColumn { name: name.into(), values, kinds: names.clone() }
        }
    }
}

/// The quantities that the recording knows of: the task's, the camera's, the video's, colours.
fn recorded(l: &Latents, frames: &Frames) -> Vec<LiveColumn> {
    let readable = frames.recording().manifest().spec.readable();
    let column = |readable: &vibes_data::Readable| {
        let of = |row: usize| readable.value(frames.view(l.episode[row])?, l.step[row] as usize);
        let values: Vec<f32> = (0..l.len()).map(|row| of(row).map_or(f32::NAN, |v| v as f32)).collect();
        let first = values.iter().find(|v| v.is_finite())?;
        let varies = values.iter().any(|v| v.is_finite() && (v - first).abs() > 1e-9);
        let kinds = if readable.is_class() {
            let most = values.iter().copied().filter(|v| v.is_finite()).fold(0.0f32, f32::max) as usize;
            (0..=most).map(|kind| format!("{} {kind}", readable.name)).collect()
        } else {
            Vec::new()
        };
        varies.then(|| LiveColumn { name: readable.name.clone(), values, kinds })
    };
    // A dozen materials have three channels each: too many to choose among, and two say enough.
    let is_color = |name: &str| [" red", " green", " blue"].iter().any(|channel| name.ends_with(channel));
    let (colors, others): (Vec<_>, Vec<_>) = readable.iter().partition(|readable| is_color(&readable.name));
    others.into_iter().chain(colors.into_iter().take(3)).filter_map(column).collect()
}
