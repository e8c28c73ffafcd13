//! What found and made rotations tell of latents that are symmetric, that are not, and that know the distance alone.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Match, Matches, ReacherState, Symmetry, SymmetryOptions, alike, matches, rotated_pairs, symmetry};
use crate::intervals::{Interval, Range, crossed, jackknife};
use crate::{Error, Table};

/// One number of a comparison.
type Number = fn(&Symmetry) -> Interval;

/// Episodes 0 to 19 hold random states, 20 to 39 the same turned by 2 radians.
fn states() -> Vec<ReacherState> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut random = |_| {
        let mut draw = |scale: f64| rng.random_range(-scale..scale);
        ReacherState { joints: [draw(3.0), draw(2.0)], target: [draw(0.2), draw(0.2)] }
    };
    let plain: Vec<ReacherState> = (0..400).map(&mut random).collect();
    let (sin, cos) = 2.0_f64.sin_cos();
    let turn = |state: &ReacherState| {
        let [x, y] = state.target;
        ReacherState {
            joints: [state.joints[0] + 2.0, state.joints[1]],
            target: [cos * x - sin * y, sin * x + cos * y],
        }
    };
    let turned: Vec<ReacherState> = plain.iter().map(turn).collect();
    [plain, turned].concat()
}

#[test]
fn an_invariant_latent_is_symmetric_and_an_absolute_one_is_not() {
    let states = states();
    let episode: Vec<u32> = (0..800).map(|row| row / 20).collect();
    let step: Vec<u32> = (0..800).map(|row| row % 20).collect();
    let invariant: Vec<f32> = states.iter().flat_map(|state| state.in_arm_frame()).collect();
    let absolute: Vec<f32> = states
        .iter()
        .flat_map(|state| {
            [state.joints[0].cos() as f32, state.joints[0].sin() as f32, state.target[0] as f32, state.target[1] as f32]
        })
        .collect();
    // Without a scale of its own, the absolute latent is as far apart as its picture.
    let metric = crate::neighbours::Metric::Euclidean;
    let options = SymmetryOptions { tolerance: 1e-6, metric, ..SymmetryOptions::default() };
    let picture = |a: usize, b: usize| {
        (0..4).map(|dim| f64::from(absolute[a * 4 + dim] - absolute[b * 4 + dim]).powi(2)).sum::<f64>().sqrt()
    };
    let run = |dims: usize, values: &[f32]| {
        let table = Table::new(dims, values, &episode, &step).unwrap();
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let pairs = rotated_pairs(&table, &states, options, rng).unwrap();
        assert_eq!(pairs.len(), 500);
        assert!(pairs.iter().all(|&(a, b)| a.abs_diff(b) == 400));
        let drawn = matches(&table, &states, &pairs, picture, options, rng).unwrap();
        symmetry(&table, &drawn, options).unwrap()
    };
    let symmetric = run(4, &invariant);
    assert!(symmetric.ratio.high < 1e-5 && symmetric.percentile.estimate == 1.0, "{:?}", symmetric.ratio);
    assert_eq!(symmetric.percentile_equal_distance.estimate, 1.0);
    let absolute = run(4, &absolute);
    assert!((absolute.ratio.estimate - 1.0).abs() < 0.1, "{:?}", absolute.ratio);
    assert!((absolute.percentile.estimate - 0.5).abs() < 0.1, "{:?}", absolute.percentile);
    // The distance alone looks symmetric to the ratio, and is found out among rows of equal distance.
    let distance = run(1, &ReacherState::distance_table(&states));
    assert_eq!((distance.ratio.estimate, distance.percentile_equal_distance.estimate), (0.0, 0.5));
    let table = Table::new(4, &invariant, &episode, &step).unwrap();
    let none = SymmetryOptions { turn: 4.0, ..options };
    let refused = rotated_pairs(&table, &states, none, &mut ChaCha8Rng::seed_from_u64(1));
    assert!(matches!(refused, Err(Error::NoRotations { .. })));
}

