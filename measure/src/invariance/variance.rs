//! The two-way split of the latents' variance, summed over dimensions.
//!
//! At each step t, with `z_ij` the latent of state trajectory i under distractor trajectory j (N × M of them) and a dot for a mean,
//!
//! ```text
//! Σ_ij |z_ij - z_..|²  =  M Σ_i |z_i. - z_..|²  +  N Σ_j |z_.j - z_..|²  +  Σ_ij |z_ij - z_i. - z_.j + z_..|²
//!        total          =        state           +       distractor       +             interaction
//! ```
//!
//! The sums are added over the steps and divided by the total's sum: three shares that add up to 1. The interaction
//! holds what the distractor does to some states and not to others, and all noise. Latents that do not depend on the cell at all
//! still give the state (N - 1) / (NM - 1), so read the shares beside that.

use rayon::prelude::*;
use serde::Serialize;

use super::Grid;
use crate::Error;
use crate::intervals::{Interval, Range, crossed};

/// Shares of the latents' variance. The first three add up to 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VarianceSplit {
    /// Share the state explains at a step.
    pub state: Interval,
    /// Share the distractor explains at a step, the same for all states.
    pub distractor: Interval,
    /// What is left: the distractor's effect where it differs between states.
    pub interaction: Interval,
    /// Variance over distractors at the same state and step (distractor and interaction), over the variance of all rows of
    /// all steps: 0 for a latent that ignores distractors.
    pub within_state: Interval,
    /// The first three shares at each step.
    pub by_step: Vec<StepShares>,
    /// The shares if latents were noise.
    pub of_noise: NoiseShares,
}

/// The shares of N states × M distractors over T steps if every latent were noise of its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseShares {
    /// `(N - 1) / (NM - 1)`.
    pub state: f64,
    /// `(M - 1) / (NM - 1)`.
    pub distractor: f64,
    /// `(N - 1)(M - 1) / (NM - 1)`.
    pub interaction: f64,
    /// `TN(M - 1) / (TNM - 1)`.
    pub within_state: f64,
}

impl NoiseShares {
    fn of(grid: &Grid<'_>) -> Self {
        let [n, m, t] = [grid.states().len(), grid.distractors().len(), grid.steps().len()].map(|count| count as f64);
        let all = n * m - 1.0;
        Self {
            state: (n - 1.0) / all,
            distractor: (m - 1.0) / all,
            interaction: (n - 1.0) * (m - 1.0) / all,
            within_state: t * n * (m - 1.0) / (t * n * m - 1.0),
        }
    }
}

/// The shares at one step (NaN where all cells have the same latent).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepShares {
    /// The step.
    pub step: u32,
    /// Share the state explains.
    pub state: f64,
    /// Share the distractor explains.
    pub distractor: f64,
    /// What is left.
    pub interaction: f64,
}

/// Split the variance of a grid's latents. Intervals are over both kinds of trajectories: each is left out in turn (see [`crossed`]);
/// none with fewer than three states or distractors, nor where nothing varies without one of them.
///
/// # Errors
/// All cells have the same latent at every step.
pub fn variance(grid: &Grid<'_>) -> Result<VarianceSplit, Error> {
    let steps: Vec<LeftOut<Sums>> = (0..grid.steps().len()).into_par_iter().map(|step| split_at(grid, step)).collect();
    let mut all = LeftOut::zero(grid);
    steps.iter().for_each(|step| all.add(step));
    let whole = all.whole;
    if whole.total() <= 0.0 {
        return Err(Error::AlikeAtEveryStep { cells: grid.states().len() * grid.distractors().len() });
    }
    let overall = overall(grid, &mean(grid, &grid.rows));
    let interval = |share: fn(&Sums) -> f64| all.share(&all, share, Sums::total);
    let shares = |(step, sums): (&u32, &LeftOut<Sums>)| {
        let (sums, total) = (sums.whole, sums.whole.total());
        StepShares {
            step: *step,
            state: sums.state / total,
            distractor: sums.distractor / total,
            interaction: sums.interaction / total,
        }
    };
    Ok(VarianceSplit {
        state: interval(|sums| sums.state),
        distractor: interval(|sums| sums.distractor),
        interaction: interval(|sums| sums.interaction),
        within_state: all.share(&overall, |sums| sums.distractor + sums.interaction, |total| *total),
        by_step: grid.steps().iter().zip(&steps).map(shares).collect(),
        of_noise: NoiseShares::of(grid),
    })
}

/// Sums of squares.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    state: f64,
    distractor: f64,
    interaction: f64,
}

