//! The rows that probes are judged on or fitted on: those of one or more tables of latents, with what their recordings say of them.
//!
//! In: opened tables. Out: latents and past actions as tables for the measures, and the values of quantities and of the user's own columns.

use std::collections::BTreeMap;
use std::convert::Infallible;

use vibes_data::{About, EpisodeView, Latents, Readable};
use vibes_measure::Table;
use vibes_measure::episodes::{Chosen, Episode, chosen};
use vibes_measure::probes::{HoldOut, Quantity, Values};

use crate::actions::action_features;
use crate::input::{Frames, UserColumn};

/// A table of latents with its recording, the user's own columns, and those of its rows that count.
pub(super) struct Opened {
    pub(super) latents: Latents,
    pub(super) columns: Vec<(String, UserColumn)>,
    pub(super) frames: Frames,
    pub(super) rows: Vec<usize>,
}

impl Opened {
    fn cell(&self, row: usize) -> Option<(u32, u32)> {
        self.latents.state[row].zip(self.latents.distractor[row])
    }

    /// All actions of an episode, one after the other.
    fn actions(&self, episode: u32) -> Vec<f32> {
        self.frames.view(episode).map(EpisodeView::actions).unwrap_or_default()
    }
}

/// Rows of some tables, one after the other; episodes and cells of different tables have different numbers.
#[derive(Default)]
pub(super) struct Rows {
    parts: Vec<Part>,
    /// Numbers a row, and the numbers.
    latents: (usize, Vec<f32>),
    actions: (usize, Vec<f32>),
    episode: Vec<u32>,
    step: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
    /// The user's own columns.
    pub(super) targets: Vec<Quantity>,
    /// How many episodes the rows are of, and how many there were to choose from.
    pub(super) episodes: (usize, usize),
}

/// The rows of one table as its recording knows them.
struct Part {
    frames: Frames,
    episode: Vec<u32>,
    step: Vec<u32>,
}

impl Rows {
    /// The rows of at most `most` episodes, evenly spread over the tables; views of one state trajectory are one (see [`vibes_measure::episodes`]).
    pub(super) fn of(tables: Vec<Opened>, most: usize) -> Self {
        let all = episodes(&tables);
        let actions = |place: usize| Ok::<_, Infallible>(tables[all[place].recording].actions(all[place].index));
        let Ok(numbers) = chosen(&all, most, actions);
        let count = (numbers.len(), all.len());
        let numbers: BTreeMap<(usize, u32), Chosen> =
            numbers.into_iter().map(|one| ((all[one.place].recording, all[one.place].index), one)).collect();
        let is_kept = |at: usize, row: &usize| numbers.contains_key(&(at, tables[at].latents.episode[*row]));
        let kept: Vec<Vec<usize>> = (0..tables.len())
            .map(|at| tables[at].rows.iter().copied().filter(|row| is_kept(at, row)).collect())
            .collect();
        let targets = targets(&tables, &kept);
        let mut rows = Self { episodes: count, targets, ..Self::default() };
        for (at, (table, kept)) in tables.into_iter().zip(kept).enumerate() {
            let latents = some_rows(&table.latents, &kept);
            for episode in &latents.episode {
                rows.push_numbers(&numbers[&(at, *episode)]);
            }
            rows.push_part(latents, table.frames);
        }
        rows
    }

    fn push_numbers(&mut self, of: &Chosen) {
        self.episode.push(of.episode);
        self.state.push(of.state);
        self.distractor.push(of.distractor);
    }

    fn push_part(&mut self, latents: Latents, frames: Frames) {
        let (width, actions) = action_features(&latents, &frames);
        self.actions.0 = width;
        self.actions.1.extend(actions);
        self.latents.0 = latents.dims;
        self.latents.1.extend(latents.latent);
        self.step.extend(&latents.step);
        self.parts.push(Part { frames, episode: latents.episode, step: latents.step });
    }

    /// How many rows.
    pub(super) fn len(&self) -> usize {
        self.episode.len()
    }

    /// What the first table's recording says of a row.
    pub(super) fn readable(&self) -> Vec<Readable> {
        self.parts.first().map(|part| part.frames.recording().manifest().spec.readable()).unwrap_or_default()
    }

    /// The tables of the latents and of past actions.
    pub(super) fn tables(&self) -> Result<[Table<'_>; 2], vibes_measure::Error> {
        Ok([self.table(&self.latents)?, self.table(&self.actions)?])
    }

    fn table<'a>(&'a self, (dims, values): &'a (usize, Vec<f32>)) -> Result<Table<'a>, vibes_measure::Error> {
        Table::new(*dims, values, &self.episode, &self.step)?.with_grid(&self.state, &self.distractor)
    }

    /// The values of a quantity by its name; none if some row has none.
    pub(super) fn quantity(&self, name: &str) -> Option<Quantity> {
        let (mut values, mut classes, mut hold_out) = (Vec::new(), false, HoldOut::State);
        for part in &self.parts {
            let all = part.frames.recording().manifest().spec.readable();
            let readable = all.iter().find(|readable| readable.name == name)?;
            classes = readable.is_class();
            if readable.about == About::Distractor {
                hold_out = HoldOut::of_distractor(classes, self.state.iter().all(Option::is_some));
            }
            for (&episode, &step) in part.episode.iter().zip(&part.step) {
                values.push(readable.value(part.frames.view(episode)?, step as usize)?);
            }
        }
        Some(Quantity { name: name.to_owned(), hold_out, values: Values::of(classes, values) })
    }
}

/// The episodes that the rows are of, table after table.
fn episodes(tables: &[Opened]) -> Vec<Episode> {
    let of = |(recording, table): (usize, &Opened)| {
        let cells: BTreeMap<u32, Option<(u32, u32)>> =
            table.rows.iter().map(|&row| (table.latents.episode[row], table.cell(row))).collect();
        cells.into_iter().map(move |(index, cell)| Episode { recording, index, cell }).collect::<Vec<_>>()
    };
    tables.iter().enumerate().flat_map(of).collect()
}

/// The user's own columns in the rows that are kept of every table. Only numbers can be of several tables.
fn targets(tables: &[Opened], kept: &[Vec<usize>]) -> Vec<Quantity> {
    let numbers = |at: usize| {
        let of = move |(table, rows): (&Opened, &Vec<usize>)| -> Vec<f64> {
            match &table.columns[at].1 {
                UserColumn::Numbers(values) => rows.iter().map(|&row| values[row]).collect(),
                UserColumn::Kinds { .. } => Vec::new(),
            }
        };
        Values::Numbers(tables.iter().zip(kept).flat_map(of).collect())
    };
    let target = |(at, (name, column)): (usize, &(String, UserColumn))| {
        let values = match column {
            UserColumn::Numbers(_) => numbers(at),
            UserColumn::Kinds { of_row, .. } => {
                Values::Classes(kept[0].iter().filter_map(|&row| of_row[row]).collect())
            }
        };
        // A column may as well be the distractor's.
        Quantity { name: name.clone(), hold_out: HoldOut::StateOfUnknown, values }
    };
    tables.first().map(|table| table.columns.iter().enumerate().map(target).collect()).unwrap_or_default()
}

/// The rows that have a reward, so that every quantity has a value in every row (all rows if none has), and a cell if any has one, so that no
/// cell of a held-out state is left among the others. Also returns how many rows that have none are left out.
pub(super) fn usable(l: &Latents) -> (Vec<usize>, usize) {
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
fn some_rows(l: &Latents, keep: &[usize]) -> Latents {
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