/// A grid of 3 states under 4 distractors, 5 steps each, and after it the same turned: latents that are the state and the step and nothing else.
#[test]
fn on_a_grid_the_percentile_of_the_best_latents_falls_short_by_half_the_share_of_their_own_state() {
    let (cells, distractors, steps) = (12, 4, 5);
    let own = cells * steps;
    let shown = |row: usize| row / steps % cells / distractors * steps + row % steps;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let plain = states();
    let state = |row: usize| {
        let ReacherState { joints: [shoulder, wrist], target: [x, y] } = plain[shown(row)];
        let turned = ReacherState { joints: [shoulder + std::f64::consts::FRAC_PI_2, wrist], target: [-y, x] };
        if row < own { plain[shown(row)] } else { turned }
    };
    let states: Vec<ReacherState> = (0..2 * own).map(state).collect();
    let latents: Vec<f32> = (0..2 * own).map(|row| shown(row) as f32).collect();
    let (episode, step): (Vec<u32>, Vec<u32>) =
        (0..2 * own).map(|row| ((row / steps) as u32, (row % steps) as u32)).unzip();
    let table = Table::new(1, &latents, &episode, &step).unwrap();
    let pairs: Vec<(usize, usize)> = (0..own).map(|row| (row, row + own)).collect();
    let pictures: Vec<f64> = (0..4 * own * own).map(|_| rng.random_range(0.0..1.0)).collect();
    let picture = |a: usize, b: usize| pictures[2 * own * a + b];
    let options = SymmetryOptions::default();
    let drawn = matches(&table, &states, &pairs, picture, options, &mut rng).unwrap();
    let found = symmetry(&table, &drawn, options).unwrap();
    let largest = |row: usize, others: &[usize]| {
        let same = others.iter().filter(|&&other| shown(other) == shown(row)).count();
        1.0 - same as f64 / others.len() as f64 / 2.0
    };
    for (pair, compared) in found.pairs.iter().zip(&drawn.pairs) {
        let alike: Vec<usize> = compared.alike.iter().map(|other| other.0).collect();
        assert!((pair.percentile - largest(pair.row, &alike)).abs() < 1e-12, "{pair:?}");
        let equal = pair.percentile_equal_distance.unwrap();
        assert!((equal - largest(pair.row, &compared.equal)).abs() < 1e-12, "{pair:?}");
    }
    assert_eq!(found.ratio.estimate, 0.0);
    assert!(found.percentile.estimate < 1.0 && found.percentile_equal_distance.estimate < 1.0, "{found:?}");
    // Drawn blindly, 2(M - 1) of 2NMT - T - 1 rows show the state: 6 of 114.
    assert!((found.percentile.estimate - (1.0 - 3.0 / 114.0)).abs() < 0.02, "{:?}", found.percentile);
}

/// The twins are found, and their targets lie up to 14 mm from where the rotation would have them, often in another centimetre of distance.
#[test]
fn what_knows_the_distance_alone_tells_no_found_twin_from_rows_of_its_distance() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut states = states();
    for state in &mut states[400..] {
        state.target = state.target.map(|x| x + rng.random_range(-0.01..0.01_f64));
    }
    let (episode, step): (Vec<u32>, Vec<u32>) = (0..800).map(|row| (row / 20, row % 20)).unzip();
    let distance = ReacherState::distance_table(&states);
    let table = Table::new(1, &distance, &episode, &step).unwrap();
    let options = SymmetryOptions::default();
    let pairs = rotated_pairs(&table, &states, options, &mut rng).unwrap();
    let moved = pairs.iter().filter(|&&(row, twin)| distance[row] != distance[twin]).count();
    assert!(4 * moved > pairs.len(), "{moved} of {}", pairs.len());
    let picture = |a: usize, b: usize| f64::from((distance[a] - distance[b]).abs());
    let drawn = matches(&table, &states, &pairs, picture, options, &mut rng).unwrap();
    let found = symmetry(&table, &drawn, options).unwrap();
    assert_eq!(found.percentile_equal_distance.estimate, 0.5);
    assert!(found.pairs.iter().all(|pair| pair.percentile_equal_distance.is_none_or(|share| share == 0.5)));
    assert!(found.ratio.estimate > 0.0, "a found twin is no exact rotation");
}

/// The numbers of the pairs and of the drawn rows that are left.
fn of_rows(table: &Table<'_>, drawn: &Matches, is_left: &dyn Fn(usize) -> bool) -> Symmetry {
    let options = SymmetryOptions::default();
    let left = |pair: &Match| {
        let images: Vec<(usize, f64)> = pair.images.iter().copied().filter(|image| is_left(image.0)).collect();
        let equal = pair.equal.iter().copied().filter(|&other| is_left(other)).collect();
        Match { alike: alike(images.clone(), pair.image, options.matched), images, equal, ..pair.clone() }
    };
    let pairs = drawn.pairs.iter().filter(|pair| is_left(pair.row)).map(left).collect();
    symmetry(table, &Matches { pairs }, options).unwrap()
}

