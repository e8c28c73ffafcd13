use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Fit, HoldOut, Probe, ProbeOptions, ProbeScore, Quantity, Sample, Values, over_chance, probe};
use crate::numbers::probe_numbers;
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
    Quantity { name: name.to_owned(), hold_out: HoldOut::State, values: Values::Numbers(values.collect()) }
}

/// Probes of a table's own trajectories.
fn within(table: &Table<'_>, quantities: &[Quantity], seed: u64) -> Result<Vec<ProbeScore>, Error> {
    probe(Sample { table: *table, quantities }, Fit::HeldOut, ProbeOptions::default(), &mut generator(seed))
}

fn find<'s>(scores: &'s [ProbeScore], quantity: &str, probe: Probe) -> &'s ProbeScore {
    scores.iter().find(|score| score.quantity == quantity && score.probe == probe).unwrap()
}

/// Latents are standardized, so that neither a dimension's unit nor how far it lies from the origin matters.
#[test]
fn a_linear_probe_reads_small_dimensions_beside_large_ones_and_far_ones() {
    let (values, episode, step) = latents();
    let wanted: Vec<f64> = values.chunks_exact(6).map(|row| f64::from(row[0])).collect();
    let side: Vec<u32> = wanted.iter().map(|&x| u32::from(x > 0.0)).collect();
    for (large, far) in [(1.0_f32, 0.0_f32), (1e8, 0.0), (1.0, 3e4)] {
        let moved = |(at, &x): (usize, &f32)| if at % 6 == 0 { x + far } else { x * large + far };
        let moved: Vec<f32> = values.iter().enumerate().map(moved).collect();
        let table = Table::new(6, &moved, &episode, &step).unwrap();
        let classes =
            Quantity { name: "side".to_owned(), hold_out: HoldOut::State, values: Values::Classes(side.clone()) };
        let scores = within(&table, &[numbers("first", wanted.iter().copied()), classes], 3).unwrap();
        for name in ["first", "side"] {
            let found = find(&scores, name, Probe::Linear);
            assert!(found.score.estimate > 0.95, "{large} {far}: {found:?}");
        }
    }
}

/// As of features that are mostly zero: the folds that are fitted on show nothing of it.
#[test]
fn a_dimension_that_moves_in_one_trajectory_alone_spoils_no_probe() {
    for seed in 0..12 {
        let mut rng = generator(seed);
        let mut values: Vec<f32> = (0..400 * 4).map(|_| rng.random_range(-1.0..1.0)).collect();
        for (row, latent) in values.chunks_exact_mut(4).enumerate() {
            latent[3] = if row / 40 == 6 { latent[3] + 0.3 } else { 0.0 };
        }
        let (episode, step): (Vec<u32>, Vec<u32>) = (0..400).map(|row| (row / 40, row % 40)).unzip();
        let table = Table::new(4, &values, &episode, &step).unwrap();
        let wanted = values.chunks_exact(4).map(|row| f64::from(row[0]) - 2.0 * f64::from(row[1]));
        let scores = within(&table, &[numbers("first", wanted)], seed).unwrap();
        let found = find(&scores, "first", Probe::Linear);
        assert!(found.score.estimate > 0.98, "seed {seed}: {found:?}");
    }
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
            hold_out: HoldOut::State,
            values: Values::Classes((0..2000).map(|row| if x(row, 3) > 0.4 { 9 } else { 4 }).collect()),
        },
    ];
    let scores = within(&table, &quantities, 3).unwrap();
    let linear = find(&scores, "linear", Probe::Linear);
    assert!((linear.score.estimate - 12.0 / 13.0).abs() < 0.015, "{linear:?}");
    assert!(linear.score.low < linear.score.estimate && linear.score.estimate < linear.score.high);
    assert!(linear.shuffled.estimate < 0.02 && linear.groups == 40);
    assert!(find(&scores, "square", Probe::Linear).score.estimate < 0.05);
    assert!(find(&scores, "square", Probe::Knn).score.estimate > 0.3);
    assert!(find(&scores, "elsewhere", Probe::Linear).score.estimate < 0.02);
    assert!(find(&scores, "elsewhere", Probe::Knn).score.estimate < 0.02);
    let side = find(&scores, "side", Probe::Linear);
    assert!((side.chance - 0.7).abs() < 0.04 && side.score.estimate > 0.85, "{side:?}");
    assert!(side.shuffled.estimate < side.chance + 0.03);
    assert_eq!(side.measure, "accuracy");
}

