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

use rand::Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::Grid;
use crate::Error;
use crate::intervals::{Interval, bootstrap};

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
    /// The state's share if latents were noise, `(N - 1) / (NM - 1)`.
    pub state_of_noise: f64,
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

/// Split the variance of a grid's latents.
///
/// # Errors
/// All latents equal.
pub fn variance(grid: &Grid<'_>, rng: &mut impl Rng) -> Result<VarianceSplit, Error> {
    let mean = grand_mean(grid);
    let steps: Vec<Products> =
        (0..grid.steps().len()).into_par_iter().map(|step| Products::at(grid, step, &mean)).collect();
    let (states, distractors) = (grid.states().len(), grid.distractors().len());
    let mut all = Products::zero(states);
    steps.iter().for_each(|step| all.add(step));
    let ones = vec![1.0; states];
    let whole = all.sums(&ones, distractors);
    let outer = overall(grid, &mean);
    if whole.state + whole.distractor + whole.interaction == 0.0 {
        return Err(Error::Constant { what: "the invariance split", rows: grid.table().rows() });
    }
    let mut interval = |share: fn(Sums) -> f64| bootstrap(states, rng, |counts| share(all.sums(counts, distractors)));
    let state = interval(|sums| sums.state / sums.total());
    let distractor = interval(|sums| sums.distractor / sums.total());
    let interaction = interval(|sums| sums.interaction / sums.total());
    let within = |counts: &[f64]| {
        let sums = all.sums(counts, distractors);
        (sums.distractor + sums.interaction) / outer.sum(counts)
    };
    let within_state = bootstrap(states, rng, within);
    let shares = |(step, products): (&u32, &Products)| {
        let sums = products.sums(&ones, distractors);
        let total = sums.total();
        StepShares {
            step: *step,
            state: sums.state / total,
            distractor: sums.distractor / total,
            interaction: sums.interaction / total,
        }
    };
    let by_step = grid.steps().iter().zip(&steps).map(shares).collect();
    let state_of_noise = (states as f64 - 1.0) / ((states * distractors) as f64 - 1.0);
    Ok(VarianceSplit { state, distractor, interaction, within_state, by_step, state_of_noise })
}

/// Sums of squares.
#[derive(Debug, Clone, Copy)]
struct Sums {
    state: f64,
    distractor: f64,
    interaction: f64,
}

impl Sums {
    fn total(self) -> f64 {
        self.state + self.distractor + self.interaction
    }
}

/// All the split needs, as products between state trajectories: states can then be drawn again without the latents.
struct Products {
    states: usize,
    /// `z_i. · z_k.`, `[states, states]`.
    means: Vec<f64>,
    /// `Σ_j (z_ij - z_i.) · (z_kj - z_k.)`, `[states, states]`.
    deviations: Vec<f64>,
}

impl Products {
    fn zero(states: usize) -> Self {
        Self { states, means: vec![0.0; states * states], deviations: vec![0.0; states * states] }
    }

    fn at(grid: &Grid<'_>, step: usize, centre: &[f64]) -> Self {
        let (states, distractors, dims) = (grid.states().len(), grid.distractors().len(), centre.len());
        let mut means = vec![vec![0.0; dims]; states];
        let mut deviations = vec![vec![0.0; distractors * dims]; states];
        for state in 0..states {
            for distractor in 0..distractors {
                let latent = grid.table().row(grid.row(state, distractor, step));
                for dim in 0..dims {
                    let z = f64::from(latent[dim]) - centre[dim];
                    deviations[state][distractor * dims + dim] = z;
                    means[state][dim] += z / distractors as f64;
                }
            }
            let mean = &means[state];
            deviations[state]
                .chunks_exact_mut(dims)
                .for_each(|z| z.iter_mut().zip(mean).for_each(|(z, mean)| *z -= mean));
        }
        Self { states, means: gram(&means), deviations: gram(&deviations) }
    }

    fn add(&mut self, other: &Self) {
        self.means.iter_mut().zip(&other.means).for_each(|(sum, x)| *sum += x);
        self.deviations.iter_mut().zip(&other.deviations).for_each(|(sum, x)| *sum += x);
    }

    /// The split with state i taken `counts[i]` times.
    fn sums(&self, counts: &[f64], distractors: usize) -> Sums {
        let total: f64 = counts.iter().sum();
        let state = distractors as f64 * (diagonal(&self.means, counts) - quadratic(&self.means, counts) / total);
        let within = diagonal(&self.deviations, counts);
        // N Σ_j |mean over i of (z_ij - z_i.)|²
        let distractor = quadratic(&self.deviations, counts) / total;
        debug_assert_eq!(self.states, counts.len());
        Sums { state: state.max(0.0), distractor, interaction: (within - distractor).max(0.0) }
    }
}

/// What the sum of squares over all rows of all steps needs.
struct Overall {
    /// `Σ |z|²` of each state's rows.
    squares: Vec<f64>,
    /// Products of the states' sums, `[states, states]`.
    sums: Vec<f64>,
    rows_per_state: f64,
}

impl Overall {
    fn sum(&self, counts: &[f64]) -> f64 {
        let rows = self.rows_per_state * counts.iter().sum::<f64>();
        let squares: f64 = self.squares.iter().zip(counts).map(|(x, count)| x * count).sum();
        squares - quadratic(&self.sums, counts) / rows
    }
}

fn overall(grid: &Grid<'_>, centre: &[f64]) -> Overall {
    let (distractors, steps) = (grid.distractors().len(), grid.steps().len());
    let of_state = |state: usize| {
        let (mut squares, mut sum) = (0.0, vec![0.0; centre.len()]);
        for (distractor, step) in (0..distractors).flat_map(|distractor| (0..steps).map(move |step| (distractor, step)))
        {
            let latent = grid.table().row(grid.row(state, distractor, step));
            for dim in 0..centre.len() {
                let z = f64::from(latent[dim]) - centre[dim];
                squares += z * z;
                sum[dim] += z;
            }
        }
        (squares, sum)
    };
    let (squares, sums): (Vec<f64>, Vec<Vec<f64>>) = (0..grid.states().len()).into_par_iter().map(of_state).unzip();
    Overall { squares, sums: gram(&sums), rows_per_state: (distractors * steps) as f64 }
}

/// Taken off every latent first: sums of squares of numbers near 0 keep their digits.
fn grand_mean(grid: &Grid<'_>) -> Vec<f64> {
    let mut sum = vec![0.0; grid.table().dims()];
    for &row in &grid.rows {
        sum.iter_mut().zip(grid.table().row(row)).for_each(|(sum, &z)| *sum += f64::from(z));
    }
    sum.iter().map(|sum| sum / grid.rows.len() as f64).collect()
}

fn gram(vectors: &[Vec<f64>]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    vectors.iter().flat_map(|a| vectors.iter().map(move |b| dot(a, b))).collect()
}

fn diagonal(matrix: &[f64], counts: &[f64]) -> f64 {
    counts.iter().enumerate().map(|(i, count)| count * matrix[i * counts.len() + i]).sum()
}

fn quadratic(matrix: &[f64], counts: &[f64]) -> f64 {
    let line = |row: &[f64]| row.iter().zip(counts).map(|(x, count)| x * count).sum::<f64>();
    matrix.chunks_exact(counts.len()).zip(counts).map(|(row, count)| count * line(row)).sum()
}
