//! How good the latents are, on a held-out grid of state trajectories × distractor trajectories. In: a model and a grid recording. Out: same-state retrieval,
//! the split of the latents' variance, and what can be read from them, each beside what past actions alone would give: on a grid every cell of a row
//! shares its actions, so an encoder that sees only those already scores well.

use burn::tensor::Device;
use serde::Serialize;
use vibes_data::{EpisodeView, Recording};
use vibes_model::Model;
use vibes_model::encode::EpisodeEncoder;

use crate::encode::{check_fit, encode_rows};
use crate::error::{Result, TrainError};

pub mod gaps;
pub mod probe;
pub mod retrieval;
pub mod shares;
mod targets;

pub use gaps::{GapOptions, Gaps, gaps};

/// Rows encoded at a time.
const CHUNK: usize = 128;
/// Rows at the start of every episode that are left out: the encoder has not seen enough yet to know velocities.
const SKIP: usize = 5;

/// The numbers of one evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Share of latents whose nearest among all other cells at the same step shows the same state trajectory; averaged over steps.
    pub retrieval_at_1: f64,
    /// The same for the past actions alone.
    pub retrieval_at_1_actions: f64,
    /// The share if neighbours were drawn blindly.
    pub retrieval_at_1_chance: f64,
    /// The split of the latents' variance.
    pub shares: shares::Shares,
    /// What a ridge regression reads from the latents.
    pub probes: Vec<Probe>,
}

/// What a ridge regression reads from the latents, on rows held out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Probe {
    /// Name of the quantity.
    pub name: String,
    /// `task` or `distractor`.
    pub kind: &'static str,
    /// R² of the latents; accuracy for `video`.
    pub latents: f64,
    /// R² of the past actions; accuracy for `video`.
    pub actions: f64,
    /// What guessing gives: 0 for R², the share of the commonest for an accuracy.
    pub chance: f64,
}

/// One table of features on the grid: `[states, distractors, steps, dims]`, row-major.
#[derive(Debug, Clone)]
pub struct GridTable {
    /// State trajectories.
    pub states: usize,
    /// Distractor trajectories.
    pub distractors: usize,
    /// Rows of every cell.
    pub steps: usize,
    /// Numbers a row.
    pub dims: usize,
    /// The values.
    pub values: Vec<f32>,
}

impl GridTable {
    /// The row of cell (state, distractor) at `step`.
    pub fn row(&self, state: usize, distractor: usize, step: usize) -> &[f32] {
        let at = ((state * self.distractors + distractor) * self.steps + step) * self.dims;
        &self.values[at..at + self.dims]
    }
}

/// Evaluates a model on a grid.
///
/// # Errors
/// The recording is no full grid, or does not fit the model.
pub fn evaluate(model: &Model, grid: &Recording, device: &Device) -> Result<Report> {
    check_fit(model, grid)?;
    let cells = open_cells(grid)?;
    let latents = encode_grid(model, &cells, device)?;
    let actions = cells.table(model.config.actions() * targets::ACTION_FEATURES, |view, row, out| {
        targets::action_features(view, row, out);
    });
    let (retrieval_at_1, retrieval_at_1_chance) = retrieval::at_1(&latents);
    Ok(Report {
        retrieval_at_1,
        retrieval_at_1_actions: retrieval::at_1(&actions).0,
        retrieval_at_1_chance,
        shares: shares::shares(&latents),
        probes: targets::probes(&grid.manifest().spec, &cells, &latents, &actions),
    })
}

/// The cells of a full grid, by state and then distractor.
#[derive(Debug)]
pub(crate) struct Cells {
    states: usize,
    distractors: usize,
    /// First row used, and how many follow.
    steps: usize,
    views: Vec<EpisodeView>,
}

impl Cells {
    /// A table of some features of every used row; the last row of an episode, which has no action, is not used.
    pub(crate) fn table(&self, dims: usize, mut of: impl FnMut(&EpisodeView, usize, &mut Vec<f32>)) -> GridTable {
        let mut values = Vec::with_capacity(self.views.len() * self.steps * dims);
        for view in &self.views {
            for step in 0..self.steps {
                of(view, SKIP + step, &mut values);
            }
        }
        GridTable { states: self.states, distractors: self.distractors, steps: self.steps, dims, values }
    }
}

fn open_cells(grid: &Recording) -> Result<Cells> {
    let refuse = |found: &str| TrainError::OtherRecording {
        found: found.to_owned(),
        wanted: "a full grid (`vibes-collect --grid NxM`)".to_owned(),
        path: grid.path().to_owned(),
    };
    let size = grid.manifest().grid.ok_or_else(|| refuse("episodes without a grid"))?;
    let (states, distractors) = (size.states as usize, size.distractors as usize);
    let mut numbers = vec![None; states * distractors];
    for entry in grid.episodes() {
        let cell = entry.cell.ok_or_else(|| refuse("episodes without a cell"))?;
        if let Some(place) = numbers.get_mut(cell.state as usize * distractors + cell.distractor as usize) {
            *place = Some(entry.index);
        }
    }
    let numbers: Option<Vec<u32>> = numbers.into_iter().collect();
    let numbers = numbers.ok_or_else(|| refuse("a grid with missing cells"))?;
    let views = numbers.into_iter().map(|index| grid.episode(index)).collect::<std::result::Result<Vec<_>, _>>()?;
    let steps = views.iter().map(EpisodeView::steps).min().unwrap_or(0).saturating_sub(SKIP);
    if states < 2 || distractors < 2 || steps < 2 {
        return Err(refuse("a grid of fewer than two states, two distractors or seven steps"));
    }
    Ok(Cells { states, distractors, steps, views })
}

fn encode_grid(model: &Model, cells: &Cells, device: &Device) -> Result<GridTable> {
    let dims = model.config.latent;
    let mut values = Vec::with_capacity(cells.views.len() * cells.steps * dims);
    let mut encoder = EpisodeEncoder::new(model, device);
    for view in &cells.views {
        encoder.reset();
        let rows = SKIP + cells.steps;
        let mut latents = Vec::with_capacity(rows * dims);
        for start in (0..rows).step_by(CHUNK) {
            latents.extend(encode_rows(model, &mut encoder, view, start..rows.min(start + CHUNK))?);
        }
        values.extend_from_slice(&latents[SKIP * dims..]);
    }
    Ok(GridTable { states: cells.states, distractors: cells.distractors, steps: cells.steps, dims, values })
}

#[cfg(test)]
mod tests;