/// Latents of a collapsed encoder may vary by less than a millionth; what they hold is read all the same.
#[test]
fn probes_do_not_ask_for_the_latents_unit() {
    let (values, episode, step) = latents();
    let small: Vec<f32> = values.iter().map(|value| value * 1e-8).collect();
    let side = Quantity {
        name: "side".to_owned(),
        hold_out: HoldOut::State,
        values: Values::Classes((0..2000).map(|row| u32::from(values[row * 6 + 3] > 0.4)).collect()),
    };
    let quantities = [numbers("linear", (0..2000).map(|row| f64::from(values[row * 6]))), side];
    let [large, small] = [&values, &small].map(|values| {
        let table = Table::new(6, values, &episode, &step).unwrap();
        let scores = within(&table, &quantities, 3).unwrap();
        ["linear", "side"].map(|name| find(&scores, name, Probe::Linear).score.estimate)
    });
    assert!(large.iter().zip(small).all(|(large, small)| (large - small).abs() < 1e-3), "{large:?} {small:?}");
    assert!(small[0] > 0.99 && small[1] > 0.8, "{small:?}");
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
    for score in within(&table, &quantities, 0).unwrap() {
        assert!(score.score.estimate < 0.3, "{score:?}");
    }
    // The same rows as a grid of 4 states: episodes 0-9 are cells of one state, and are held out together.
    let state: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode / 10)).collect();
    let distractor: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode % 10)).collect();
    let grid = table.with_grid(&state, &distractor).unwrap();
    let groups = |hold_out| {
        let quantities = [Quantity { hold_out, ..quantities[0].clone() }];
        within(&grid, &quantities, 0).unwrap()[0].groups
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
        pool.install(|| within(&table, &quantities, 7).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn refuses_what_it_cannot_judge() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let run = |quantity| within(&table, &[quantity], 0);
    let short = run(numbers("short", (0..10).map(f64::from)));
    assert!(matches!(short, Err(Error::Length { expected: 2000, found: 10, .. })));
    let hole = run(numbers("hole", (0..2000).map(|row| if row == 60 { f64::NAN } else { 0.0 })));
    assert!(matches!(hole, Err(Error::QuantityNotFinite { episode: 1, step: 10, .. })));
    let step = numbers("step", (0..2000).map(f64::from));
    let no_grid = run(Quantity { hold_out: HoldOut::Distractor, ..step.clone() });
    assert!(matches!(no_grid, Err(Error::NoGrid)));
    let one = Table::new(6, &values, &[0; 2000], &[0; 2000]).unwrap();
    let refused = within(&one, std::slice::from_ref(&step), 0);
    assert!(matches!(refused, Err(Error::TooFewRows { found: 1, .. })));
    let narrow = Table::new(3, &values[..6000], &episode, &[0; 2000]).unwrap();
    let to_fit = Fit::On(Sample { table: narrow, quantities: std::slice::from_ref(&step) });
    let judged = Sample { table, quantities: std::slice::from_ref(&step) };
    let other = probe(judged, to_fit, ProbeOptions::default(), &mut generator(0));
    assert!(matches!(other, Err(Error::Length { expected: 6, found: 3, .. })));
}

/// Three state trajectories are too few to fit 24 dimensions on, and many of another recording are not: the same quantity in the same latents.
#[test]
fn a_small_grid_is_read_by_probes_fitted_on_another_recording() {
    let mut rng = generator(11);
    let mut draw = |groups: u32| {
        // Each trajectory stays near a place of its own, so that three trajectories span few directions.
        let mut values = Vec::new();
        for _ in 0..groups {
            let home: [f32; 24] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            for _ in 0..20 {
                values.extend(home.map(|x| x + 0.05 * rng.random_range(-1.0..1.0_f32)));
            }
        }
        let rows = groups * 20;
        let sum = |row: &[f32]| row[..6].iter().map(|&x| f64::from(x)).sum::<f64>();
        let quantity = numbers("sum", values.chunks_exact(24).map(sum).collect::<Vec<_>>().into_iter());
        (
            values,
            (0..rows).map(|row| row / 20).collect::<Vec<u32>>(),
            (0..rows).map(|row| row % 20).collect(),
            [quantity],
        )
    };
    let ((a, episodes, steps, own), (b, other_episodes, other_steps, theirs)): (
        (_, _, Vec<u32>, _),
        (_, _, Vec<u32>, _),
    ) = (draw(3), draw(80));
    let judged = Sample { table: Table::new(24, &a, &episodes, &steps).unwrap(), quantities: &own };
    let other = Sample { table: Table::new(24, &b, &other_episodes, &other_steps).unwrap(), quantities: &theirs };
    let score = |fit| {
        let scores = probe(judged, fit, ProbeOptions::default(), &mut generator(0)).unwrap();
        (find(&scores, "sum", Probe::Linear).score, find(&scores, "sum", Probe::Linear).shuffled)
    };
    let (alone, (elsewhere, shuffled)) = (score(Fit::HeldOut).0, score(Fit::On(other)));
    assert!(elsewhere.estimate > 0.99 && alone.estimate < 0.5, "{elsewhere:?} {alone:?}");
    assert!(shuffled.estimate < 0.5, "{shuffled:?}");
}

/// Which of three classes, by clouds of known overlap: two standard normal clouds at ±1 along a line are told apart 84% of the time.
#[test]
fn the_logistic_probe_reaches_the_best_possible_accuracy() {
    let mut rng = generator(12);
    let mut normal = || (0..12).map(|_| rng.random_range(-0.5..0.5_f32)).sum::<f32>();
    let class = |row: u32| row.wrapping_mul(2_654_435_761) >> 31;
    let values: Vec<f32> =
        (0..6000).flat_map(|row| [normal() + 2.0 * class(row) as f32 - 1.0, 5.0 * normal()]).collect();
    let (episode, step): (Vec<u32>, Vec<u32>) = (0..6000).map(|row| (row / 100, row % 100)).unzip();
    let side = Quantity {
        name: "side".to_owned(),
        hold_out: HoldOut::State,
        values: Values::Classes((0..6000).map(class).collect()),
    };
    let table = Table::new(2, &values, &episode, &step).unwrap();
    let scores = within(&table, &[side], 1).unwrap();
    let linear = find(&scores, "side", Probe::Linear);
    assert!((linear.score.estimate - 0.8413).abs() < 0.015, "{linear:?}");
    assert!(linear.score.low < 0.8413 && linear.score.high > 0.8413, "{linear:?}");
    assert!((linear.shuffled.estimate - 0.5).abs() < 0.1, "{linear:?}");
}

/// Ridge of one feature with one trajectory a part: the fit is the formula `b = cov / (var + λ)`, on the latent as it is.
#[test]
fn ridge_of_a_noiseless_line_is_exact() {
    let values: Vec<f32> = (0..400).map(|row| (row % 37) as f32 / 7.0 + 100.0).collect();
    let (episode, step): (Vec<u32>, Vec<u32>) = (0..400).map(|row| (row / 20, row % 20)).unzip();
    let line = numbers("line", values.clone().into_iter().map(|x| 3.0 * f64::from(x) - 2.0));
    let table = Table::new(1, &values, &episode, &step).unwrap();
    let scores = within(&table, &[line], 0).unwrap();
    assert!(find(&scores, "line", Probe::Linear).score.estimate > 1.0 - 1e-9);
}

/// Numbers that were fitted differently never share a name, and classes are judged within the table whatever numbers are fitted on.
#[test]
fn a_name_says_what_the_probe_was_fitted_on() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let side = Values::Classes(values.chunks_exact(6).map(|x| u32::from(x[1] > 0.0)).collect());
    let quantities = [
        numbers("first", values.chunks_exact(6).map(|x| f64::from(x[0]))),
        Quantity { name: "side".to_owned(), hold_out: HoldOut::State, values: side },
    ];
    let sample = Sample { table, quantities: &quantities };
    let names = |fit| {
        let scores = probe(sample, fit, ProbeOptions::default(), &mut generator(3)).unwrap();
        probe_numbers("s", &scores, None).iter().map(|number| number.name.clone()).collect::<Vec<_>>()
    };
    let [side, side_knn] = ["probe_cross_validated/side/s", "probe_knn_cross_validated/side/s"];
    assert_eq!(names(Fit::On(sample)), ["probe/first/s", side, "probe_knn/first/s", side_knn]);
    let [first, first_knn] = ["probe_cross_validated/first/s", "probe_knn_cross_validated/first/s"];
    assert_eq!(names(Fit::HeldOut), [first, side, first_knn, side_knn]);
}

