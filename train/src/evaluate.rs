//! How good the latents are, on a held-out grid of state trajectories × distractor trajectories. In: an encoder, a grid recording, and the recordings it was trained
//! on where they are at hand. Out: the numbers of `vibes-measure` under their names, each beside what past actions alone would give: on a grid every cell of a
//! row shares its actions, so an encoder that sees only those already scores well.

use std::collections::BTreeMap;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::Recording;
use vibes_measure::episodes::PROBE_EPISODES;
use vibes_measure::invariance::{Dropped, Grid};
use vibes_measure::numbers::{GridOptions, Numbers, grid_numbers, probe_numbers};
use vibes_measure::probes::{Fit, ProbeOptions, ProbeScore, Quantity, Sample, probe};
use vibes_model::trained::TrainedEncoder;

use crate::encode::check_fit;
use crate::error::{Result, TrainError};

mod feature_table;
mod features;
pub mod gaps;
mod held_out;
pub mod open_loop;
mod rows;
mod took;

pub use feature_table::Features;
pub use features::features;
pub use gaps::{GapOptions, Gaps, Judged, Likelihoods, check_gaps, check_windows, gaps, gaps_while};
pub(crate) use held_out::films;
pub use held_out::{GridVideos, are_videos_new_to, is_held_out, is_new_to, shared_starts, videos_of};
pub use open_loop::open_loop;
pub use rows::{Acting, Rows, trajectories};
pub use took::Took;

/// How to evaluate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EvaluateOptions {
    /// Episodes of the training recordings that the probes are fitted on, at most.
    pub probe_episodes: usize,
    /// Seed of what the measures draw.
    pub seed: u64,
}

impl Default for EvaluateOptions {
    fn default() -> Self {
        Self { probe_episodes: PROBE_EPISODES, seed: 0 }
    }
}

/// The numbers of one evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The grid's numbers of the latents, and of every table of features what probes read (`probe/QUANTITY/FEATURES`, or `probe_cross_validated/…`).
    pub numbers: Numbers,
    /// What every quantity is about: `task`, `symmetry` or `distractor`.
    pub quantities: BTreeMap<String, &'static str>,
    /// Episodes of the training recordings that the probes of numbers were fitted on; none if they were fitted on the grid's own trajectories.
    pub fitted_on: Option<usize>,
    /// Quantities of the grid that were not read because the training recordings do not name them, as those of an older collector.
    pub left_out: Vec<String>,
    /// The part of the grid that has every cell, which shares and retrieval are of.
    pub grid: GridSize,
}

/// The size of a grid without what lacks a cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct GridSize {
    /// State trajectories.
    pub states: usize,
    /// Distractor trajectories.
    pub distractors: usize,
    /// Steps that all of them have.
    pub steps: usize,
    /// Which were left out.
    pub dropped: Dropped,
}

/// Evaluates latents on a grid; the recurrent state and rewards open loop belong to a world model alone.
///
/// # Errors
/// The recording is no grid, or does not fit the encoder, or the latents do not vary.
pub fn evaluate(
    encoder: TrainedEncoder<'_>,
    grid: &Recording,
    training: &[Recording],
    options: EvaluateOptions,
    device: &Device,
) -> Result<Report> {
    evaluate_while(encoder, grid, training, options, device, &mut || Ok(()))
}

/// The same where `go_on` is asked between episodes and between tables, and ends it with the error that it gives.
///
/// # Errors
/// As [`evaluate`], or what `go_on` says.
pub fn evaluate_while(
    encoder: TrainedEncoder<'_>,
    grid: &Recording,
    training: &[Recording],
    options: EvaluateOptions,
    device: &Device,
    go_on: &mut dyn FnMut() -> Result<()>,
) -> Result<Report> {
    training.iter().chain([grid]).try_for_each(|recording| check_fit(encoder, recording))?;
    let judged = Rows::of(std::slice::from_ref(grid), usize::MAX)?;
    check_rows(&judged, grid)?;
    let fitted = Rows::of(training, options.probe_episodes)?;
    let tables = features(encoder, &judged, device, go_on)?;
    let tables_to_fit = features(encoder, &fitted, device, go_on)?;
    let (mut numbers, size) = grid_of(&judged, &tables[0], grid, options.seed)?;
    let probes = Probes::of(&judged, &fitted, options.seed);
    let control = probes.read(&judged.past_actions(), (!fitted.is_empty()).then(|| fitted.past_actions()).as_ref())?;
    for (at, table) in tables.iter().enumerate() {
        go_on()?;
        let scores = probes.read(table, tables_to_fit.get(at))?;
        numbers.extend(probe_numbers(table.name, &scores, Some(&control)));
    }
    if let (TrainedEncoder::World(model), [latents, states, ..]) = (encoder, &tables[..]) {
        numbers.extend(open_loop(model, &judged, (latents, states), options.seed, device)?);
    }
    let fitted_on = (!fitted.is_empty()).then(|| fitted.episodes());
    Ok(Report { numbers, quantities: probes.about, fitted_on, left_out: probes.left_out, grid: size })
}

