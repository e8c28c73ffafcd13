//! Against distances in double precision, also where rows tie or lie close together.

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::super::Cut;
use super::{Place, Query, Sieve};
use crate::Table;
use crate::invariance::Grid;

/// Whether the query finds its state, also without each state and distractor that is not its own.
fn answers(query: &Query, [states, distractors]: [usize; 2]) -> Vec<bool> {
    let own = query.cell();
    let without_states = (0..states).filter(|&out| out != own.state).map(|out| query.finds_without_state(out));
    let without_distractors =
        (0..distractors).filter(|&out| out != own.distractor).map(|out| query.finds_without_distractor(out));
    [query.finds()].into_iter().chain(without_states).chain(without_distractors).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Every row counted by its distance in double precision. Whole numbers tie often, and far from 0 or close together they leave single precision nothing.
    #[test]
    fn the_sieve_counts_as_double_precision_does(
        seed in any::<u64>(), k in 1_usize..6, close in any::<bool>(), of_state in 0_i32..3, distinct in 2_i32..9,
    ) {
        let (states, distractors, steps, dims) = (5_u32, 4_u32, 70_u32, 3);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let rows: Vec<[u32; 3]> = (0..states * distractors * steps)
            .map(|at| [at / (distractors * steps), at / steps % distractors, at % steps])
            .collect();
        let unit: f32 = if close { 1e-4 } else { 1.0 };
        let values: Vec<f32> = rows
            .iter()
            .flat_map(|row| {
                let state = row[0] as f32 * of_state as f32;
                [(); 3].map(|()| 10.0 * state + unit * rng.random_range(0..distinct) as f32)
            })
            .collect();
        let column = |of: usize| rows.iter().map(|row| Some(row[of])).collect::<Vec<Option<u32>>>();
        let (state, distractor) = (column(0), column(1));
        let episode: Vec<u32> = rows.iter().map(|row| row[0] * distractors + row[1]).collect();
        let step: Vec<u32> = rows.iter().map(|row| 2 * row[2]).collect();
        let table = Table::new(dims, &values, &episode, &step).unwrap();
        let grid = Grid::new(table.with_grid(&state, &distractor).unwrap()).unwrap();
        let cut = Cut::new(&grid);
        let space = cut.space().unwrap();
        let sieve = Sieve::new(&space, &grid, k, 4);
        let queries: Vec<usize> = (0..rows.len()).step_by(13).collect();
        let found: Vec<Query> = sieve.ask(&queries).collect();
        prop_assert_eq!(found.len(), queries.len());
        let size = [states as usize, distractors as usize];
        for (&at, found) in queries.iter().zip(&found) {
            let mut wanted = Query::new(k, sieve.cell(at), size, &sieve.matches(at));
            for row in (0..rows.len()).filter(|&row| rows[row][1] != rows[at][1]) {
                wanted.count(Place { distance: space.distance(at, row), row }, sieve.cell(row));
            }
            prop_assert_eq!(answers(found, size), answers(&wanted, size));
        }
    }
}