#[test]
fn chance_is_0_and_everything_is_1() {
    assert_eq!([0.5, 1.0, 0.75].map(|accuracy| over_chance(accuracy, 0.5)), [0.0, 1.0, 0.5]);
    assert_eq!([0.0, 0.25, -3.0].map(|r_squared| over_chance(r_squared, 0.0)), [0.0, 0.25, -3.0]);
}

#[test]
fn how_far_from_0_a_quantity_lies_does_not_matter() {
    let (values, episode, step) = latents();
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let of = |far: f64| {
        let read = (0..2000).map(|row| f64::from(values[row * 6]) + far);
        let unread = (0..2000).map(|row| f64::from(values[(row * 7 + 3) % 2000 * 6]) * 7.0 + far);
        [numbers("read", read), numbers("unread", unread)]
    };
    let (near, far) = (of(0.0), of(1.7e9));
    let (scores, moved) = (within(&table, &near, 3).unwrap(), within(&table, &far, 3).unwrap());
    let elsewhere = |quantities: &[Quantity]| {
        let sample = Sample { table, quantities };
        probe(sample, Fit::On(sample), ProbeOptions::default(), &mut generator(3)).unwrap()
    };
    for (a, b) in scores.iter().zip(&moved).chain(elsewhere(&near).iter().zip(&elsewhere(&far))) {
        assert!((a.score.estimate - b.score.estimate).abs() < 1e-4, "{a:?} {b:?}");
        assert!((a.shuffled.estimate - b.shuffled.estimate).abs() < 1e-4, "{a:?} {b:?}");
    }
    assert!(find(&moved, "unread", Probe::Linear).score.estimate < 0.05);
}