impl Sums {
    /// From `Σ_i |Σ_j z_ij|²`, `Σ_j |Σ_i z_ij|²`, `|Σ_ij z_ij|²` and `Σ_ij |z_ij|²`.
    fn of(states: f64, distractors: f64, rows: f64, columns: f64, all: f64, squares: f64) -> Self {
        let mean = all / (states * distractors);
        let (state, distractor) = ((rows / distractors - mean).max(0.0), (columns / states - mean).max(0.0));
        Self { state, distractor, interaction: (squares - mean - state - distractor).max(0.0) }
    }

    fn total(&self) -> f64 {
        self.state + self.distractor + self.interaction
    }

    /// Nothing, if that is what is left of sums of such `squares` but for rounding: its shares would be of anything.
    fn unless_rounding(self, squares: f64) -> Self {
        if is_rounding(self.total(), squares) { Self::default() } else { self }
    }
}

/// Whether a difference of sums of `squares` is what rounding leaves where nothing varies: 4e-15 of them in a grid of 40 × 40, and more in a larger one.
fn is_rounding(difference: f64, squares: f64) -> bool {
    difference <= 1e-12 * squares
}

/// A quantity of the whole grid, and of the grid without each of its state and distractor trajectories.
struct LeftOut<T> {
    whole: T,
    /// `[states]`.
    states: Vec<T>,
    /// `[distractors]`.
    distractors: Vec<T>,
}

impl<T> LeftOut<T> {
    /// `part` of this over `total` of the other, with its interval.
    fn share<U>(&self, other: &LeftOut<U>, part: impl Fn(&T) -> f64, total: impl Fn(&U) -> f64) -> Interval {
        let ratios = |parts: &[T], totals: &[U]| -> Vec<f64> {
            parts.iter().zip(totals).map(|(a, b)| part(a) / total(b)).collect()
        };
        let without = [ratios(&self.states, &other.states), ratios(&self.distractors, &other.distractors)];
        crossed(part(&self.whole) / total(&other.whole), [&without[0], &without[1]], Range::Share)
    }
}

impl LeftOut<Sums> {
    fn zero(grid: &Grid<'_>) -> Self {
        let zeros = |count: usize| vec![Sums::default(); count];
        Self {
            whole: Sums::default(),
            states: zeros(grid.states().len()),
            distractors: zeros(grid.distractors().len()),
        }
    }

    fn add(&mut self, other: &Self) {
        let add = |sum: &mut Sums, more: &Sums| {
            sum.state += more.state;
            sum.distractor += more.distractor;
            sum.interaction += more.interaction;
        };
        add(&mut self.whole, &other.whole);
        self.states.iter_mut().zip(&other.states).for_each(|(sum, more)| add(sum, more));
        self.distractors.iter_mut().zip(&other.distractors).for_each(|(sum, more)| add(sum, more));
    }
}

/// The sums of one step, of the whole grid and without each trajectory: all from the sums over rows, columns and the grid.
fn split_at(grid: &Grid<'_>, step: usize) -> LeftOut<Sums> {
    let (states, distractors, dims) = (grid.states().len(), grid.distractors().len(), grid.table().dims());
    let (n, m) = (states as f64, distractors as f64);
    let rows: Vec<usize> = grid_cells(grid).map(|(state, distractor)| grid.row(state, distractor, step)).collect();
    // Of this step alone: what differs between steps is no part of the split, and rounding is to be seen beside what is.
    let centre = mean(grid, &rows);
    let mut cells = Vec::with_capacity(rows.len() * dims);
    for &row in &rows {
        cells.extend(grid.table().row(row).iter().zip(&centre).map(|(&z, centre)| f64::from(z) - centre));
    }
    let cell = |state: usize, distractor: usize| {
        let at = (state * distractors + distractor) * dims;
        &cells[at..at + dims]
    };
    // Where all cells are the same, to the bit, what sums leave of the differences is rounding.
    if cells.chunks_exact(dims.max(1)).all(|other| other == cell(0, 0)) {
        return LeftOut::zero(grid);
    }
    let rows = Totals::new(states, dims, |state| (0..distractors).map(move |j| (state, j)), &cell);
    let columns = Totals::new(distractors, dims, |distractor| (0..states).map(move |i| (i, distractor)), &cell);
    let all = rows.sums.iter().fold(vec![0.0; dims], |all, row| plus(all, row));
    let squares: f64 = rows.squares.iter().sum();
    let whole = Sums::of(n, m, rows.norms(), columns.norms(), norm(&all), squares);
    let without_state = |state: usize| {
        let row = &rows.sums[state];
        let columns = (0..distractors).map(|j| apart(&columns.sums[j], cell(state, j))).sum();
        let left = squares - rows.squares[state];
        Sums::of(n - 1.0, m, rows.norms() - norm(row), columns, apart(&all, row), left).unless_rounding(squares)
    };
    let without_distractor = |distractor: usize| {
        let column = &columns.sums[distractor];
        let rows = (0..states).map(|i| apart(&rows.sums[i], cell(i, distractor))).sum();
        let left = squares - columns.squares[distractor];
        Sums::of(n, m - 1.0, rows, columns.norms() - norm(column), apart(&all, column), left).unless_rounding(squares)
    };
    LeftOut {
        whole,
        states: (0..states).map(without_state).collect(),
        distractors: (0..distractors).map(without_distractor).collect(),
    }
}

