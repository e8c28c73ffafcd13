use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Method, cluster_table, clusters};
use crate::probes::{HoldOut, Quantity, Values};
use crate::{Error, Table};

/// Three clouds of 100, 60 and 40 rows, far apart, in mixed order; and which cloud each row is from.
fn clouds() -> (Vec<f32>, Vec<u32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let cloud = |row: usize| [0, 1, 0, 2, 0, 1, 0, 2, 0, 1][row % 10];
    let mut values = Vec::new();
    for row in 0..200 {
        let at = [[0.0_f32, 0.0, 0.0], [10.0, 0.0, 5.0], [0.0, 12.0, -5.0]][cloud(row)];
        values.extend(at.map(|x| x + rng.random_range(-0.5..0.5_f32)));
    }
    (values, (0..200).map(|row| cloud(row) as u32).collect())
}

fn keys(rows: u32) -> (Vec<u32>, Vec<u32>) {
    ((0..rows).map(|row| row / 10).collect(), (0..rows).map(|row| row % 10).collect())
}

#[test]
fn clouds_far_apart_are_the_clusters_and_the_largest_is_the_first() {
    let (values, cloud) = clouds();
    let (episode, step) = keys(200);
    let table = Table::new(3, &values, &episode, &step).unwrap();
    for method in [Method::KMeans { k: 3 }, Method::Dbscan { min_points: 5, reach: 0.5 }] {
        let found = clusters(&table, method, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        assert_eq!(found, cloud.iter().map(|&cloud| Some(cloud)).collect::<Vec<_>>(), "{method:?}");
    }
}

#[test]
fn rows_in_thin_places_belong_to_none_and_same_seed_same_clusters() {
    let (mut values, _) = clouds();
    values[..3].copy_from_slice(&[40.0, 40.0, 40.0]);
    let (episode, step) = keys(200);
    let table = Table::new(3, &values, &episode, &step).unwrap();
    let dense = Method::Dbscan { min_points: 5, reach: 0.3 };
    let found = clusters(&table, dense, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    assert!(found[0].is_none() && found[1..].iter().all(Option::is_some), "{found:?}");
    let run = |seed| clusters(&table, Method::KMeans { k: 7 }, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap();
    assert_eq!(run(3), run(3));
}

/// More rows than are clustered: the others follow their nearest, and the answer is still the clouds.
#[test]
fn a_large_table_is_clustered_on_a_part() {
    let (values, cloud) = clouds();
    let values = values.repeat(125);
    let (episode, step) = keys(25_000);
    let table = Table::new(3, &values, &episode, &step).unwrap();
    let found = clusters(&table, Method::KMeans { k: 3 }, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    assert!(found.iter().zip(cloud.iter().cycle()).all(|(found, &cloud)| *found == Some(cloud)));
}

#[test]
fn the_table_says_what_each_cluster_holds() {
    let (values, cloud) = clouds();
    let (episode, step) = keys(200);
    let state: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode / 4)).collect();
    let distractor: Vec<Option<u32>> = episode.iter().map(|episode| Some(episode % 4)).collect();
    let table = Table::new(3, &values, &episode, &step).unwrap().with_grid(&state, &distractor).unwrap();
    let labels: Vec<Option<u32>> = cloud.iter().map(|&cloud| (cloud < 2).then_some(cloud)).collect();
    let numbers = Quantity {
        name: "cloud".into(),
        hold_out: HoldOut::State,
        values: Values::Numbers(cloud.iter().map(|&cloud| f64::from(cloud)).collect()),
    };
    let classes = Quantity { name: "class".into(), values: Values::Classes(cloud.clone()), ..numbers.clone() };
    let found = cluster_table(&table, &labels, &[numbers, classes]).unwrap();
    let sizes: Vec<(Option<u32>, usize)> = found.iter().map(|line| (line.cluster, line.rows)).collect();
    assert_eq!(sizes, [(Some(0), 100), (Some(1), 60), (None, 40)]);
    assert_eq!((found[0].states, found[0].distractors), (5, 4));
    // All rows: 0 in 100, 1 in 60, 2 in 40; mean 0.7, variance 0.61.
    let typical = &found[1].quantities;
    assert!((typical[0].value - 1.0).abs() < 1e-12 && typical[0].spread < 1e-12);
    assert!((typical[0].apart - 0.3 / 0.61_f64.sqrt()).abs() < 1e-9);
    assert_eq!((typical[1].value, typical[1].spread, typical[1].apart), (1.0, 1.0, 0.3));
}

/// Half of the rows in one point, as a collapsed encoder puts them.
#[test]
fn many_equal_rows_are_one_cluster() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let values: Vec<f32> =
        (0..4000 * 4).map(|at| if at / 4 % 2 == 0 { 0.5 } else { rng.random_range(-9.0..9.0) }).collect();
    let (episode, step) = keys(4000);
    let table = Table::new(4, &values, &episode, &step).unwrap();
    let dense = Method::Dbscan { min_points: 50, reach: 0.1 };
    let found = clusters(&table, dense, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    assert!((0..4000).step_by(2).all(|row| found[row] == Some(0)));
    let found = clusters(&table, Method::KMeans { k: 8 }, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    assert!((0..4000).step_by(2).all(|row| found[row] == found[0]));
}

#[test]
fn wrong_options_are_refused() {
    let (values, _) = clouds();
    let (episode, step) = keys(200);
    let table = Table::new(3, &values, &episode, &step).unwrap();
    let run = |method| clusters(&table, method, &mut ChaCha8Rng::seed_from_u64(0));
    assert!(matches!(run(Method::KMeans { k: 0 }), Err(Error::Option { option: "clusters", .. })));
    assert!(matches!(run(Method::KMeans { k: 201 }), Err(Error::TooFewRows { needed: 201, .. })));
    let thin = Method::Dbscan { min_points: 1, reach: 1.0 };
    assert!(matches!(run(thin), Err(Error::Option { option: "min-points", .. })));
    let none = Method::Dbscan { min_points: 5, reach: f64::NAN };
    assert!(matches!(run(none), Err(Error::Option { option: "reach", .. })));
    let flat = Table::new(3, &[1.0; 600], &episode, &step).unwrap();
    let refused = clusters(&flat, Method::KMeans { k: 2 }, &mut ChaCha8Rng::seed_from_u64(0));
    assert!(matches!(refused, Err(Error::Constant { .. })));
}

/// Of more rows than clusters are found on, those that lie alone belong to none, drawn or not.
#[test]
fn rows_that_lie_alone_belong_to_none_in_a_large_table_too() {
    const DENSE: usize = 11_000;
    const ALONE: usize = 400;
    let mut values = Vec::new();
    for row in 0..DENSE {
        let turn = row as f32 / DENSE as f32 * std::f32::consts::TAU;
        values.extend([0.3 * turn.cos(), 0.3 * turn.sin()]);
    }
    for row in 0..ALONE {
        let turn = row as f32 / ALONE as f32 * std::f32::consts::TAU;
        values.extend([10.0 * turn.cos(), 10.0 * turn.sin()]);
    }
    let keys: Vec<u32> = (0..(DENSE + ALONE) as u32).collect();
    let table = Table::new(2, &values, &keys, &keys).unwrap();
    let method = Method::Dbscan { min_points: 8, reach: 0.02 };
    let found = clusters(&table, method, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
    assert!(found[..DENSE].iter().all(|cluster| *cluster == Some(0)));
    assert!(found[DENSE..].iter().all(Option::is_none));
}
