//! What intervals of distances and neighbours hold: of grids drawn from one model again and again, and of grids that a trajectory is missing from.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::{Rows, generator};
use crate::intervals::{Interval, Range, crossed};
use crate::invariance::{Grid, RetrievalOptions, denoising_factor, retrieval_any_step, retrieval_same_step};

/// Three steps of 8 states under 6 distractors: each state has a place and each of its steps another beside it, distractors shift them all, and noise comes on top.
fn drawn(rng: &mut ChaCha8Rng) -> Rows {
    let mut normal = |sd: f32| [(); 3].map(|()| sd * (0..12).map(|_| rng.random_range(-0.5..0.5_f32)).sum::<f32>());
    let state: Vec<[f32; 3]> = (0..8).map(|_| normal(1.0)).collect();
    let step: Vec<[f32; 3]> = (0..24).map(|_| normal(0.5)).collect();
    let distractor: Vec<[f32; 3]> = (0..6).map(|_| normal(0.5)).collect();
    Rows::new(8, 6, 3, |i, j, t| {
        let parts = [state[i as usize], step[(3 * i + t) as usize], distractor[j as usize], normal(0.3)];
        (0..3).map(|dim| parts.iter().map(|part| part[dim]).sum::<f32>()).collect()
    })
}

/// The denoising factor and both retrievals of a grid.
fn measured(rows: &Rows, k: usize) -> [Interval; 3] {
    let grid = Grid::new(rows.table()).unwrap();
    let options = RetrievalOptions { k, tolerance: 0, ..RetrievalOptions::default() };
    [
        denoising_factor(&grid).unwrap(),
        retrieval_same_step(&grid, k, &mut generator(0)).unwrap().found,
        retrieval_any_step(&grid, options, &mut generator(0)).unwrap().found,
    ]
}

/// Where anchors or queries alone are drawn again and what they are compared with stays, about 240 of 400 intervals hold the factor, and 330 the retrievals.
#[test]
fn intervals_of_distances_and_neighbours_hold_what_they_say() {
    let mut rng = generator(11);
    let grids: Vec<[Interval; 3]> = (0..400).map(|_| measured(&drawn(&mut rng), 3)).collect();
    for (at, name) in ["denoising_factor", "retrieval_same_step@3", "retrieval_any_step@3"].into_iter().enumerate() {
        let of = || grids.iter().map(move |grid| grid[at]);
        let truth = of().map(|interval| interval.estimate).sum::<f64>() / 400.0;
        let held = of().filter(|interval| interval.low <= truth && truth <= interval.high).count();
        assert!(held >= 360, "{name}: {held} of 400 hold {truth}");
        assert!(of().all(|own| own.low <= own.estimate && own.estimate <= own.high), "{name}");
        // They err to the wide side, and still say something.
        let width = of().map(|interval| interval.high - interval.low).sum::<f64>() / 400.0;
        assert!(width < 0.7, "{name}: {width}");
    }
}

#[test]
fn the_factor_without_a_trajectory_is_that_of_the_grid_without_it() {
    let left = |is_out: &dyn Fn(Option<u32>, Option<u32>) -> bool| {
        let mut rows = drawn(&mut generator(12));
        for row in 0..rows.state.len() {
            if is_out(rows.state[row], rows.distractor[row]) {
                rows.state[row] = None;
            }
        }
        denoising_factor(&Grid::new(rows.table()).unwrap()).unwrap()
    };
    let by_state: Vec<f64> = (0..8).map(|out| left(&|state, _| state == Some(out)).estimate).collect();
    let by_distractor: Vec<f64> = (0..6).map(|out| left(&|_, distractor| distractor == Some(out)).estimate).collect();
    let found = left(&|_, _| false);
    let wanted = crossed(found.estimate, [&by_state, &by_distractor], Range::Signed);
    assert!((found.low - wanted.low).abs() < 1e-9 && (found.high - wanted.high).abs() < 1e-9, "{found:?}, {wanted:?}");
    assert!(found.low < found.estimate && found.estimate < found.high, "{found:?}");
}

#[test]
fn two_of_a_kind_say_nothing_of_others() {
    for (states, distractors) in [(2, 4), (4, 2)] {
        let rows = Rows::new(states, distractors, 4, |i, j, t| vec![i as f32 + 0.1 * j as f32, t as f32]);
        for found in measured(&rows, 1) {
            assert!(found.estimate.is_finite() && found.low.is_nan() && found.high.is_nan(), "{found:?}");
        }
    }
}

/// Without one of three states, five other cells are left at a step: five neighbours are all of them.
#[test]
fn neighbours_that_are_all_that_is_left_say_nothing_of_others() {
    let mut rng = generator(13);
    let rows = Rows::new(3, 3, 4, |_, _, _| (0..2).map(|_| rng.random_range(-1.0..1.0)).collect());
    let grid = Grid::new(rows.table()).unwrap();
    let found = |k: usize| retrieval_same_step(&grid, k, &mut generator(0)).unwrap().found;
    assert!(found(4).low.is_finite() && found(4).high.is_finite());
    assert!(found(5).estimate.is_finite() && found(5).low.is_nan() && found(5).high.is_nan());
}

/// Where all queries find their state whatever is left out, nothing was seen that an interval could be made of.
#[test]
fn latents_without_distractors_are_certain() {
    let rows = Rows::new(4, 4, 4, |i, _, t| vec![(10 * i) as f32, t as f32]);
    for found in measured(&rows, 1) {
        assert_eq!((found.low, found.estimate, found.high), (1.0, 1.0, 1.0));
    }
}