fn grid_cells(grid: &Grid<'_>) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (states, distractors) = (grid.states().len(), grid.distractors().len());
    (0..states).flat_map(move |state| (0..distractors).map(move |distractor| (state, distractor)))
}

/// Sums of the latents along each row or column of the grid, and of their squares.
struct Totals {
    sums: Vec<Vec<f64>>,
    squares: Vec<f64>,
}

impl Totals {
    fn new<'c, I: Iterator<Item = (usize, usize)>>(
        lines: usize,
        dims: usize,
        cells_of: impl Fn(usize) -> I,
        cell: &impl Fn(usize, usize) -> &'c [f64],
    ) -> Self {
        let sum = |line: usize| cells_of(line).fold(vec![0.0; dims], |sum, (i, j)| plus(sum, cell(i, j)));
        let squares = |line: usize| cells_of(line).map(|(i, j)| norm(cell(i, j))).sum();
        Self { sums: (0..lines).map(sum).collect(), squares: (0..lines).map(squares).collect() }
    }

    fn norms(&self) -> f64 {
        self.sums.iter().map(|sum| norm(sum)).sum()
    }
}

fn plus(mut sum: Vec<f64>, more: &[f64]) -> Vec<f64> {
    sum.iter_mut().zip(more).for_each(|(sum, x)| *sum += x);
    sum
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x * x).sum()
}

/// `|a - b|²`.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Sums of squares of all rows of all steps about their mean.
fn overall(grid: &Grid<'_>, centre: &[f64]) -> LeftOut<f64> {
    let (states, distractors, dims) = (grid.states().len(), grid.distractors().len(), centre.len());
    let steps = grid.steps().len();
    let of_cell = |(state, distractor): (usize, usize)| {
        let (mut squares, mut sum) = (0.0, vec![0.0; dims]);
        for step in 0..steps {
            let latent = grid.table().row(grid.row(state, distractor, step));
            for ((sum, &z), centre) in sum.iter_mut().zip(latent).zip(centre) {
                let z = f64::from(z) - centre;
                squares += z * z;
                *sum += z;
            }
        }
        (squares, sum)
    };
    let cells: Vec<(usize, usize)> = grid_cells(grid).collect();
    let of_cells: Vec<(f64, Vec<f64>)> = cells.par_iter().map(|&cell| of_cell(cell)).collect();
    let all: f64 = of_cells.iter().map(|cell| cell.0).sum();
    let over = |kept: &dyn Fn(usize, usize) -> bool| {
        let (mut count, mut squares, mut sum) = (0.0, 0.0, vec![0.0; dims]);
        for (_, cell) in cells.iter().zip(&of_cells).filter(|((i, j), _)| kept(*i, *j)) {
            count += steps as f64;
            squares += cell.0;
            sum = plus(sum, &cell.1);
        }
        let about_their_mean = squares - norm(&sum) / count;
        if is_rounding(about_their_mean, all) { 0.0 } else { about_their_mean }
    };
    LeftOut {
        whole: over(&|_, _| true),
        states: (0..states).map(|out| over(&|i, _| i != out)).collect(),
        distractors: (0..distractors).map(|out| over(&|_, j| j != out)).collect(),
    }
}

/// The mean of some rows. Taken off every latent first: sums of squares of numbers near 0 keep their digits.
fn mean(grid: &Grid<'_>, rows: &[usize]) -> Vec<f64> {
    let mut sum = vec![0.0; grid.table().dims()];
    for &row in rows {
        sum.iter_mut().zip(grid.table().row(row)).for_each(|(sum, &z)| *sum += f64::from(z));
    }
    sum.iter().map(|sum| sum / rows.len() as f64).collect()
}
