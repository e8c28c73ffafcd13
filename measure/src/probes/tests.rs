use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{HoldOut, Probe, ProbeOptions, ProbeScore, Quantity, Values, probe};
use crate::{Error, Table};

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// 40 episodes of 50 rows of 6 dimensions each, uniform between -1 and 1.
fn latents() -> (Vec<f32>, Vec<u32>, Vec<u32>) {
    let mut rng = generator(1);
    let values = (0..2000 * 6).map(|_| rng.random_range(-1.0..1.0)).collect();
    (values, (0..2000).map(|row| row / 50).collect(), (0..2000).map(|row| row % 50).collect())
}

fn numbers(name: &str, values: impl Iterator<Item = f64>) -> Quantity {
    Quantity { name: name.to_owned(), values: Values::Numbers(values.collect()) }
}

fn find<'s>(scores: &'s [ProbeScore], quantity: &str, probe: Probe) -> &'s ProbeScore {
    scores.iter().find(|score| score.quantity == quantity && score.probe == probe).unwrap()
}

#[test]
fn probes_find_what_is_there_and_nothing_else() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let mut rng = generator(2);
    let x = |row: usize, dim: usize| f64::from(values[row * 6 + dim]);
    // Noise of variance 1/4 · 5/3 · 1/3 beside a signal of variance (1 + 4) / 3: R² = 12/13 at best.
    let noise: Vec<f64> = (0..2000).map(|_| rng.random_range(-1.0..1.0) * (5.0_f64 / 12.0).sqrt()).collect();
    let quantities = [
        numbers("linear", (0..2000).map(|row| 3.0 + x(row, 0) - 2.0 * x(row, 1) + noise[row])),
        numbers("square", (0..2000).map(|row| x(row, 2).powi(2) * 1e6)),
        numbers("elsewhere", (0..2000).map(|_| rng.random_range(-1.0..1.0))),
        Quantity {
            name: "side".to_owned(),
            values: Values::Classes((0..2000).map(|row| if x(row, 3) > 0.4 { 9 } else { 4 }).collect()),
        },
    ];
    let scores = probe(&table, &quantities, ProbeOptions::default(), &mut generator(3)).unwrap();
    let linear = find(&scores, "linear", Probe::Ridge);
    assert!((linear.score.estimate - 12.0 / 13.0).abs() < 0.015, "{linear:?}");
    assert!(linear.score.low < linear.score.estimate && linear.score.estimate < linear.score.high);
    assert!(linear.shuffled.estimate < 0.02 && linear.groups == 40);
    assert!(find(&scores, "square", Probe::Ridge).score.estimate < 0.05);
    assert!(find(&scores, "square", Probe::Knn).score.estimate > 0.3);
    assert!(find(&scores, "elsewhere", Probe::Ridge).score.estimate < 0.02);
    assert!(find(&scores, "elsewhere", Probe::Knn).score.estimate < 0.02);
    let side = find(&scores, "side", Probe::Ridge);
    assert!((side.chance - 0.7).abs() < 0.04 && side.score.estimate > 0.85, "{side:?}");
    assert!(side.shuffled.estimate < side.chance + 0.03);
    assert_eq!(side.measure, "accuracy");
}

/// A quantity that is constant within an episode and follows no rule: only a probe that has seen the episode could know it.
#[test]
fn held_out_trajectories_are_held_out() {
    let mut rng = generator(5);
    let secret: Vec<f64> = (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
    let home: Vec<[f32; 6]> = (0..40).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
    let values: Vec<f32> =
        (0..2000).flat_map(|row| home[row / 50].map(|x| x + 0.01 * (row % 50) as f32 / 50.0)).collect();
    let episode: Vec<u32> = (0..2000).map(|row| row / 50).collect();
    let step: Vec<u32> = (0..2000).map(|row| row % 50).collect();
    let quantities = [numbers("secret", (0..2000).map(|row| secret[row / 50]))];
    let table = Table::new(6, &values, &episode, &step).unwrap();
    for score in probe(&table, &quantities, ProbeOptions::default(), &mut generator(0)).unwrap() {
        assert!(score.score.estimate < 0.3, "{score:?}");
    }
    // The same rows as a grid of 4 states: episodes 0-9 are cells of one state, and are held out together.
    let state: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode / 10)).collect();
    let distractor: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode % 10)).collect();
    let grid = table.with_grid(&state, &distractor).unwrap();
    let groups = |hold_out| {
        probe(&grid, &quantities, ProbeOptions { hold_out, ..ProbeOptions::default() }, &mut generator(0)).unwrap()[0]
            .groups
    };
    assert_eq!([HoldOut::State, HoldOut::Distractor, HoldOut::Episode].map(groups), [4, 10, 40]);
}

#[test]
fn same_seed_same_scores_whatever_the_threads() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let quantities = [numbers("first", values.chunks_exact(6).map(|x| f64::from(x[0])))];
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| probe(&table, &quantities, ProbeOptions::default(), &mut generator(7)).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn refuses_what_it_cannot_judge() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let run = |quantity, options| probe(&table, &[quantity], options, &mut generator(0));
    let short = run(numbers("short", (0..10).map(f64::from)), ProbeOptions::default());
    assert!(matches!(short, Err(Error::Length { expected: 2000, found: 10, .. })));
    let hole =
        run(numbers("hole", (0..2000).map(|row| if row == 60 { f64::NAN } else { 0.0 })), ProbeOptions::default());
    assert!(matches!(hole, Err(Error::QuantityNotFinite { episode: 1, step: 10, .. })));
    let no_grid = ProbeOptions { hold_out: HoldOut::Distractor, ..ProbeOptions::default() };
    assert!(matches!(run(numbers("step", (0..2000).map(f64::from)), no_grid), Err(Error::NoGrid)));
    let one = Table::new(6, &values, &[0; 2000], &step).unwrap();
    let refused = probe(&one, &[], ProbeOptions::default(), &mut generator(0));
    assert!(matches!(refused, Err(Error::TooFewRows { found: 1, .. })));
}
