//! Do neighbours in the latent space share the true task state? The number beside the sheet of neighbours.
//!
//! In: the task state of every row, queries and their neighbours. Out: the mean distance between a query's state and its neighbours' states,
//! beside that of random rows of other trajectories, with 95% intervals over state and distractor trajectories: each is left out in turn, as query and as what queries are compared with (see `left_out`).

mod left_out;

use rand::Rng;
use serde::Serialize;

use crate::intervals::{Interval, Range};
use crate::neighbours::{Exclude, Neighbours, Space};

/// How far apart states are, in standard deviations a dimension (root mean square over dimensions).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StateError {
    /// Query and neighbour.
    pub neighbours: Interval,
    /// Query and a random row among those that could have been its neighbours.
    pub random: Interval,
    /// The first over the second: 0 if neighbours share the state, 1 if the latent says nothing about it.
    pub ratio: Interval,
}

/// Measures the error of `states` `[rows, size]` (each dimension divided by its standard deviation, constant ones left out) over the neighbours, which were looked for
/// under `exclude`; random rows are drawn under it too, so that latents of noise come to a ratio of 1. None if no dimension varies, there are no queries, or a query has
/// no row to be compared with. Intervals need three trajectories of every kind that there are several of, three without which the number is another
/// if there are any, and as many rows as neighbours without any one of them.
pub fn state_error(
    space: &Space<'_>,
    states: &[f64],
    queries: &[usize],
    found: &Neighbours,
    exclude: Exclude<'_>,
    rng: &mut impl Rng,
) -> Option<StateError> {
    let table = space.table();
    let states = standardized(states, table.rows())?;
    let distance = |a: usize, b: usize| {
        let square: f64 = states.iter().map(|dim| (dim[a] - dim[b]).powi(2)).sum();
        (square / states.len() as f64).sqrt()
    };
    let alone: Vec<u32>;
    let label = match exclude {
        Exclude::Trajectory => table.episode(),
        Exclude::Group(labels) => labels,
        Exclude::Itself => {
            alone = (0..table.rows() as u32).collect();
            &alone
        }
    };
    if queries.is_empty() || label.iter().all(|of_row| *of_row == label[0]) {
        return None;
    }
    let mean = |distances: &mut dyn Iterator<Item = f64>| distances.sum::<f64>() / found.k() as f64;
    let near: Vec<f64> = queries
        .iter()
        .enumerate()
        .map(|(q, &row)| mean(&mut found.rows(q).iter().map(|&n| distance(row, n as usize))))
        .collect();
    let mut other = |row: usize| loop {
        let drawn = rng.random_range(0..table.rows());
        if label[drawn] != label[row] {
            break drawn;
        }
    };
    let pairs: Vec<(usize, usize)> =
        queries.iter().flat_map(|&row| std::iter::repeat_n(row, found.k())).map(|row| (row, other(row))).collect();
    let of_pairs: Vec<f64> = pairs.iter().map(|&(row, other)| distance(row, other)).collect();
    let random: Vec<f64> = of_pairs.chunks(found.k()).map(|own| mean(&mut own.iter().copied())).collect();
    let trajectories = table.trajectories();
    let without = [
        left_out::neighbours(space, (queries, found), (&trajectories, label), &distance),
        left_out::random(&pairs, &trajectories, &distance),
    ];
    let sums = [near.iter().sum::<f64>(), random.iter().sum::<f64>()];
    let ratio = |kind: usize| -> Vec<f64> {
        without[0][kind].iter().zip(&without[1][kind]).map(|(near, random)| near / random).collect()
    };
    let interval = |estimate: f64, without: &[Vec<f64>; 2]| trajectories.jackknife(estimate, without, Range::Distance);
    let count = queries.len() as f64;
    Some(StateError {
        neighbours: interval(sums[0] / count, &without[0]),
        random: interval(sums[1] / count, &without[1]),
        ratio: interval(sums[0] / sums[1], &[0, 1].map(ratio)),
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
    use crate::Table;
    use crate::neighbours::{Metric, nearest};

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
            state_error(&space, &states, &queries, &found, Exclude::Trajectory, &mut ChaCha8Rng::seed_from_u64(1))
                .expect("error")
        };
        let (same, other) = (error(&state), error(&noise));
        assert!(same.ratio.high < 0.15, "{same:?}");
        assert!(other.ratio.low < 1.0 && other.ratio.high > 1.0, "{other:?}");
        let table = Table::new(2, &noise, &episode, &step).expect("table");
        let space = Space::new(table, Metric::Standardized).expect("space");
        let found = nearest(&space, &queries, 5, Exclude::Trajectory).expect("neighbours");
        let constant = vec![3.0; rows * 2];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert!(state_error(&space, &constant, &queries, &found, Exclude::Trajectory, &mut rng).is_none());
    }

    #[test]
    fn noise_comes_to_one_whatever_its_neighbours_leave_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        // Two states under six distractors: the cells of a state agree in it.
        let (cells, steps) = (12, 40);
        let noise: Vec<f32> = (0..cells * steps * 2).map(|_| rng.random_range(-1.0f32..1.0)).collect();
        let (episode, step): (Vec<u32>, Vec<u32>) =
            (0..cells * steps).map(|r| ((r / steps) as u32, (r % steps) as u32)).unzip();
        let state: Vec<u32> = episode.iter().map(|cell| cell / 6).collect();
        let states: Vec<f64> =
            state.iter().map(|&state| 10.0 * f64::from(state)).zip(&step).map(|(s, &t)| s + f64::from(t)).collect();
        let table = Table::new(2, &noise, &episode, &step).expect("table");
        let space = Space::new(table, Metric::Standardized).expect("space");
        let queries: Vec<usize> = (0..96).map(|i| i * 5).collect();
        for exclude in [Exclude::Itself, Exclude::Trajectory, Exclude::Group(&state)] {
            let found = nearest(&space, &queries, 5, exclude).expect("neighbours");
            let error = state_error(&space, &states, &queries, &found, exclude, &mut rng).expect("error");
            assert!((error.ratio.estimate - 1.0).abs() < 0.1, "{error:?} without {exclude:?}");
        }
    }
}
