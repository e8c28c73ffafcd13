use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Grid, RetrievalOptions, VarianceSplit, denoising_factor, retrieval_any_step, retrieval_same_step, variance,
};
use crate::numbers::{GridOptions, grid_numbers};
use crate::{Error, Table};

mod intervals;

/// Rows of a grid whose latent is `latent(state, distractor, step)`.
struct Rows {
    dims: usize,
    values: Vec<f32>,
    episode: Vec<u32>,
    step: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
}

impl Rows {
    fn new(states: u32, distractors: u32, steps: u32, mut latent: impl FnMut(u32, u32, u32) -> Vec<f32>) -> Self {
        let mut rows =
            Self { dims: 0, values: vec![], episode: vec![], step: vec![], state: vec![], distractor: vec![] };
        for (i, j, t) in
            (0..states).flat_map(|i| (0..distractors).flat_map(move |j| (0..steps).map(move |t| (i, j, t))))
        {
            let latent = latent(i, j, t);
            rows.dims = latent.len();
            rows.values.extend(latent);
            rows.episode.push(i * distractors + j);
            rows.step.push(t);
            rows.state.push(Some(i));
            rows.distractor.push(Some(j));
        }
        rows
    }

    fn table(&self) -> Table<'_> {
        let table = Table::new(self.dims, &self.values, &self.episode, &self.step).unwrap();
        table.with_grid(&self.state, &self.distractor).unwrap()
    }
}

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// As the latents of past actions are where every state has the same: what sums leave of no difference is rounding, and its shares would be of anything.
#[test]
fn latents_that_differ_between_steps_alone_have_no_shares() {
    for (states, distractors) in [(3, 7), (4, 4), (5, 3)] {
        let rows = Rows::new(states, distractors, 9, |_, _, t| vec![0.1 + t as f32 / 7.0, -0.7 * t as f32]);
        let error = variance(&Grid::new(rows.table()).unwrap()).unwrap_err();
        assert!(
            matches!(error, Error::AlikeAtEveryStep { cells } if cells == (states * distractors) as usize),
            "{error}"
        );
        // As a control they are none, and what they would have stood beside is there.
        let latents = Rows::new(states, distractors, 9, |i, j, t| vec![i as f32 + 0.1 * j as f32, t as f32]);
        let (latents, control) = (Grid::new(latents.table()).unwrap(), Grid::new(rows.table()).unwrap());
        let numbers = grid_numbers(&latents, Some(&control), &GridOptions::default()).unwrap();
        let share = numbers.get("state_share").unwrap();
        assert!(share.value.estimate > 0.9 && share.past_actions.is_none(), "{share:?}");
    }
}

/// In a unit that single precision has exactly and in one of which the sums leave rounding. Where steps lie says nothing about it.
#[test]
fn shares_that_rest_on_one_trajectory_have_no_interval() {
    for unit in [1.0, 0.1] {
        let of_state = |i: u32| if i == 0 { unit } else { 0.0 };
        let rows = Rows::new(4, 4, 3, |i, _, _| vec![of_state(i), 0.7]);
        let split = variance(&Grid::new(rows.table()).unwrap()).unwrap();
        assert!((split.state.estimate - 1.0).abs() < 1e-9, "{split:?}");
        for share in [split.state, split.distractor, split.interaction, split.within_state] {
            assert!(share.low.is_nan() && share.high.is_nan(), "{unit}: {share:?}");
        }
        let rows = Rows::new(5, 7, 3, |i, j, t| vec![of_state(j), 0.01 * of_state(i) * of_state(j), 300.0 * t as f32]);
        let split = variance(&Grid::new(rows.table()).unwrap()).unwrap();
        assert!(split.distractor.estimate > 0.9 && split.distractor.low.is_nan(), "{unit}: {split:?}");
    }
}

/// Effects of known size: the state moves the first dimension by ±2, the distractor the second by ±1, their product the third by ±0.5.
#[test]
fn the_split_of_known_effects_is_the_known_split() {
    let sign = |x: u32| if x.is_multiple_of(2) { -1.0 } else { 1.0 };
    let rows =
        Rows::new(4, 6, 3, |i, j, t| vec![2.0 * sign(i) + 100.0, sign(j) - 7.0 * t as f32, 0.5 * sign(i) * sign(j)]);
    let grid = Grid::new(rows.table()).unwrap();
    let split = variance(&grid).unwrap();
    let total = 4.0 + 1.0 + 0.25;
    for (share, expected) in
        [(split.state, 4.0 / total), (split.distractor, 1.0 / total), (split.interaction, 0.25 / total)]
    {
        assert!((share.estimate - expected).abs() < 1e-6, "{share:?} {expected}");
        assert!(share.low <= share.estimate + 1e-9 && share.estimate <= share.high + 1e-9, "{share:?}");
    }
    // The step moves the second dimension by -7 t: variance 49 · 2/3 over the steps.
    let expected = 1.25 / (total + 49.0 * 2.0 / 3.0);
    assert!((split.within_state.estimate - expected).abs() < 1e-6, "{:?} {expected}", split.within_state);
    assert_eq!(split.by_step.len(), 3);
    assert!(split.by_step.iter().all(|step| (step.state - 4.0 / total).abs() < 1e-6));
}