/// That latents of this encoder can be evaluated on a recording: to be known before anything is computed.
///
/// # Errors
/// The recording does not fit the encoder, or is no grid.
pub fn check_grid(encoder: TrainedEncoder<'_>, grid: &Recording) -> Result<()> {
    check_fit(encoder, grid)?;
    check_is_grid(grid)
}

/// That a recording is a grid.
pub(crate) fn check_is_grid(grid: &Recording) -> Result<()> {
    check_rows(&Rows::of(std::slice::from_ref(grid), usize::MAX)?, grid)
}

/// That a recording's rows are those of a grid.
fn check_rows(rows: &Rows, grid: &Recording) -> Result<()> {
    if rows.is_empty() {
        return Err(no_grid("no episodes", grid));
    }
    if grid.episodes().iter().all(|entry| entry.cell.is_none()) {
        return Err(no_grid("episodes without cells", grid));
    }
    Grid::of_complete_part(rows.table(&rows.past_actions())?).map_err(|error| refused(error, grid))?;
    Ok(())
}

fn no_grid(found: &str, recording: &Recording) -> TrainError {
    TrainError::OtherRecording {
        found: found.to_owned(),
        wanted: "a grid of at least two states and two distractors (`vibes-collect --grid NxM`)".to_owned(),
        path: recording.path().to_owned(),
    }
}

/// What is to be read from tables of features, in the judged rows and in those that are fitted on.
struct Probes {
    judged: (Acting, Vec<Quantity>),
    fitted: (Acting, Vec<Quantity>),
    about: BTreeMap<String, &'static str>,
    left_out: Vec<String>,
    seed: u64,
}

impl Probes {
    /// Quantities that every row has and that vary over the grid.
    fn of(judged: &Rows, fitted: &Rows, seed: u64) -> Self {
        let (mut own, mut theirs, mut about, mut left_out) = (Vec::new(), Vec::new(), BTreeMap::new(), Vec::new());
        for readable in judged.readable() {
            let Some(quantity) = judged.quantity(&readable.name).filter(|quantity| quantity.values.vary()) else {
                continue;
            };
            if !fitted.is_empty() {
                match fitted.quantity(&readable.name) {
                    Some(same) => theirs.push(same),
                    // Classes are never fitted elsewhere; any values keep their place.
                    None if readable.is_class() => theirs.push(quantity.clone()),
                    None => {
                        left_out.push(readable.name.clone());
                        continue;
                    }
                }
            }
            own.push(quantity);
            about.insert(readable.name.clone(), readable.about.name());
        }
        Self { judged: (judged.acting(), own), fitted: (fitted.acting(), theirs), about, left_out, seed }
    }

    /// The scores of one table of features.
    fn read(&self, table: &Features, table_to_fit: Option<&Features>) -> Result<Vec<ProbeScore>> {
        let (rows, quantities) = &self.judged;
        let features = rows.of(table);
        let judged = Sample { table: rows.table(&features)?, quantities };
        let to_fit = table_to_fit.map(|table| self.fitted.0.of(table));
        let fit = match &to_fit {
            Some(features) => Fit::On(Sample { table: self.fitted.0.table(features)?, quantities: &self.fitted.1 }),
            None => Fit::HeldOut,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        Ok(probe(judged, fit, ProbeOptions::default(), &mut rng)?)
    }
}

/// What is wrong with a grid.
fn refused(error: vibes_measure::Error, recording: &Recording) -> TrainError {
    match error {
        vibes_measure::Error::NoGrid => no_grid("episodes without cells", recording),
        vibes_measure::Error::TooFewRows { .. } => no_grid("too few of them", recording),
        other => TrainError::Measure(other),
    }
}

/// The numbers of the grid's latents, beside those of past actions, and how much of it is whole.
fn grid_of(judged: &Rows, latents: &Features, recording: &Recording, seed: u64) -> Result<(Numbers, GridSize)> {
    let refuse = |error| refused(error, recording);
    let actions = judged.past_actions();
    let grid = Grid::of_complete_part(judged.table(latents)?).map_err(refuse)?;
    let control = Grid::of_complete_part(judged.table(&actions)?).map_err(refuse)?;
    let numbers = grid_numbers(&grid, Some(&control), &GridOptions { seed, ..GridOptions::default() })?;
    let size = GridSize {
        states: grid.states().len(),
        distractors: grid.distractors().len(),
        steps: grid.steps().len(),
        dropped: grid.dropped().clone(),
    };
    Ok((numbers, size))
}
