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
    let (n, m) = (table.states, table.distractors);
    let mut sums = [0.0; 3];
    let (mut all, mut squares) = (vec![0.0; table.dims], 0.0);
    for step in 0..table.steps {
        for dim in 0..table.dims {
            let at = |i: usize, j: usize| f64::from(table.row(i, j, step)[dim]);
            let by_state: Vec<f64> = (0..n).map(|i| (0..m).map(|j| at(i, j)).sum::<f64>() / m as f64).collect();
            let by_distractor: Vec<f64> = (0..m).map(|j| (0..n).map(|i| at(i, j)).sum::<f64>() / n as f64).collect();
            let mean = by_state.iter().sum::<f64>() / n as f64;
            sums[0] += m as f64 * by_state.iter().map(|z| (z - mean).powi(2)).sum::<f64>();
            sums[1] += n as f64 * by_distractor.iter().map(|z| (z - mean).powi(2)).sum::<f64>();
            for i in 0..n {
                for j in 0..m {
                    sums[2] += (at(i, j) - by_state[i] - by_distractor[j] + mean).powi(2);
                    squares += at(i, j).powi(2);
                }
            }
            all[dim] += mean / table.steps as f64;
        }
    }
    let total: f64 = sums.iter().sum();
    let rows = (n * m * table.steps) as f64;
    let overall = squares - rows * all.iter().map(|mean| mean * mean).sum::<f64>();
    let share = |part: f64, whole: f64| if whole > 1e-12 { part / whole } else { 0.0 };
    Shares {
        state: share(sums[0], total),
        distractor: share(sums[1], total),
        interaction: share(sums[2], total),
        within_state: share(sums[1] + sums[2], overall),
        state_of_noise: (n as f64 - 1.0) / ((n * m) as f64 - 1.0),
    }
}