/// Latents of noise on a grid of 4 states under 3 distractors, 5 steps each, and of the same rows turned.
#[test]
fn the_intervals_leave_out_trajectories_with_their_pairs_and_as_what_others_are_compared_with() {
    let (rows, options, mut rng) = (120, SymmetryOptions::default(), ChaCha8Rng::seed_from_u64(4));
    let latents: Vec<f32> = (0..2 * rows).map(|_| rng.random_range(-1.0..1.0)).collect();
    let (episode, step): (Vec<u32>, Vec<u32>) = (0..rows as u32).map(|row| (row / 5, row % 5)).unzip();
    let state: Vec<Option<u32>> = (0..rows as u32).map(|row| Some(row % 60 / 15)).collect();
    let distractor: Vec<Option<u32>> = (0..rows as u32).map(|row| Some(row / 5 % 3)).collect();
    let table = Table::new(2, &latents, &episode, &step).unwrap().with_grid(&state, &distractor).unwrap();
    let pairs: Vec<(usize, usize)> = (0..rows / 2).map(|row| (row, row + rows / 2)).collect();
    let picture = |a: usize, b: usize| f64::from((latents[a] - latents[b]).abs());
    let drawn = matches(&table, &states()[..rows], &pairs, picture, options, &mut rng).unwrap();
    let found = symmetry(&table, &drawn, options).unwrap();
    let without =
        |kind: usize, out: u32| of_rows(&table, &drawn, &|row| [state[row], distractor[row]][kind] != Some(out));
    let by_state: Vec<Symmetry> = (0..4).map(|out| without(0, out)).collect();
    let by_distractor: Vec<Symmetry> = (0..3).map(|out| without(1, out)).collect();
    let numbers: [(Number, Range); 3] = [
        (|found| found.ratio, Range::Distance),
        (|found| found.percentile, Range::Counted),
        (|found| found.percentile_equal_distance, Range::Counted),
    ];
    for (number, range) in numbers {
        let estimates = |all: &[Symmetry]| all.iter().map(|left| number(left).estimate).collect::<Vec<f64>>();
        let (found, values) = (number(&found), [estimates(&by_state), estimates(&by_distractor)]);
        let wanted = crossed(found.estimate, [&values[0], &values[1]], range);
        assert!(found.low < found.estimate && found.estimate < found.high, "{found:?}");
        let off = (found.low - wanted.low).abs().max((found.high - wanted.high).abs());
        assert!(off < 1e-9, "{found:?} and {wanted:?}");
    }
}

/// 12 episodes of noise on no grid, 5 steps each, and after them the same turned, under numbers of their own.
#[test]
fn a_made_twin_is_left_out_with_its_origin() {
    let (rows, options, mut rng) = (120, SymmetryOptions::default(), ChaCha8Rng::seed_from_u64(5));
    let latents: Vec<f32> = (0..2 * rows).map(|_| rng.random_range(-1.0..1.0)).collect();
    let (episode, step): (Vec<u32>, Vec<u32>) = (0..rows as u32).map(|row| (row / 5, row % 5)).unzip();
    let origin: Vec<u32> = episode.iter().map(|episode| episode % 12).collect();
    let doubled = Table::new(2, &latents, &episode, &step).unwrap();
    let table = doubled.with_origin(&origin).unwrap();
    assert_eq!((doubled.trajectories().counts(), table.trajectories().counts()), ([24, 0], [12, 0]));
    let pairs: Vec<(usize, usize)> = (0..rows / 2).map(|row| (row, row + rows / 2)).collect();
    let picture = |a: usize, b: usize| f64::from((latents[a] - latents[b]).abs());
    let drawn = matches(&table, &states()[..rows], &pairs, picture, options, &mut rng).unwrap();
    let found = symmetry(&table, &drawn, options).unwrap();
    let numbers: [(Number, Range); 2] =
        [(|found| found.ratio, Range::Distance), (|found| found.percentile, Range::Counted)];
    for (number, range) in numbers {
        let without = |out: u32| number(&of_rows(&table, &drawn, &|row| origin[row] != out)).estimate;
        let (found, values) = (number(&found), (0..12).map(without).collect::<Vec<f64>>());
        let wanted = jackknife(found.estimate, &[&values], range);
        let off = (found.low - wanted.low).abs().max((found.high - wanted.high).abs());
        assert!(off < 1e-9, "{found:?} and {wanted:?}");
    }
}
