//! What found and made rotations tell of latents that are symmetric, that are not, and that know the distance alone.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{ReacherState, SymmetryOptions, matches, rotated_pairs, symmetry};
use crate::{Error, Table};

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
        symmetry(&table, &drawn, options, rng).unwrap()
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
    let found = symmetry(&table, &drawn, options, &mut rng).unwrap();
    assert_eq!(found.percentile_equal_distance.estimate, 0.5);
    assert!(found.pairs.iter().all(|pair| pair.percentile_equal_distance.is_none_or(|share| share == 0.5)));
    assert!(found.ratio.estimate > 0.0, "a found twin is no exact rotation");
}
