//! Do neighbours in the latent space share the true task state? The number beside the sheet of neighbours.
//!
//! In: the task state of every row, queries and their neighbours. Out: the mean distance between a query's state and its neighbours' states,
//! beside that of random rows of other trajectories, with 95% intervals over the queries' state and distractor trajectories.

use rand::Rng;
use serde::Serialize;

use crate::Table;
use crate::intervals::Interval;
use crate::neighbours::Neighbours;

/// How far apart states are, in standard deviations a dimension (root mean square over dimensions).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StateError {
    /// Query and neighbour.
    pub neighbours: Interval,
    /// Query and a random row of another trajectory.
    pub random: Interval,
    /// The first over the second: 0 if neighbours share the state, 1 if the latent says nothing about it.
    pub ratio: Interval,
}

/// Measures the error of `states` `[rows, size]` (each dimension divided by its standard deviation, constant ones left out) over the neighbours.
/// None if no dimension varies, there are no queries, or all rows are of one trajectory.
pub fn state_error(
    table: &Table<'_>,
    states: &[f64],
    queries: &[usize],
    found: &Neighbours,
    rng: &mut impl Rng,
) -> Option<StateError> {
    let states = standardized(states, table.rows())?;
    let distance = |a: usize, b: usize| {
        let square: f64 = states.iter().map(|dim| (dim[a] - dim[b]).powi(2)).sum();
        (square / states.len() as f64).sqrt()
    };
    let episode = table.episode();
    if queries.is_empty() || episode.iter().all(|e| *e == episode[0]) {
        return None;
    }
    let mean = |distances: &mut dyn Iterator<Item = f64>| distances.sum::<f64>() / found.k() as f64;
    let near: Vec<f64> = queries
        .iter()
        .enumerate()
        .map(|(q, &row)| mean(&mut found.rows(q).iter().map(|&n| distance(row, n as usize))))
        .collect();
    let random: Vec<f64> = queries
        .iter()
        .map(|&row| {
            let mut other = || loop {
                let drawn = rng.random_range(0..table.rows());
                if episode[drawn] != episode[row] {
                    break drawn;
                }
            };
            mean(&mut (0..found.k()).map(|_| distance(row, other())))
        })
        .collect();
    let trajectories = table.trajectories();
    Some(StateError {
        neighbours: trajectories.mean(queries, &near, rng),
        random: trajectories.mean(queries, &random, rng),
        ratio: trajectories.ratio(queries, &near, &random, rng),
    })
}

/// The dimensions that vary, each as a column of unit variance.
fn standardized(states: &[f64], rows: usize) -> Option<Vec<Vec<f64>>> {
    let size = states.len().checked_div(rows)?;
    let column = |d: usize| {
        let values: Vec<f64> = states.iter().skip(d).step_by(size).copied().collect();
        let mean = values.iter().sum::<f64>() / rows as f64;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / rows as f64).sqrt();
        (deviation > 1e-9 && deviation.is_finite()).then(|| values.iter().map(|v| v / deviation).collect())
    };
    let columns: Vec<Vec<f64>> = (0..size).filter_map(column).collect();
    (!columns.is_empty()).then_some(columns)
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::neighbours::{Exclude, Metric, Space, nearest};

    #[test]
    fn neighbours_in_the_state_itself_have_little_error_and_in_noise_as_much_as_random_rows() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let rows = 600;
        let mut draw = || (0..rows * 2).map(|_| rng.random_range(-1.0f32..1.0)).collect::<Vec<f32>>();
        let (state, noise) = (draw(), draw());
        let (episode, step): (Vec<u32>, Vec<u32>) = (0..rows as u32).map(|r| (r / 20, r % 20)).unzip();
        let states: Vec<f64> = state.iter().map(|&v| f64::from(v)).collect();
        let queries: Vec<usize> = (0..60).map(|i| i * 10).collect();
        let error = |latent: &[f32]| {
            let table = Table::new(2, latent, &episode, &step).expect("table");
            let space = Space::new(table, Metric::Standardized).expect("space");
            let found = nearest(&space, &queries, 5, Exclude::Trajectory).expect("neighbours");
            state_error(&table, &states, &queries, &found, &mut ChaCha8Rng::seed_from_u64(1)).expect("error")
        };
        let (same, other) = (error(&state), error(&noise));
        assert!(same.ratio.high < 0.15, "{same:?}");
        assert!(other.ratio.low < 1.0 && other.ratio.high > 1.0, "{other:?}");
        let table = Table::new(2, &noise, &episode, &step).expect("table");
        let space = Space::new(table, Metric::Standardized).expect("space");
        let found = nearest(&space, &queries, 5, Exclude::Trajectory).expect("neighbours");
        assert!(
            state_error(&table, &vec![3.0; rows * 2], &queries, &found, &mut ChaCha8Rng::seed_from_u64(1)).is_none()
        );
    }
}
