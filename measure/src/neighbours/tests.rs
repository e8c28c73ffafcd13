use kiddo::{ImmutableKdTree, SquaredEuclidean};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::{Exclude, Metric, Neighbours, Space, graph, nearest, nearest_to};
use crate::{Error, Table};

fn random(rows: usize, dims: usize, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..rows * dims).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn keys(rows: usize, length: usize) -> (Vec<u32>, Vec<u32>) {
    ((0..rows).map(|row| (row / length) as u32).collect(), (0..rows).map(|row| (row % length) as u32).collect())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn neighbours_in_common_count_in_whatever_order_they_come() {
    let found = |rows: [u32; 6]| Neighbours::from_parts(3, rows.to_vec(), vec![0.0; 6]).unwrap();
    let (first, other) = (found([1, 2, 3, 0, 2, 3]), found([3, 1, 4, 5, 6, 0]));
    assert_eq!((first.shared_with(&first), first.shared_with(&other)), (1.0, 0.5));
}

/// `tests/golden/neighbours.json`: rows exactly, distances to rounding.
#[test]
fn agrees_with_the_golden_neighbours() {
    let golden: Value = serde_json::from_str(include_str!("../../tests/golden/neighbours.json")).unwrap();
    let latent: Vec<Vec<f64>> = golden["latent"].as_array().unwrap().iter().map(numbers).collect();
    let dims = latent[0].len();
    let values: Vec<f32> = latent.iter().flatten().map(|&x| x as f32).collect();
    let key = |name: &str| numbers(&golden[name]).iter().map(|&x| x as u32).collect::<Vec<u32>>();
    let (episode, step) = (key("episode"), key("step"));
    let table = Table::new(dims, &values, &episode, &step).unwrap();
    let space = Space::new(table, Metric::Standardized).unwrap();
    let pair = |value: &Value| (value[0].as_u64().unwrap() as u32, value[1].as_u64().unwrap() as u32);
    let golden_queries = golden["queries"].as_array().unwrap();
    let queries: Vec<usize> = golden_queries
        .iter()
        .map(|query| {
            let (episode, step) = pair(&query["query"]);
            table.find(episode, step).unwrap()
        })
        .collect();
    let found = nearest(&space, &queries, golden["k"].as_u64().unwrap() as usize, Exclude::Trajectory).unwrap();
    for (at, query) in golden_queries.iter().enumerate() {
        let expected: Vec<(u32, u32)> = query["neighbours"].as_array().unwrap().iter().map(pair).collect();
        let rows: Vec<(u32, u32)> =
            found.rows(at).iter().map(|&row| (episode[row as usize], step[row as usize])).collect();
        assert_eq!(rows, expected);
        for (distance, expected) in found.distances(at).iter().zip(numbers(&query["distance"])) {
            assert!((distance - expected).abs() < 1e-9, "{distance} {expected}");
        }
    }
}

/// The definition, read off slowly.
fn brute_force(space: &Space<'_>, query: usize, k: usize, admissible: impl Fn(usize) -> bool) -> Vec<(u32, f64)> {
    let mut all: Vec<(f64, u32)> = (0..space.table().rows())
        .filter(|&row| admissible(row))
        .map(|row| (space.distance(query, row), row as u32))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.into_iter().take(k).map(|(distance, row)| (row, distance)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Every metric and exclusion; values on a coarse lattice, so that there are many duplicates and ties, and some latents of length zero.
    #[test]
    fn finds_what_the_definition_finds(seed in any::<u64>(), rows in 40_usize..400, dims in 1_usize..9, offset in 0.0_f32..1e4, zeros in 3_usize..60) {
        let mut values: Vec<f32> = random(rows, dims, seed).iter().map(|x| (x * 4.0).round() + offset).collect();
        values.chunks_exact_mut(dims).step_by(zeros).for_each(|row| row.fill(0.0));
        let (episode, step) = keys(rows, 20);
        let table = Table::new(dims, &values, &episode, &step).unwrap();
        for metric in [Metric::Standardized, Metric::Euclidean, Metric::Cosine] {
            let Ok(space) = Space::new(table, metric) else { continue };
            for exclude in [Exclude::Itself, Exclude::Trajectory] {
                let found = graph(&space, 7, exclude).unwrap();
                for query in (0..rows).step_by(13) {
                    let admissible = |row| if exclude == Exclude::Itself { row != query } else { episode[row] != episode[query] };
                    let expected = brute_force(&space, query, 7, admissible);
                    let got: Vec<(u32, f64)> = found.rows(query).iter().copied().zip(found.distances(query).iter().copied()).collect();
                    prop_assert_eq!(got, expected);
                }
            }
        }
    }
}

#[test]
fn agrees_with_a_kd_tree() {
    let values = random(3000, 3, 5);
    let (episode, step) = keys(3000, 3000);
    let points: Vec<[f32; 3]> = values.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(&points);
    let space = Space::new(Table::new(3, &values, &episode, &step).unwrap(), Metric::Euclidean).unwrap();
    let found = graph(&space, 10, Exclude::Itself).unwrap();
    for (row, point) in points.iter().enumerate() {
        let near = tree.nearest_n::<SquaredEuclidean>(point, std::num::NonZero::new(11).unwrap());
        let rows: Vec<u32> = near[1..].iter().map(|near| near.item as u32).collect();
        assert_eq!(found.rows(row), rows, "row {row}");
    }
}

/// Random points, and points of a coarse lattice, where most distances are equal to others.
#[test]
fn ranks_are_their_definition() {
    let (euclidean, cosine) = (Metric::Euclidean, Metric::Cosine);
    for (rows, dims, step, metric) in
        [(700, 5, 0.0, euclidean), (1500, 2, 0.5, euclidean), (300, 40, 0.0, euclidean), (600, 3, 0.5, cosine)]
    {
        let coarse = |x: f32| if step > 0.0 { (x / step).round() * step } else { x };
        let values: Vec<f32> = random(rows, dims, 7).into_iter().map(coarse).collect();
        let (episode, time) = keys(rows, 10);
        let space = Space::new(Table::new(dims, &values, &episode, &time).unwrap(), metric).unwrap();
        let queries: Vec<usize> = (0..rows).step_by(3).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let wanted = |&query: &usize| (0..query % 17).map(|_| rng.random_range(0..rows as u32)).collect();
        let wanted: Vec<Vec<u32>> = queries.iter().map(wanted).collect();
        for (place, found) in space.ranks(&queries, &wanted).iter().enumerate() {
            let squared = |row: usize| space.squared_prepared(queries[place], row);
            let others: Vec<f32> = (0..rows).filter(|&row| row != queries[place]).map(squared).collect();
            let rank = |&row: &u32| 1 + others.iter().filter(|&&other| other < squared(row as usize)).count() as u64;
            let mut expected: Vec<u64> = wanted[place].iter().map(rank).collect();
            expected.sort_unstable();
            assert_eq!(*found, expected, "query {}", queries[place]);
        }
    }
}

#[test]
fn one_thread_and_three_give_the_same() {
    let values = random(5000, 16, 1);
    let (episode, step) = keys(5000, 50);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let space = Space::new(Table::new(16, &values, &episode, &step).unwrap(), Metric::Standardized).unwrap();
            graph(&space, 15, Exclude::Trajectory).unwrap()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn new_points_find_themselves_in_the_table() {
    let values = random(500, 6, 2);
    let (episode, step) = keys(500, 500);
    let table = Table::new(6, &values, &episode, &step).unwrap();
    let space = Space::new(table, Metric::Standardized).unwrap();
    let found = nearest_to(&space, &table, 3).unwrap();
    for row in 0..500 {
        assert_eq!((found.rows(row)[0], found.distances(row)[0]), (row as u32, 0.0));
    }
}

#[test]
fn a_constant_dimension_changes_nothing_and_is_named() {
    let values = random(200, 4, 3);
    let padded: Vec<f32> = values.chunks_exact(4).flat_map(|x| [x[0], x[1], 0.1, x[2], x[3]]).collect();
    let (episode, step) = keys(200, 10);
    let plain = Space::new(Table::new(4, &values, &episode, &step).unwrap(), Metric::Standardized).unwrap();
    let padded = Space::new(Table::new(5, &padded, &episode, &step).unwrap(), Metric::Standardized).unwrap();
    assert_eq!(padded.constant_dims(), [2]);
    let rows = |space| graph(space, 5, Exclude::Trajectory).unwrap();
    assert_eq!(rows(&plain), rows(&padded));
}

#[test]
fn refuses_what_it_cannot_answer() {
    let (episode, step) = keys(10, 5);
    let table = |values: &'static [f32]| {
        Table::new(1, values, &[0, 0, 0, 0, 0, 1, 1, 1, 1, 1], &[0, 1, 2, 3, 4, 0, 1, 2, 3, 4])
    };
    let one_point = Space::new(table(&[2.0; 10]).unwrap(), Metric::Standardized);
    assert!(matches!(one_point, Err(Error::Constant { rows: 10, .. })));
    let mut values = [0.0; 10];
    values[7] = f32::NAN;
    let refused = Table::new(1, &values, &episode, &step);
    assert!(matches!(refused, Err(Error::NotFinite { episode: 1, step: 2, dim: 0, .. })));
    let space =
        Space::new(table(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).unwrap(), Metric::Euclidean).unwrap();
    let short = nearest(&space, &[3], 6, Exclude::Trajectory);
    assert!(matches!(short, Err(Error::TooFewNeighbours { episode: 0, step: 3, needed: 6, found: 5, .. })));
    assert!(matches!(nearest(&space, &[10], 1, Exclude::Itself), Err(Error::NoSuchRow { row: 10, .. })));
    assert!(matches!(nearest(&space, &[0], 0, Exclude::Itself), Err(Error::Option { .. })));
    assert!("manhattan".parse::<Metric>().unwrap_err().to_string().contains("standardized, euclidean, cosine"));
}

#[test]
fn huge_and_tiny_latents_are_told_apart() {
    let (episode, step) = keys(100, 10);
    for factor in [1e-30_f32, 1e30] {
        let values: Vec<f32> = random(100, 3, 9).iter().map(|x| x * factor).collect();
        let table = Table::new(3, &values, &episode, &step).unwrap();
        for metric in [Metric::Standardized, Metric::Euclidean] {
            let space = Space::new(table, metric).unwrap();
            let found = nearest(&space, &[0], 5, Exclude::Itself).unwrap();
            let rows: Vec<u32> = brute_force(&space, 0, 5, |row| row != 0).iter().map(|&(row, _)| row).collect();
            assert_eq!(found.rows(0), rows, "{metric:?} {factor}");
        }
    }
}

/// Prints the times; run with `--ignored --nocapture`.
#[test]
#[ignore = "a benchmark"]
fn bench() {
    let values = random(125_000, 32, 1);
    let (episode, step) = keys(125_000, 250);
    let table = Table::new(32, &values, &episode, &step).unwrap();
    let queries: Vec<usize> = (0..20).map(|query| query * 6000).collect();
    let start = std::time::Instant::now();
    let space = Space::new(table, Metric::Standardized).unwrap();
    let prepared = start.elapsed();
    nearest(&space, &queries, 5, Exclude::Trajectory).unwrap();
    println!("20 queries over 125,000 x 32: {:.3} s, of it {prepared:.3?} preparing", start.elapsed().as_secs_f64());
    let table = Table::new(32, &values[..25_000 * 32], &episode[..25_000], &step[..25_000]).unwrap();
    let start = std::time::Instant::now();
    graph(&Space::new(table, Metric::Standardized).unwrap(), 15, Exclude::Itself).unwrap();
    println!("15-neighbour graph of 25,000 x 32: {:.3} s", start.elapsed().as_secs_f64());
}