/// A grid of 6 states under 5 distractors whose latents say which distractor a row is under, and no more.
struct Videos {
    values: Vec<f32>,
    episode: Vec<u32>,
    step: Vec<u32>,
    state: Vec<Option<u32>>,
    distractor: Vec<Option<u32>>,
    /// Of each row.
    video: Vec<u32>,
}

impl Videos {
    fn new() -> Self {
        let (states, distractors, steps) = (6_u32, 5_u32, 12_u32);
        let rows = states * distractors * steps;
        let mut rng = generator(4);
        let values = (0..rows)
            .flat_map(|row| (0..distractors).map(move |dim| f32::from(u8::from(dim == row / steps % distractors))))
            .map(|x| x + rng.random_range(-0.1..0.1))
            .collect();
        let keys = |of: &dyn Fn(u32) -> u32| (0..rows).map(of).collect::<Vec<u32>>();
        let some = |of: &dyn Fn(u32) -> u32| (0..rows).map(|row| Some(of(row))).collect::<Vec<_>>();
        Self {
            values,
            episode: keys(&|row| row / steps),
            step: keys(&|row| row % steps),
            state: some(&|row| row / (distractors * steps)),
            distractor: some(&|row| row / steps % distractors),
            video: keys(&|row| row / steps % distractors),
        }
    }

    fn table(&self) -> Table<'_> {
        let table = Table::new(5, &self.values, &self.episode, &self.step).unwrap();
        table.with_grid(&self.state, &self.distractor).unwrap()
    }
}

#[test]
fn shuffled_quantities_of_a_distractor_are_not_its_own() {
    let rows = Videos::new();
    let (table, video) = (rows.table(), &rows.video);
    let shown = Quantity { name: "video".to_owned(), hold_out: HoldOut::State, values: Values::Classes(video.clone()) };
    let frame = Quantity {
        name: "frame".to_owned(),
        hold_out: HoldOut::Distractor,
        values: Values::Numbers(video.iter().map(|&video| f64::from(video)).collect()),
    };
    let scores = within(&table, &[shown], 5).unwrap();
    let sample = Sample { table, quantities: std::slice::from_ref(&frame) };
    let elsewhere = probe(sample, Fit::On(sample), ProbeOptions::default(), &mut generator(5)).unwrap();
    for score in scores.iter().chain(&elsewhere) {
        assert!(score.score.estimate > 0.95 && score.shuffled.estimate < 0.6, "{score:?}");
    }
}

/// A column of a user's may be the distractor's, and is held out by state: another state's cells hold the same values in the same order.
#[test]
fn shuffled_columns_of_unknown_origin_are_not_their_own() {
    let rows = Videos::new();
    let column = Quantity {
        hold_out: HoldOut::StateOfUnknown,
        ..numbers("column", rows.video.iter().map(|&video| f64::from(video)))
    };
    let sample = Sample { table: rows.table(), quantities: std::slice::from_ref(&column) };
    for fit in [Fit::HeldOut, Fit::On(sample)] {
        for score in probe(sample, fit, ProbeOptions::default(), &mut generator(5)).unwrap() {
            assert!(score.score.estimate > 0.95 && score.shuffled.estimate < 0.6, "{score:?}");
        }
    }
}

/// As golden tests and tables of other runs need it: what is asked for beside them changes no number of the others.
#[test]
fn a_column_of_a_users_changes_no_number_of_other_quantities() {
    let rows = Videos::new();
    let step = numbers("step", rows.step.iter().map(|&step| f64::from(step)));
    let frame = Quantity {
        hold_out: HoldOut::Distractor,
        ..numbers("frame", rows.video.iter().map(|&video| f64::from(video)))
    };
    let column = Quantity { name: "column".to_owned(), hold_out: HoldOut::StateOfUnknown, ..step.clone() };
    let alone = within(&rows.table(), &[step.clone(), frame.clone()], 2).unwrap();
    let beside = within(&rows.table(), &[column, step, frame], 2).unwrap();
    for score in &alone {
        assert_eq!(find(&beside, &score.quantity, score.probe), score);
    }
}