/// Grids drawn from one model again and again: 95% intervals hold its expected shares about 95% of the time, and always the estimate.
#[test]
fn intervals_of_the_split_hold_what_they_say() {
    let mut rng = generator(5);
    let mut normal = || (0..12).map(|_| rng.random_range(-0.5..0.5_f32)).sum::<f32>();
    let (n, m) = (8, 6);
    let splits: Vec<_> = (0..300)
        .map(|_| {
            let state: Vec<[f32; 3]> = (0..n).map(|_| [(); 3].map(|()| 1.0 * normal())).collect();
            let distractor: Vec<[f32; 3]> = (0..m).map(|_| [(); 3].map(|()| 0.7 * normal())).collect();
            let rows = Rows::new(n, m, 2, |i, j, _| {
                (0..3).map(|d| state[i as usize][d] + distractor[j as usize][d] + 0.5 * normal()).collect()
            });
            variance(&Grid::new(rows.table()).unwrap()).unwrap()
        })
        .collect();
    for of in [|s: &VarianceSplit| s.state, |s: &VarianceSplit| s.distractor, |s: &VarianceSplit| s.interaction] {
        let truth = splits.iter().map(|split| of(split).estimate).sum::<f64>() / 300.0;
        let held = splits.iter().filter(|split| of(split).low <= truth && truth <= of(split).high).count();
        assert!((270..=299).contains(&held), "{held} of 300 hold {truth}");
        let own = |split: &&VarianceSplit| of(split).low <= of(split).estimate && of(split).estimate <= of(split).high;
        assert_eq!(splits.iter().filter(own).count(), 300);
    }
    let small = Rows::new(2, 4, 2, |i, j, t| vec![(i * j) as f32, t as f32 + j as f32]);
    assert!(
        variance(&Grid::new(small.table()).unwrap()).unwrap().state.low.is_nan(),
        "two states say nothing of others"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    /// The sums of squares, written down as the formula says.
    #[test]
    fn the_split_is_the_formula(seed in any::<u64>(), states in 2_u32..5, distractors in 2_u32..5) {
        let mut rng = generator(seed);
        let rows = Rows::new(states, distractors, 2, |_, _, _| (0..3).map(|_| rng.random_range(-1.0..1.0)).collect());
        let split = variance(&Grid::new(rows.table()).unwrap()).unwrap();
        let (n, m) = (states as usize, distractors as usize);
        let z = |i: usize, j: usize, t: usize, d: usize| f64::from(rows.values[((i * m + j) * 2 + t) * 3 + d]);
        let (mut state, mut distractor, mut interaction) = (0.0, 0.0, 0.0);
        for (t, d) in (0..2).flat_map(|t| (0..3).map(move |d| (t, d))) {
            let of_state = |i: usize| (0..m).map(|j| z(i, j, t, d)).sum::<f64>() / m as f64;
            let of_distractor = |j: usize| (0..n).map(|i| z(i, j, t, d)).sum::<f64>() / n as f64;
            let mean = (0..n).map(of_state).sum::<f64>() / n as f64;
            state += (0..n).map(|i| (of_state(i) - mean).powi(2)).sum::<f64>() * m as f64;
            distractor += (0..m).map(|j| (of_distractor(j) - mean).powi(2)).sum::<f64>() * n as f64;
            interaction += (0..n).flat_map(|i| (0..m).map(move |j| (i, j)))
                .map(|(i, j)| (z(i, j, t, d) - of_state(i) - of_distractor(j) + mean).powi(2)).sum::<f64>();
        }
        let total = state + distractor + interaction;
        prop_assert!((split.state.estimate - state / total).abs() < 1e-6);
        prop_assert!((split.distractor.estimate - distractor / total).abs() < 1e-6);
        prop_assert!((split.interaction.estimate - interaction / total).abs() < 1e-6);
    }
}

#[test]
fn retrieval_is_certain_for_invariant_latents_and_blind_for_noise() {
    let state_only = Rows::new(5, 4, 30, |i, j, t| vec![(7 * i) as f32 + 1e-3 * j as f32, t as f32]);
    let grid = Grid::new(state_only.table()).unwrap();
    let options = RetrievalOptions { tolerance: 0, ..RetrievalOptions::default() };
    let found = retrieval_any_step(&grid, options, &mut generator(0)).unwrap();
    assert_eq!((found.found.estimate, found.queries), (1.0, 600));
    assert!((found.chance - 3.0 / (3.0 * 30.0 * 5.0)).abs() < 1e-12);
    let found = retrieval_same_step(&grid, 1, &mut generator(0)).unwrap();
    assert_eq!((found.found.estimate, found.queries), (1.0, 600));
    assert!((found.chance - 3.0 / 19.0).abs() < 1e-12);

    let mut rng = generator(3);
    let noise = Rows::new(5, 4, 100, |_, _, _| (0..4).map(|_| rng.random_range(-1.0..1.0)).collect());
    let grid = Grid::new(noise.table()).unwrap();
    let options = RetrievalOptions { k: 5, tolerance: 10, ..options };
    let found = retrieval_any_step(&grid, options, &mut generator(0)).unwrap();
    assert!((found.found.estimate - found.chance).abs() < 0.04, "{found:?}");
    let found = retrieval_same_step(&grid, 3, &mut generator(0)).unwrap();
    assert!((found.found.estimate - found.chance).abs() < 0.04, "{found:?}");

    let distractor_only = Rows::new(5, 4, 30, |i, j, t| vec![(7 * j) as f32 + 1e-3 * i as f32, t as f32]);
    let grid = Grid::new(distractor_only.table()).unwrap();
    assert_eq!(retrieval_same_step(&grid, 1, &mut generator(0)).unwrap().found.estimate, 0.0);
    assert!(matches!(retrieval_same_step(&grid, 20, &mut generator(0)), Err(Error::Option { option: "k", .. })));
}

/// Latents that are invariant under three of four distractors: an interval that draws distractors again must be wide, since a fifth could be of either kind.
#[test]
fn intervals_of_retrieval_know_that_distractors_were_drawn() {
    let mut rng = generator(7);
    let rows = Rows::new(20, 4, 3, |i, j, _| {
        (0..3).map(|d| if j == 3 { rng.random_range(-50.0..50.0) } else { ((7 * i + d) % 40) as f32 }).collect()
    });
    let found = retrieval_same_step(&Grid::new(rows.table()).unwrap(), 1, &mut generator(0)).unwrap().found;
    assert!((found.estimate - 0.75).abs() < 0.06, "{found:?}");
    assert!(found.low < 0.55 && found.high > 0.95, "{found:?}");
}

/// Positions on a line: states 10 apart, distractors 1 apart. Same state: (1 + 1 + 2) / 3 = 4/3 over three distractors. Other states, two of them:
/// the mean of |10 a + b| over a in 1, 1, 2 and b in -2..=2 is 40/3.
#[test]
fn the_denoising_factor_of_known_distances_is_the_formula() {
    let rows = Rows::new(3, 3, 4, |i, j, t| vec![(10 * i + j) as f32, 1000.0 * t as f32]);
    let found = denoising_factor(&Grid::new(rows.table()).unwrap()).unwrap();
    let (same, other) = (4.0 / 3.0, 40.0 / 3.0);
    assert!((found.estimate - (other - same) / (other + same)).abs() < 1e-6, "{found:?}");
    assert!(found.low <= found.estimate && found.estimate <= found.high);
    let invariant = Rows::new(3, 3, 4, |i, _, t| vec![i as f32, t as f32]);
    assert_eq!(denoising_factor(&Grid::new(invariant.table()).unwrap()).unwrap().estimate, 1.0);
    let mut rng = generator(1);
    let noise = Rows::new(6, 6, 40, |_, _, _| (0..3).map(|_| rng.random_range(-1.0..1.0)).collect());
    let of_noise = denoising_factor(&Grid::new(noise.table()).unwrap()).unwrap();
    assert!(of_noise.estimate.abs() < 0.01, "{of_noise:?}");
}

/// `tests/golden/grid.json`: both retrievals and the shares of one grid, by their definitions in float64.
#[test]
fn agrees_with_the_golden_grid() {
    let golden: serde_json::Value = serde_json::from_str(include_str!("../../tests/golden/grid.json")).unwrap();
    let latents = &golden["latents"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let rows = Rows::new(3, 4, 6, |i, j, t| {
        let latent = latents[i as usize][j as usize][t as usize].as_array().unwrap();
        latent.iter().map(|x| number(x) as f32).collect()
    });
    let grid = Grid::new(rows.table()).unwrap();
    let wanted = &golden["retrieval"];
    for k in [1, 3] {
        let same = retrieval_same_step(&grid, k, &mut generator(0)).unwrap();
        let any = retrieval_any_step(&grid, RetrievalOptions { k, ..RetrievalOptions::default() }, &mut generator(0));
        for (found, name) in [(same, "retrieval_same_step"), (any.unwrap(), "retrieval_any_step")] {
            let wanted = number(&wanted[format!("{name}@{k}")]);
            assert!((found.found.estimate - wanted).abs() < 1e-12, "{name}@{k}: {found:?}, {wanted}");
        }
    }
    let chance = retrieval_same_step(&grid, 1, &mut generator(0)).unwrap().chance;
    assert!((chance - number(&wanted["chance_same_step@1"])).abs() < 1e-12);
    let (split, wanted) = (variance(&grid).unwrap(), &golden["shares"]);
    for (share, name) in [(split.state, "state"), (split.distractor, "distractor"), (split.interaction, "interaction")]
    {
        assert!((share.estimate - number(&wanted[name])).abs() < 1e-6, "{name}: {share:?}");
    }
}

#[test]
fn the_answer_does_not_depend_on_the_order_of_rows() {
    let mut rng = generator(1);
    let rows = Rows::new(3, 3, 10, |i, j, _| {
        vec![i as f32 + rng.random_range(0.0..1.0), j as f32 + rng.random_range(0.0..1.0)]
    });
    let mut reversed = Rows::new(0, 0, 0, |_, _, _| vec![]);
    reversed.dims = 2;
    reversed.values = rows.values.chunks_exact(2).rev().flatten().copied().collect();
    reversed.episode = rows.episode.iter().rev().copied().collect();
    reversed.step = rows.step.iter().rev().copied().collect();
    reversed.state = rows.state.iter().rev().copied().collect();
    reversed.distractor = rows.distractor.iter().rev().copied().collect();
    let split = |rows: &Rows| variance(&Grid::new(rows.table()).unwrap()).unwrap();
    assert_eq!(split(&rows), split(&reversed));
}

#[test]
fn holes_are_an_error_or_leave_out_their_states() {
    let full = Rows::new(4, 3, 5, |i, j, t| vec![i as f32, j as f32, t as f32]);
    let mut holed = Rows::new(4, 3, 5, |i, j, t| vec![i as f32, j as f32, t as f32]);
    for row in 0..60 {
        if (holed.state[row], holed.distractor[row]) == (Some(2), Some(1)) {
            holed.state[row] = None;
        }
    }
    assert!(Grid::new(full.table()).is_ok());
    let refused = Grid::new(holed.table());
    assert!(matches!(refused, Err(Error::GridHoles { state: 2, distractor: 1, missing: 1, cells: 12 })));
    let grid = Grid::of_complete_part(holed.table()).unwrap();
    assert_eq!((grid.states(), &grid.dropped().states[..]), (&[0, 1, 3][..], &[2][..]));
    // A cell missing from every state and every distractor: half of each is left.
    let mut diagonal = Rows::new(6, 6, 2, |i, j, t| vec![i as f32, j as f32, t as f32]);
    for row in 0..diagonal.state.len() {
        if diagonal.state[row] == diagonal.distractor[row] {
            diagonal.state[row] = None;
        }
    }
    let grid = Grid::of_complete_part(diagonal.table()).unwrap();
    assert_eq!((grid.states().len(), grid.distractors().len()), (3, 3));
    // One of four cells: a state goes, and what is left is no grid. The error says why there is one state of two.
    let mut square = Rows::new(2, 2, 2, |i, j, t| vec![i as f32, j as f32, t as f32]);
    square.state[7] = None;
    square.state[6] = None;
    let error = Grid::of_complete_part(square.table()).unwrap_err();
    assert!(matches!(error, Error::TooFewRows { needed: 2, found: 1, .. }));
    assert!(error.to_string().contains("a grid with holes: states that are left once none lacks a cell"), "{error}");
    let no_grid = Table::new(3, &full.values, &full.episode, &full.step).unwrap();
    assert!(matches!(Grid::new(no_grid), Err(Error::NoGrid)));
    let row = Rows::new(1, 3, 5, |_, j, t| vec![j as f32, t as f32]);
    assert!(matches!(Grid::new(row.table()), Err(Error::TooFewRows { .. })));
    // Views that lie in no cells, each of them under a distractor of its own: one state would be left out after the other.
    let mut views = Rows::new(300, 3, 1, |i, j, _| vec![i as f32, j as f32]);
    views.distractor = views.episode.iter().copied().map(Some).collect();
    let refused = Grid::of_complete_part(views.table());
    assert!(matches!(refused, Err(Error::TooFewRows { needed: 2, found: 1, .. })));
    let mut twice = Rows::new(2, 2, 5, |i, j, t| vec![i as f32, j as f32, t as f32]);
    twice.step[3] = 2;
    assert!(matches!(Grid::new(twice.table()), Err(Error::RepeatedStep { state: 0, distractor: 0, step: 2 })));
}
