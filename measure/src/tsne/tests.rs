use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::quadtree::Quadtree;
use super::{TsneOptions, tsne};
use crate::neighbours::{Metric, Space};
use crate::quality::{QualityOptions, quality};
use crate::{Error, Table};

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// The first 800 of the golden points: 8 arcs in 32 dimensions.
fn arcs() -> Vec<f32> {
    let bytes = include_bytes!("../../tests/golden/arcs.f32");
    bytes.as_chunks::<4>().0[..800 * 32].iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

fn with_space<T>(values: &[f32], dims: usize, run: impl FnOnce(&Space<'_>) -> T) -> T {
    let keys = vec![0; values.len() / dims];
    run(&Space::new(Table::new(dims, values, &keys, &keys).unwrap(), Metric::Euclidean).unwrap())
}

#[test]
fn the_tree_repels_as_all_points_one_by_one() {
    let mut rng = generator(0);
    let mut positions: Vec<[f32; 2]> =
        (0..500).map(|_| [rng.random_range(-5.0..5.0), rng.random_range(-5.0..5.0)]).collect();
    positions.extend([[1.0, 2.0]; 3]);
    let tree = Quadtree::new(&positions);
    for &at in &positions {
        let (mut force, mut total, mut pushes) = ([0.0_f64; 2], -1.0, 0.0);
        for other in &positions {
            let difference = [f64::from(at[0] - other[0]), f64::from(at[1] - other[1])];
            let weight = 1.0 / (1.0 + difference[0].powi(2) + difference[1].powi(2));
            total += weight;
            pushes += weight * weight * difference[0].hypot(difference[1]);
            force = [force[0] + weight * weight * difference[0], force[1] + weight * weight * difference[1]];
        }
        for (theta, tolerance) in [(0.0, 1e-4), (0.5, 0.03)] {
            let (got, got_total) = tree.repulsion(at, theta);
            assert!((f64::from(got_total) / total - 1.0).abs() < tolerance, "{got_total} {total}");
            assert!(
                (0..2).all(|axis| (f64::from(got[axis]) - force[axis]).abs() < tolerance * pushes),
                "{got:?} {force:?}"
            );
        }
    }
}

#[test]
fn keeps_neighbourhoods_and_depends_on_the_seed_alone() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            with_space(&arcs(), 32, |space| {
                let options = TsneOptions { iterations: 500, ..TsneOptions::default() };
                let map = tsne(space, options, &mut generator(0)).unwrap();
                (quality(space, &map, QualityOptions::default(), &mut generator(0)).unwrap(), map)
            })
        })
    };
    let (quality, map) = run(1);
    assert!(quality.trustworthiness > 0.995 && quality.kept > 0.75, "{quality:?}");
    assert_eq!(map, run(3).1);
}

#[test]
fn duplicated_points_and_too_few_points() {
    let values: Vec<f32> = (0..300).flat_map(|row| [(row % 5) as f32, (row % 3) as f32]).collect();
    with_space(&values, 2, |space| {
        let options = TsneOptions { perplexity: Some(5.0), iterations: 200, ..TsneOptions::default() };
        let map = tsne(space, options, &mut generator(0)).unwrap();
        assert!(map.as_flattened().iter().all(|x| x.is_finite()));
        assert!(matches!(
            tsne(space, TsneOptions { perplexity: Some(100.0), ..options }, &mut generator(0)),
            Err(Error::Option { option: "perplexity", .. })
        ));
        let refused = tsne(space, TsneOptions { theta: 2.0, ..options }, &mut generator(0));
        assert!(matches!(refused, Err(Error::Option { option: "theta", .. })));
    });
}

/// The default fits tables of any size from four rows on, as those of a short recording are.
#[test]
fn the_default_fits_the_rows() {
    for rows in [4, 5, 13, 78, 90, 91] {
        let mut rng = generator(rows as u64);
        let values: Vec<f32> = (0..rows * 3).map(|_| rng.random_range(-1.0..1.0)).collect();
        with_space(&values, 3, |space| {
            let options = TsneOptions { iterations: 100, ..TsneOptions::default() };
            let map = tsne(space, options, &mut generator(0)).unwrap();
            assert!(map.len() == rows && map.as_flattened().iter().all(|x| x.is_finite()), "{rows} rows");
        });
    }
    assert_eq!(TsneOptions::default().graph_size(78).unwrap(), 77);
    assert_eq!(TsneOptions::default().graph_size(91).unwrap(), 90);
    assert_eq!(TsneOptions::default().graph_size(1000).unwrap(), 90);
    assert!(matches!(TsneOptions::default().graph_size(3), Err(Error::TooFewRows { needed: 4, .. })));
}
