//! The two-way split of the latents' variance into state, distractor and interaction, summed over dimensions and steps.
//!
//! ```text
//! Σ_ij |z_ij − z_..|²  =  M Σ_i |z_i. − z_..|²  +  N Σ_j |z_.j − z_..|²  +  Σ_ij |z_ij − z_i. − z_.j + z_..|²
//! ```

use serde::Serialize;

use super::GridTable;

/// Shares of the variance over cells at the same step; they add up to 1 (all 0 where nothing varies).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Shares {
    /// What the state explains.
    pub state: f64,
    /// What the distractor explains, the same for all states.
    pub distractor: f64,
    /// What is left: the distractor's effect where it differs between states.
    pub interaction: f64,
    /// Variance over distractors at the same state and step, over the variance of all rows of all steps.
    pub within_state: f64,
    /// The state's share if latents were noise.
    pub state_of_noise: f64,
}

/// Splits the variance of a grid's latents.
pub fn shares(table: &GridTable) -> Shares {
    let mut sums = Sums::default();
    for dim in 0..table.dims {
        let mut mean = 0.0;
        for step in 0..table.steps {
            mean += sums.add(table, step, dim) / table.steps as f64;
        }
        sums.mean_squares += mean * mean;
    }
    let (n, m) = (table.states, table.distractors);
    let total = sums.state + sums.distractor + sums.interaction;
    let overall = sums.squares - (n * m * table.steps) as f64 * sums.mean_squares;
    let share = |part: f64, whole: f64| if whole > 1e-12 { part / whole } else { 0.0 };
    Shares {
        state: share(sums.state, total),
        distractor: share(sums.distractor, total),
        interaction: share(sums.interaction, total),
        within_state: share(sums.distractor + sums.interaction, overall),
        state_of_noise: (n as f64 - 1.0) / ((n * m) as f64 - 1.0),
    }
}

/// Sums of squares.
#[derive(Debug, Default)]
struct Sums {
    state: f64,
    distractor: f64,
    interaction: f64,
    /// Of all values.
    squares: f64,
    /// Of each dimension's mean over everything.
    mean_squares: f64,
}

impl Sums {
    /// Adds one dimension at one step; gives its mean over the cells.
    fn add(&mut self, table: &GridTable, step: usize, dim: usize) -> f64 {
        let (n, m) = (table.states, table.distractors);
        let at = |i: usize, j: usize| f64::from(table.row(i, j, step)[dim]);
        let by_state: Vec<f64> = (0..n).map(|i| (0..m).map(|j| at(i, j)).sum::<f64>() / m as f64).collect();
        let by_distractor: Vec<f64> = (0..m).map(|j| (0..n).map(|i| at(i, j)).sum::<f64>() / n as f64).collect();
        let mean = by_state.iter().sum::<f64>() / n as f64;
        self.state += m as f64 * by_state.iter().map(|z| (z - mean).powi(2)).sum::<f64>();
        self.distractor += n as f64 * by_distractor.iter().map(|z| (z - mean).powi(2)).sum::<f64>();
        for (i, of_state) in by_state.iter().enumerate() {
            for (j, of_distractor) in by_distractor.iter().enumerate() {
                self.interaction += (at(i, j) - of_state - of_distractor + mean).powi(2);
                self.squares += at(i, j).powi(2);
            }
        }
        mean
    }
}
